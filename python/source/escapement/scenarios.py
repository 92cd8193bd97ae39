"""Scenarios: the description of a run."""

import inspect
import os
import sys
from collections.abc import Mapping

from . import _native
from .errors import EscapementError
from .participant import Participant


def _toml(value):
    """A value in the syntax of `--set`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # Text that is also valid TOML would be parsed as such: quoted, it remains a text.
        return '"' + "".join(_escape(letter) for letter in value) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(inner) for inner in value) + "]"
    if isinstance(value, float):
        text = repr(value)
        return {"inf": "inf", "-inf": "-inf", "nan": "nan"}.get(text, text)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, os.PathLike):
        return _toml(os.fspath(value))
    raise EscapementError(f"{value!r} cannot stand in a scenario: give a text, a number, true or false, a list or a dict")


def _escape(letter):
    if letter in '"\\':
        return "\\" + letter
    return letter if letter.isprintable() else f"\\U{ord(letter):08x}"


def _key(key):
    return key if key and all(letter.isascii() and (letter.isalnum() or letter in "_-") for letter in key) else _toml(str(key))


def _class_name(cls):
    """The name by which a host finds `cls`: FILE.py:CLASS, or MODULE:CLASS for an installed module."""
    if cls.__module__ != "__main__" and not cls.__module__.startswith("_escapement_"):
        spec = getattr(sys.modules.get(cls.__module__), "__spec__", None)
        if spec is not None and spec.has_location:
            return f"{os.path.abspath(spec.origin)}:{cls.__qualname__}"
    try:
        file = inspect.getsourcefile(cls)
    except TypeError:
        file = None
    if file and os.path.isfile(file):
        return f"{os.path.abspath(file)}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"


def _host(name):
    """The `run` table that runs the class `name`, FILE.py:CLASS, in a separate process."""
    return {"exe": sys.executable, "args": ["-m", "escapement.host", name]}


def _listed(faults):
    return [faults] if isinstance(faults, (str, Mapping)) else list(faults)


def _fault(fault, hosted):
    """A fault in the syntax of `--fault`."""
    if isinstance(fault, str):
        return fault
    if not isinstance(fault, Mapping):
        raise EscapementError(f"{fault!r} is no fault: give a dict of the keys of an entry of [[faults]], or a text as `--fault` takes it")
    entry = dict(fault)
    if isinstance(entry.get("run"), type):
        entry["run"] = hosted("faults", entry["run"])
    return ",".join(f"{_key(key)}={_toml(value)}" for key, value in entry.items())


class Scenario:
    """A scenario file with changes.

    `set` maps dotted keys to values, as `--set` of the command line: `{"connections.measured.delay": "10 ms"}`. `participants` maps names
    of participants to their replacements: a subclass of `Participant`, or `"FILE.py:CLASS"`. `faults` lists additional faults: each a
    dict of the keys of an entry of `[[faults]]`, whose `run` may be a subclass of `Participant`, or a text as `--fault` takes it. With `text`
    the file need not exist; relative paths are resolved against its name. Everything is read and checked at once: a mistake raises
    `ScenarioError`.
    """

    def __init__(self, file, *, set=None, participants=None, faults=(), text=None):
        self.file = os.fspath(file)
        self._text = text
        self._sets = dict(set or {})
        self._participants = dict(participants or {})
        self._faults = _listed(faults)
        self._read()

    @classmethod
    def load(cls, file, **how):
        """The same as `Scenario(file, …)`."""
        return cls(file, **how)

    def _read(self):
        sets, classes = [], {}

        def hosted(where, what):
            if not issubclass(what, Participant):
                raise EscapementError(f"{where}: {what!r} is no participant: give a subclass of escapement.Participant")
            name = _class_name(what)
            classes[name] = what
            return _host(name)

        for name, what in self._participants.items():
            if isinstance(what, type):
                run = hosted(f"participant `{name}`", what)
            elif not isinstance(what, str):
                raise EscapementError(f"participant `{name}`: {what!r} is neither a class nor \"FILE.py:CLASS\"")
            else:
                run = _host(what)
            sets.append(f"participants.{name}.run={_toml(run)}")
        sets.extend(f"{key}={_toml(value)}" for key, value in self._sets.items())
        faults = [_fault(fault, hosted) for fault in self._faults]
        # The arguments of `--set` and `--fault` for a separate program.
        self._options = [("--set", one) for one in sets] + [("--fault", one) for one in faults]
        self._classes = classes
        self._native = _native.Scenario(self.file, self._text, sets, faults, classes)

    def set(self, key, value):
        """Changes a key; returns the scenario, so that calls can be chained. After an error nothing is changed."""
        before = dict(self._sets)
        self._sets[key] = value
        try:
            self._read()
        except EscapementError:
            self._sets = before
            raise
        return self

    def _fresh(self):
        """A copy for another run: the exceptions raised by participants belong to one run."""
        self._read()
        return self

    name = property(lambda self: self._native.name, doc="The file's name without its ending.")
    title = property(lambda self: self._native.title, doc="The one-line description.")
    duration = property(lambda self: self._native.duration, doc="How long the run is, s.")
    seed = property(lambda self: self._native.seed, doc="The seed of every random stream.")
    participants = property(lambda self: self._native.participants, doc="The participants' names.")
    warnings = property(lambda self: self._native.warnings(), doc="What is not wrong, but cannot have been meant.")

    def __getitem__(self, key):
        """The value at a dotted key, with defaults filled in."""
        value = self._native.table()
        for part in key.split("."):
            value = value[part]
        return value

    def to_dict(self):
        """The whole scenario, with files and changes filled in."""
        return self._native.table()

    def check(self):
        """Checks the scenario without a run: returns the participants with their ports, and the links. Programs are queried for their ports."""
        here = self._native.runs_here()
        if not here and self._native.needs_program():
            from . import _program

            _program.needed("a scenario with programs of its own")
        return self._native.check(here)

    def __repr__(self):
        return f"Scenario({self.file!r}: {self.title or self.name}, {self.duration:g} s, {', '.join(self.participants)})"
