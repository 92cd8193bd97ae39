"""Runs: executed to their end at once, or advanced from pause to pause."""

import numbers
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterable
from types import SimpleNamespace

import numpy as np

from . import _native, _program, participant as _participant
from .errors import EscapementError, MessageError, OptionError, PortError, RunError, ScenarioWarning
from .message import Message
from .scenarios import Scenario, _listed
from .tape import RunFolder

_LINE_INTERVAL = 0.1
# The time that a participant in a separate process has for an activation, s.
_DEFAULT_PATIENCE = 60.0
# Why a `Run` takes no call.
_ENDED = "the run has ended: start another one"
_CALL_IN_PROGRESS = "a call of this run goes on, in which a participant or the progress function called the run: call it between its steps"


class _Progress:
    """A progress line on standard error, in a terminal or a notebook; elsewhere nothing."""

    def __init__(self, wanted):
        out = sys.stderr
        notebook = type(out).__module__.startswith("ipykernel")
        shown = wanted if wanted is not None else (notebook or (hasattr(out, "isatty") and out.isatty()))
        self._shown, self._duration, self._last, self._width = shown, 0.0, 0.0, 0
        self._begun = time.monotonic()

    def __call__(self, what, value):
        if what == "notice":
            self._clear()
            print(value, file=sys.stderr)
        elif not self._shown:
            return
        elif what == "begun":
            self._duration, self._begun = value, time.monotonic()
        elif what == "time" and time.monotonic() - self._last > _LINE_INTERVAL:
            self._last = time.monotonic()
            factor = value / max(self._last - self._begun, 1e-3)
            part = 100.0 * value / self._duration if self._duration else 0.0
            self._line(f"t = {value:.3f} s of {self._duration:g} s ({part:.0f} %), {factor:.1f} times real time")
        elif what == "over":
            self._clear()

    def _line(self, text):
        sys.stderr.write("\r" + text.ljust(self._width))
        sys.stderr.flush()
        self._width = len(text)

    def _clear(self):
        if self._width:
            sys.stderr.write("\r" + " " * self._width + "\r")
            sys.stderr.flush()
            self._width = 0


class _Interruptible:
    """The first Ctrl-C requests an orderly end of the run, a second one raises at once. Only the main thread receives signals."""

    def __init__(self, interrupt):
        self._interrupt = interrupt
        self._previous_handler = None

    def __enter__(self):
        if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._previous_handler = signal.signal(signal.SIGINT, self._handle_sigint)
        return self

    def _handle_sigint(self, number, frame):
        if self._interrupt.is_requested():
            raise KeyboardInterrupt
        self._interrupt.request()

    def __exit__(self, *_):
        if self._previous_handler is not None:
            signal.signal(signal.SIGINT, self._previous_handler)


def _run_options(in_process, record, out, force, pace, checkpoint_every, checkpoint_at, patience, resume=None, resume_from=None):
    several = isinstance(checkpoint_at, Iterable) and not isinstance(checkpoint_at, str) and np.ndim(checkpoint_at) > 0
    times = list(checkpoint_at) if several else [checkpoint_at]
    if patience is not None and in_process:
        warnings.warn(
            f"patience={patience!r} has no effect on a run in one process, where a step that does not come back cannot be ended: run its "
            "participants in processes",
            ScenarioWarning,
            stacklevel=3,
        )
    return SimpleNamespace(
        in_process=bool(in_process),
        record=record,
        out=None if out is None else _path("out", out),
        force=bool(force),
        pace=None if not pace else _pace(pace),
        checkpoint_every=None if checkpoint_every is None else _time("checkpoint_every", checkpoint_every),
        checkpoint_at=[_time("checkpoint_at", time) for time in times],
        patience=_DEFAULT_PATIENCE if patience is None else _patience(patience),
        resume=resume,
        resume_from=None if resume_from is None else _time("at", resume_from),
    )


def _path(option, value):
    try:
        return os.fspath(value)
    except TypeError:
        raise OptionError(f"{option}={value!r} is no path: give a text or a pathlib.Path") from None


def _is_within(folder, other):
    """Whether `folder` is `other` or in it, also by way of links."""
    folder, other = os.path.realpath(folder), os.path.realpath(other)
    return os.path.commonpath([folder, other]) == other


def _time(option, value):
    """A time for the native module, which reads it exactly: a text such as "2.5 s", or a number of seconds."""
    if np.ndim(value) == 0 and hasattr(value, "item"):
        # Of numpy, whose `repr` names its type.
        value = value.item()
    text = value
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        text = f"{value} s" if isinstance(value, numbers.Rational) else f"{float(value)!r} s"
    if not isinstance(text, str):
        raise OptionError(f'{option}={value!r} is no time: write such as "2.5 s" or "1/300 s", or a number of seconds')
    return text


def _patience(value):
    """A number of seconds."""
    try:
        (seconds,) = _native.convert(value, "s") if isinstance(value, str) else (float(value),)
    except (TypeError, ValueError) as error:
        raise OptionError(f'patience={value!r} is no time: {error}; write such as "30 s", or a number of seconds') from None
    return seconds


def _pace(value):
    try:
        return float(value)
    except (TypeError, ValueError):
        raise OptionError(f"pace={value!r} is no number: give simulated seconds per second") from None


def _scenario(scenario, set, participants, faults=()):
    if isinstance(scenario, Scenario):
        if not (set or participants or faults):
            return scenario._fresh()
        return Scenario(
            scenario.file,
            set={**scenario._sets, **(set or {})},
            participants={**scenario._participants, **(participants or {})},
            faults=[*scenario._faults, *_listed(faults)],
            text=scenario._text,
        )
    return Scenario(scenario, set=set, participants=participants, faults=faults)


def _runs_in_process(scenario, in_process):
    """Whether the run is in this process."""
    if _participant._hosting:
        raise EscapementError(
            "this process hosts a participant of a run, and its file starts a run when it is imported: put that below "
            'if __name__ == "__main__":'
        )
    native = scenario._native
    if in_process is None:
        in_process = native.runs_here()
    if not in_process:
        if native.needs_program():
            _program.needed("a run in processes")
        _refuse_without_file(scenario)
    return in_process


def _refuse_without_file(scenario):
    for name, cls in scenario._classes.items():
        if not os.path.isfile(name.rpartition(":")[0]):
            raise EscapementError(
                f"`{cls.__qualname__}` was defined where no other process finds it: put it into a file, or run with in_process=True"
            )


def _checked_result(report, interrupt):
    """The result of a run; raises if the run did not reach its end."""
    folder = RunFolder(report["folder"]) if report["folder"] else None
    if report["status"] == "failed":
        cause = report["cause"]
        if folder is not None and cause is not None:
            _append_to_log(folder, report["participant"], cause)
        if interrupt.is_requested():
            # A second Ctrl-C is raised where the interpreter is: in a step, which then fails.
            raise KeyboardInterrupt(report["reason"]) from cause
        raise RunError(report["reason"], participant=report["participant"], run=folder) from cause
    if report["status"] == "stopped" and report["reason"].startswith("interrupted"):
        raise KeyboardInterrupt(report["reason"])
    return folder


def _append_to_log(folder, name, cause):
    log = os.path.join(folder.folder, "log")
    os.makedirs(log, exist_ok=True)
    with open(os.path.join(log, f"{name}.stderr"), "a", encoding="utf-8", errors="backslashreplace") as file:
        file.write(_participant.traceback_text(cause))


class Outcome:
    """The outcome of a run without a folder: `figures`, `summary`, `verdict`, `digest`."""

    def __init__(self, summary, logs=()):
        self.summary, self._logs = summary, dict(logs)

    verdict, digest, figures, criteria = (vars(RunFolder)[name] for name in ("verdict", "digest", "figures", "criteria"))

    def log(self, participant):
        """The lines that a participant has written with `log`, at least the newest 64 KiB; empty if there are none."""
        return self._logs.get(participant, "")

    def __repr__(self):
        return f"Outcome({self.verdict}: {self.figures})"


def run(
    scenario,
    *,
    set=None,
    participants=None,
    faults=(),
    in_process=None,
    out=None,
    force=False,
    record="folder",
    pace=None,
    checkpoint_every=None,
    checkpoint_at=(),
    patience=None,
    progress=None,
):
    """Runs a scenario to its end and returns its run folder.

    `scenario` is a file or a `Scenario`; `set` and `participants` change it as in `Scenario`. With `in_process=True` all participants run in
    one loop of this process, with False each in a separate process; by default in this process where that is possible: classes,
    builtins, libraries and FMUs. The tape is bit-identical. `out` names the run folder, `force` replaces an existing run;
    `record="digest"` keeps only figures and digest, without a folder. `pace` is simulated seconds per second. A run that fails raises
    `RunError`; criteria that are not met do not raise: see `verdict`.
    """
    scenario = _scenario(scenario, set, participants, faults)
    in_process = _runs_in_process(scenario, in_process)
    for text in scenario.warnings:
        warnings.warn(text, ScenarioWarning, stacklevel=2)
    options = _run_options(in_process, record, out, force, pace, checkpoint_every, checkpoint_at, patience)
    return _run(scenario, options, progress)


def resume(run, *, at=None, set=None, participants=None, in_process=None, out=None, force=False, checkpoint_every=None,
           checkpoint_at=(), patience=None, progress=None):
    """Continues from a checkpoint of a run, the newest one or the newest at or before `at`, in a separate folder."""
    folder = os.path.abspath(_path("run", getattr(run, "folder", run)))
    if force and out is not None and _is_within(folder, _path("out", out)):
        raise OptionError(f"out={os.fspath(out)!r}: it has the run that is resumed, which force=True would take away; name another folder")
    scenario = Scenario(os.path.join(folder, "plan.toml"), set=set, participants=participants)
    in_process = _runs_in_process(scenario, in_process)
    options = _run_options(in_process, "folder", out, force, None, checkpoint_every, checkpoint_at, patience, folder, at)
    return _run(scenario, options, progress)


def _run(scenario, options, progress):
    interrupt = _native.Interrupt()
    line = progress if callable(progress) else _Progress(progress)
    report = _interruptible(interrupt, _native.run, scenario._native, options, line, interrupt)
    folder = _checked_result(report, interrupt)
    return folder if folder is not None else Outcome(report["summary"], report["logs"])


def _interruptible(interrupt, method, *arguments):
    """Calls `method`; an error because of Ctrl-C is a KeyboardInterrupt."""
    with _Interruptible(interrupt):
        try:
            return method(*arguments)
        except RunError as error:
            if interrupt.is_requested():
                raise KeyboardInterrupt(str(error)) from error.__cause__
            raise


class Sample:
    """The newest sample of an output: `index`, `t` and the fields of its message."""

    def __init__(self, index, t, message):
        self.index, self.t, self.message = index, t, message

    def __getattr__(self, name):
        return getattr(self.__dict__["message"], name)

    def __repr__(self):
        return f"Sample(index={self.index}, t={self.t}, {self.message!r})"


class Run:
    """A run that is paused except while a method advances it.

        with esc.Run("spring.toml") as run:
            run.run_to("2 s")
            here = run.save()
            run.newest("left.motion").position
            run.restore(here)

    It takes the arguments of `run`. By default its tape is kept in memory. Pausing, stepping and restoring change no bit of the record.
    """

    def __init__(self, scenario, *, set=None, participants=None, faults=(), in_process=None, out=None, force=False, record=None,
                 pace=None, patience=None, progress=False):
        self.scenario = _scenario(scenario, set, participants, faults)
        in_process = _runs_in_process(self.scenario, in_process)
        if record is None:
            record = "memory" if in_process and out is None else "folder"
        options = _run_options(in_process, record, out, force, pace, None, (), patience)
        self._interrupt = _native.Interrupt()
        self._messages = {}
        line = progress if callable(progress) else _Progress(progress)
        # The reason to refuse a call: another call of this run is in progress, or the run has ended.
        self._refusal = None
        self._thread = threading.get_ident()
        self._native = _native.Run(self.scenario._native, options, line, self._interrupt)

    now = property(lambda self: self._active.now, doc="The present time, s: all participants have executed exactly their activations before it.")
    is_over = property(lambda self: self._active.is_over, doc="Whether the run is over: no activation follows.")

    @property
    def _active(self):
        """The run in the native module, if it can take a call."""
        self.check_thread()
        if self._refusal is not None:
            raise RunError(self._refusal)
        return self._native

    def check_thread(self):
        """Raises `RunError` in another thread than the one that started the run."""
        if threading.get_ident() != self._thread:
            raise RunError("a run belongs to the thread that started it: call it there, or start one in each thread")

    def run_to(self, time):
        """Advances the run to `time`, a text such as "2.5 s" or a number of seconds, and pauses it there."""
        self._call(self._active.run_to, _time("run_to", time))

    def step(self):
        """Advances the run to the next communication point."""
        self._call(self._active.step)

    def _call(self, method, *arguments):
        self._refusal = _CALL_IN_PROGRESS
        try:
            return _interruptible(self._interrupt, method, *arguments)
        finally:
            self._refusal = None

    def newest(self, port):
        """The newest sample of `PARTICIPANT.OUTPUT`."""
        index, t, payload = self._active.newest(port)
        message = self._message_of(port)()
        message._set_bytes(payload)
        return Sample(index, t, message)

    def run_to_step(self, participant):
        """Advances the run until `participant` is about to step: the inputs of its next activation are available (`read_input`), and its outputs can
        be set instead of its step (`set_output`). False when it has no further activation: the run has then reached its end."""
        return self._call(self._active.run_to_step, participant)

    def read_input(self, port):
        """The sample that `PARTICIPANT.INPUT` has in the activation before whose step the participant is paused."""
        index, t, payload = self._active.read_input(port)
        message = self._message_of(port)()
        message._set_bytes(payload)
        return Sample(index, t, message)

    def set_output(self, port, message=None, **fields):
        """Sets `PARTICIPANT.OUTPUT` for that activation: a message, or its fields by name. The participant is then not stepped."""
        self._active.set_output(port, self._payload(port, message, fields))

    def _payload(self, port, message, fields):
        """The bytes of a message for `port`; none for a port that does not exist, which the run refuses with the ports there are."""
        try:
            kind = self._message_of(port)
        except PortError:
            return b""
        if message is None:
            try:
                message = kind(**fields)
            except MessageError as error:
                raise MessageError(f"`{port}`: {error}") from None
        elif not isinstance(message, Message) or fields:
            raise MessageError(f"`{port}`: give a message, or fields by name")
        elif message.descriptor["fields"] != kind.descriptor["fields"]:
            # Another message can have the same number of bytes.
            raise MessageError(f"`{port}` takes {kind()!r}, and {message!r} has other fields")
        return bytes(message)

    def _message_of(self, port):
        if port not in self._messages:
            descriptor = self._active.descriptor(port)
            if descriptor is None:
                raise PortError(f"there is no port `{port}`")
            self._messages[port] = Message.of(descriptor)
        return self._messages[port]

    def set(self, port, message=None, **fields):
        """Sets the unconnected input `PARTICIPANT.INPUT`: a message, or its fields by name. Fields that are not named are zero."""
        self._active.set(port, self._payload(port, message, fields))

    def log(self, participant):
        """The log of a participant so far, at least the newest 64 KiB of it."""
        return self._active.log(participant)

    def save(self):
        """Saves the state of all participants, in memory."""
        return self._call(self._active.save)

    def restore(self, saved):
        """Restores a state that `save` returned."""
        restore = self._active.restore
        if not isinstance(saved, _native.Saved):
            raise RunError(f"{saved!r} is no state of a run: give what `save` returned")
        self._call(restore, saved)

    def end(self):
        """Ends the run. Returns the run folder, or the outcome if there is no folder."""
        native = self._active
        self._refusal = _ENDED
        report = native.end()
        folder = _checked_result(report, self._interrupt)
        return folder if folder is not None else Outcome(report["summary"], report["logs"])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.check_thread()
        self._refusal = _ENDED
        self._native.close()
