"""What can go wrong, as exceptions. All of them are `EscapementError`."""


class EscapementError(Exception):
    """The base of every exception of this package."""

    def __init__(self, message):
        super().__init__(message)
        self.message = message


class ScenarioWarning(UserWarning):
    """A warning: something in a scenario that is valid, but probably not intended."""


class Mistake:
    """One mistake of a scenario: `line` (from 1, or None), `key` (dotted) and `reason`, which ends with the remedy."""

    __slots__ = ("line", "key", "reason")

    def __init__(self, line, key, reason):
        self.line, self.key, self.reason = line, key, reason

    def __repr__(self):
        return f"Mistake(line={self.line}, key={self.key!r}, reason={self.reason!r})"


class ScenarioError(EscapementError):
    """A scenario that is rejected before anything runs.

    `file`, `line`, `key` and `reason` are those of the first mistake, `mistakes` has all of them. The reason says what is wrong with
    which value, and the remedy.
    """

    def __init__(self, message, *, file="", mistakes=()):
        super().__init__(message)
        self.file = file
        self.mistakes = [Mistake(*mistake) for mistake in mistakes]
        first = self.mistakes[0] if self.mistakes else Mistake(None, "", message)
        self.line, self.key, self.reason = first.line, first.key, first.reason


class ParameterError(EscapementError):
    """A parameter that a participant rejects: raise it in `__init__`, and the scenario is rejected with file, line and key."""

    def __init__(self, key, reason):
        super().__init__(f"`{key}`: {reason}")
        self.key, self.reason = key, reason


class RunError(EscapementError):
    """A run that failed, or cannot continue.

    `participant` is the name of the failed participant, or None. `run` is the run folder, if there is one: its tape can be read up to the
    failure. `__cause__` is the participant's exception, if it ran in this process.
    """

    def __init__(self, message, *, participant=None, run=None):
        super().__init__(message)
        self.participant, self.run = participant, run


class OptionError(EscapementError):
    """An option that does not fit the run."""


class PortError(EscapementError):
    """A port that does not exist, or does not fit its use."""


class TapeError(EscapementError):
    """A run folder or a tape that cannot be read."""


class ProgramError(EscapementError):
    """The program `escapement` was not found, or has failed."""


class MessageError(EscapementError, TypeError):
    """A class or a value that is not a message, or not of the required type."""
