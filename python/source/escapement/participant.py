"""Participants: models that own their state and exchange messages through ports."""

import inspect
import io
import json
import operator
import os
import pickle
import sys
import threading
import traceback

from . import _native
from .errors import EscapementError, MessageError, ParameterError
from .message import Message

_MISSING = object()
# Files of this package, which are in the traceback of every participant.
_OWN = __file__.rsplit("/", 1)[0]
# Whether this process hosts one participant, so that standard error is its log.
_hosting = False


class _Port:
    """A port as a class declares it."""

    __slots__ = ("message", "required", "name", "is_input")

    def __init__(self, message, required, is_input):
        if not (isinstance(message, type) and issubclass(message, Message) and message.fields):
            raise MessageError(f"a port takes a message class with fields, not {message!r}")
        self.message, self.required, self.is_input = message, required, is_input
        self.name = None


def Input(message, *, required=True, name=None):
    """An input that takes `message`. One that is not required may stay unconnected and then holds zeros."""
    port = _Port(message, required, True)
    port.name = name
    return port


def Output(message, *, name=None):
    """An output that publishes `message`. A field that a step does not write keeps its last value."""
    port = _Port(message, True, False)
    port.name = name
    return port


class _Parameter:
    __slots__ = ("unit", "default", "count", "key")

    def __init__(self, unit, default, count, key):
        self.unit, self.default, self.count, self.key = unit, default, count, key


def Parameter(unit=None, *, default=_MISSING, count=None, key=None):
    """A parameter of the scenario, read before `__init__`.

    With a unit, a number in that unit: `Parameter("kg")` reads `"500 g"` as 0.5, and `Parameter("m", count=3)` reads
    `"[0, 1, 2] mm"` as a list. `"1"` is a number without a unit. Without `unit` it is the value as stated in the scenario: a text, a
    table, true or false. `key` is its dotted key if that differs from the attribute's name.
    """
    return _Parameter(unit, default, count, key)


def _guarded(name, what):
    """A property that returns what `_bind` has stored. A port cannot be replaced, only written to."""

    def put(self, value):
        raise AttributeError(
            f"`{name}` is {what} of `{type(self).__name__}`: write to its fields, such as self.{name}.FIELD = …"
            if what != "a parameter"
            else f"`{name}` is a parameter of `{type(self).__name__}` and stays as the scenario has it"
        )

    return property(operator.attrgetter(f"_esc_at_{name}"), put)


def _refuse_taken(cls, key, value):
    """A port or a parameter would hide a member of every participant: the host would call a message as `save`."""
    if hasattr(Participant, key) or key.startswith("_esc_"):
        what = "parameter" if isinstance(value, _Parameter) else "input" if value.is_input else "output"
        other = "key" if what == "parameter" else "name"
        raise EscapementError(
            f"`{cls.__name__}`: its {what} `{key}` would hide `{key}` of every participant: call the attribute otherwise, and the {what} "
            f"by {other}={key!r}"
        )


class Participant:
    """The base of participants in Python:

        class Pid(esc.Participant):
            measured = esc.Input(Motion)
            command = esc.Output(Force)
            def step(self, t, dt):
                self.command.force = -40.0 * self.measured.position

    `kind` is `"sampled"` (computes at t from the inputs at t) or `"continuous"` (holds its inputs from t to t + dt, and its outputs are
    those at t + dt; `initialise` writes the first ones). `self.name`, `self.seed`, `self.period` and `self.offset` have the values of the
    scenario. The state consists of the attributes that a step leaves in `self`: pickle saves and restores it unless `save` and `restore`
    are defined.
    """

    kind = "sampled"
    _esc_ports = {}
    _esc_parameters = {}

    def __init_subclass__(cls, **others):
        super().__init_subclass__(**others)
        ports, parameters = dict(cls._esc_ports), dict(cls._esc_parameters)
        for key, value in list(vars(cls).items()):
            if isinstance(value, (_Port, _Parameter)):
                _refuse_taken(cls, key, value)
            if isinstance(value, _Port):
                value.name = value.name or key
                ports[key] = value
                setattr(cls, key, _guarded(key, "an input" if value.is_input else "an output"))
            elif isinstance(value, _Parameter):
                value.key = value.key or key
                parameters[key] = value
                setattr(cls, key, _guarded(key, "a parameter"))
        cls._esc_ports, cls._esc_parameters = ports, parameters

    def __new__(cls, *arguments, **keywords):
        if cls is Participant:
            raise TypeError("a participant is a subclass of Participant with ports and a step")
        self = super().__new__(cls)
        (name, self.__dict__["_esc_seed"], self.__dict__["_esc_period"], self.__dict__["_esc_offset"]), values = getattr(
            _making, "setup", _NO_SETUP
        )
        self.__dict__["_esc_name"] = name or cls.__name__
        self.__dict__["_esc_lines"] = None
        self.__dict__["_esc_termination"] = None
        for key, port in cls._esc_ports.items():
            message = port.message.__new__(port.message)
            message._open(port.is_input)
            self.__dict__[f"_esc_at_{key}"] = message
        outputs = [key for key, port in cls._esc_ports.items() if not port.is_input]
        self.__dict__["_esc_output"] = {key: number for number, key in enumerate(outputs)}
        # Bit 0: this sample is seen; bit 1: some sample is. The host writes them.
        self.__dict__["_esc_seen"] = bytearray(b"\x03" * len(outputs))
        for key, parameter in cls._esc_parameters.items():
            value = values.get(parameter.key, parameter.default)
            self.__dict__[f"_esc_at_{key}"] = None if value is _MISSING else value
        return self

    name = property(operator.attrgetter("_esc_name"), doc="Its name in the scenario.")
    seed = property(operator.attrgetter("_esc_seed"), doc="The seed of the run.")
    period = property(operator.attrgetter("_esc_period"), doc="Its sample period, s.")
    offset = property(operator.attrgetter("_esc_offset"), doc="Its first activation, s.")

    def initialise(self, t):
        """Called once before the first step. A continuous participant writes its outputs at `t`."""

    def step(self, t, dt):
        """One activation at `t`, s, until the next one at `t + dt`."""
        raise NotImplementedError

    def terminate(self):
        """Called once when the participant ends, also after a failure; `self.termination` has the reason."""

    termination = property(
        operator.attrgetter("_esc_termination"),
        doc='Why its part in the run is over: "finished" (it has done all of its activations), "stopped" (the run ends before that) or '
        '"replaced" (another one takes its place); None before.',
    )

    def log(self, text):
        """In `initialise`, `step` and `terminate`: writes a line with the simulated time to the participant's log."""
        if self._esc_lines is None:
            # The participant is not part of a run.
            print(f"{self.name}: {text}", file=sys.stderr)
        else:
            self._esc_lines.write(_encodable(str(text)))

    def uniform(self, stream, index):
        """A number in [0, 1): the same in every run with this seed, independently of earlier samples."""
        return _native.uniform(self.seed, f"{self.name}.{stream}", index)

    def normal(self, stream, index):
        """A standard normal number, in the same way."""
        return _native.normal(self.seed, f"{self.name}.{stream}", index)

    def is_seen(self, output):
        """Whether the sample of `self.OUTPUT` that this call writes is seen: read by an input, recorded on the tape, measured, assessed
        or guarded. An unseen sample need not be computed. A seen sample must not depend on which earlier samples were seen."""
        return bool(self._esc_seen[self._esc_number(output)] & 1)

    def is_ever_seen(self, output):
        """Whether any sample of `self.OUTPUT` is seen in this run."""
        return bool(self._esc_seen[self._esc_number(output)] & 2)

    def _esc_number(self, output):
        try:
            return self._esc_output[output]
        except (KeyError, TypeError):
            known = ", ".join(self._esc_output) or "none"
            raise AttributeError(f"{output!r} is no output of `{type(self).__name__}`; there are {known}") from None

    def save(self):
        """The whole state as bytes. By default: a pickle of the attributes of `self` other than ports and parameters."""
        state = {key: value for key, value in self.__dict__.items() if not key.startswith("_esc_")}
        try:
            return pickle.dumps((type(self).__name__, state), protocol=4)
        except Exception as error:
            for key, value in state.items():
                try:
                    pickle.dumps(value, protocol=4)
                except Exception:
                    raise EscapementError(
                        f"`{type(self).__name__}` cannot be saved: its attribute `{key}` cannot be pickled ({error}); give it `save` and `restore`"
                    ) from None
            raise

    def restore(self, state):
        """Restores the state that `save` returned."""
        try:
            _, kept = _Unpickler(io.BytesIO(state), type(self)).load()
            kept = dict(kept)
        except Exception as error:
            raise EscapementError(
                f"the state of {len(state)} bytes is none of a participant in Python ({type(error).__name__}: {error}); "
                "to take over another one's state, give `restore`"
            ) from None
        for key in [key for key in self.__dict__ if not key.startswith("_esc_")]:
            del self.__dict__[key]
        self.__dict__.update(kept)

    def _esc_save(self):
        state = self.save()
        try:
            # Not `bytes(state)`, which makes zeros of a number and bytes of a list.
            view = memoryview(state)
        except TypeError:
            view = None
        if view is None or "O" in view.format:
            raise EscapementError(
                f"`save` of `{type(self).__name__}` returned {_article(type(state).__name__)}, not the state as bytes: return bytes, such as "
                "pickle.dumps(…) or array.tobytes()"
            )
        return view.tobytes()

    def _esc_restore(self, state):
        self.restore(state)

    def _esc_terminate(self, why):
        self.__dict__["_esc_termination"] = why
        self.terminate()


class _Unpickler(pickle.Unpickler):
    """Finds classes of the participant's file under any name by which it was imported: as a script, as a module, or by its host."""

    def __init__(self, state, cls):
        super().__init__(state)
        self._own = sys.modules.get(cls.__module__)

    def find_class(self, module, name):
        own = getattr(self._own, "__file__", None)
        stem = os.path.splitext(os.path.basename(own))[0] if own else ""
        if module == "__main__" or module.rpartition(".")[2].endswith(stem):
            try:
                return operator.attrgetter(name)(self._own)
            except AttributeError:
                pass
        return super().find_class(module, name)


# The setup of a participant that is not part of a run: name, seed, period, offset; and its parameters.
_NO_SETUP = (("", 1, 0.0, 0.0), {})
# The setup of the participant that this thread is creating.
_making = threading.local()


def _declared(cls):
    """The parameters of `cls` for the host: key, unit, whether required, count."""
    if isinstance(cls, BaseException):
        # The class could not be imported.
        raise cls
    if not (isinstance(cls, type) and issubclass(cls, Participant)):
        raise EscapementError(f"{cls!r} is no participant: give a subclass of escapement.Participant")
    if cls.step is Participant.step:
        raise EscapementError(f"`{cls.__name__}` has no step: define step(self, t, dt)")
    for name in ("initialise", "step", "terminate", "save", "restore"):
        _refuse_unfinished(cls, name)
    if cls.kind not in ("sampled", "continuous"):
        raise EscapementError(f"the kind of `{cls.__name__}` is {cls.kind!r}: write \"sampled\" or \"continuous\"")
    return [
        _Key(one.key, one.unit, one.default is _MISSING, one.count or 0) for one in cls._esc_parameters.values()
    ]


def _refuse_unfinished(cls, name):
    """A call of such a function only creates an object, which is never run."""
    function = inspect.unwrap(getattr(cls, name))
    for is_so, what in (
        (inspect.iscoroutinefunction, "is declared with `async`"),
        (inspect.isgeneratorfunction, "has a `yield` in it"),
        (inspect.isasyncgenfunction, "is declared with `async`"),
    ):
        if is_so(function):
            raise EscapementError(f"`{name}` of `{cls.__name__}` {what}, so that a call would not run it: make it an ordinary function")


class _Key:
    __slots__ = ("key", "unit", "required", "count")

    def __init__(self, key, unit, required, count):
        self.key, self.unit, self.required, self.count = key, unit, required, count


def _make(cls, about, values):
    _making.setup = (about, values)
    try:
        return cls()
    finally:
        _making.setup = _NO_SETUP


def _interface(participant):
    ports = [(port, port.message.descriptor) for port in participant._esc_ports.values()]
    inputs = [
        {"name": port.name, "descriptor": descriptor, "required": port.required} for port, descriptor in ports if port.is_input
    ]
    outputs = [{"name": port.name, "descriptor": descriptor} for port, descriptor in ports if not port.is_input]
    return json.dumps({"kind": participant.kind, "inputs": inputs, "outputs": outputs})


def _memory(participant):
    all_of = [(port, getattr(participant, key)._memory) for key, port in participant._esc_ports.items()]
    return [memory for port, memory in all_of if port.is_input], [memory for port, memory in all_of if not port.is_input]


def _article(name):
    return name if name == "NoneType" else f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _short(error):
    """An exception in one line, with the place in the user's own code and its notes."""
    formatted = traceback.TracebackException(type(error), error, None)
    # The last line is the message only where the notes do not follow it.
    formatted.__notes__ = None
    last_line = list(formatted.format_exception_only())[-1].strip()
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(_OWN)]
    if own:
        last_line = f"{last_line} ({own[-1].filename}:{own[-1].lineno}, in {own[-1].name})"
    elif isinstance(error, EscapementError):
        last_line = str(error)
    notes = getattr(error, "__notes__", None)
    noted = [str(note) for note in notes] if isinstance(notes, (list, tuple)) else []
    return _encodable("; ".join([last_line, *noted]))


def _encodable(text):
    """`text` for Rust and for files: what is not valid Unicode is escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def _log_traceback(error):
    """Writes the traceback to standard error if that is the log of this participant; otherwise the exception is raised later."""
    if _hosting:
        traceback.print_exception(type(error), error, error.__traceback__, file=sys.stderr)
        sys.stderr.flush()


def traceback_text(error):
    """The traceback as text."""
    out = io.StringIO()
    traceback.print_exception(type(error), error, error.__traceback__, file=out)
    return out.getvalue()


__all__ = ["Input", "Output", "Parameter", "Participant", "ParameterError"]
