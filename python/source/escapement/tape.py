"""The results of a run: its folder, its figures, and its tape as numpy arrays mapped from the files."""

import importlib
import json
import os

import numpy as np

from . import _native
from .errors import EscapementError, TapeError
from .message import Message, dtype_of


def needed_module(name, what):
    """The module of an optional dependency, or an error that says how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise EscapementError(f"{what} needs the package {name}, which is not installed: pip install {name}") from None


class Stream:
    """The samples of one output, `run["plant.motion"]`.

    `t` has the stamps, s. A field is a view of the file, which is mapped into memory: nothing is read before it is used, and nothing is
    copied. Fields are attributes or items: `stream.position`, `stream["position"]`. `array` is the whole stream as a structured array with the
    fields `t` and `payload`. Arrays are read-only.
    """

    def __init__(self, folder, entry):
        self.name = f"{entry['participant']}.{entry['port']}"
        self.descriptor = entry["descriptor"]
        # A file outside the folder is not part of this tape.
        if entry["file"] != f"{self.name}.bin" or os.sep in self.name:
            raise TapeError(f"{folder}/index.json: the file {entry['file']!r} is none of `{self.name}`")
        self._path = os.path.join(folder, entry["file"])
        #: The numpy type of a record: stamp and payload.
        self.dtype = np.dtype([("t", "<f8"), ("payload", dtype_of(self.descriptor))])
        if self.dtype.itemsize != entry["record_bytes"]:
            raise TapeError(f"{self._path}: a record has {entry['record_bytes']} bytes, and its fields have {self.dtype.itemsize}")
        try:
            count = os.path.getsize(self._path) // self.dtype.itemsize
            # An empty file cannot be mapped; an incomplete last record is left out.
            self.array = (
                np.memmap(self._path, self.dtype, "r", shape=(count,)).view(np.ndarray) if count else np.zeros(0, self.dtype)
            )
        except OSError as error:
            raise TapeError(f"{self._path}: {error.strerror}") from None
        self.array.flags.writeable = False
        self.fields = {part["name"]: part for part in self.descriptor["fields"]}

    @property
    def t(self):
        """The stamps, s."""
        return self.array["t"]

    def unit(self, field):
        """The unit of a field."""
        return self._part(field)["unit"]

    def frame(self, field):
        """The frame of a field; empty if not applicable."""
        return self._part(field)["frame"]

    def values(self, field):
        """The values of an enumeration: a dictionary from number to name; empty for every other type."""
        return {one["value"]: one["name"] for one in self._part(field).get("values", ())}

    def names(self, field):
        """The samples of an enumeration by their names, as an array of texts."""
        values = self.values(field)
        if not values:
            raise TapeError(f"`{field}` of `{self.name}` is no enumeration: it is {self._part(field)['element']}")
        table = np.array([values.get(number, "") for number in range(256)])
        return table[self[field]]

    def contents(self, field):
        """The samples of texts or bytes as an array of `str` or `bytes`, in the shape of the samples."""
        part = self._part(field)
        if not isinstance(part["element"], dict):
            raise TapeError(f"`{field}` of `{self.name}` is neither text nor bytes: it is {part['element']}")
        values = self[field]
        read = np.empty(values.shape, object)
        for at in np.ndindex(*values.shape):
            one = values[at]
            read[at] = one.decode() if isinstance(one, bytes) else one["data"][: int(one["length"])].tobytes()
        return read

    @property
    def message(self):
        """The message class of the samples."""
        return Message.of(self.descriptor)

    def _part(self, field):
        if field not in self.fields:
            known = ", ".join(f"`{name}`" for name in self.fields)
            raise TapeError(f"`{self.name}` has no field `{field}`; it has {known}")
        return self.fields[field]

    def __getitem__(self, field):
        self._part(field)
        return self.array["payload"][field]

    def __getattr__(self, field):
        if field.startswith("_") or field not in self.__dict__.get("fields", ()):
            known = ", ".join(f"`{name}`" for name in self.__dict__.get("fields", ()))
            raise AttributeError(f"`{self.__dict__.get('name', 'a stream')}` has no field `{field}`; it has {known}")
        return self[field]

    def __dir__(self):
        return [*super().__dir__(), *self.fields]

    def __len__(self):
        return len(self.array)

    def __repr__(self):
        parts = ", ".join(f"{name} [{part['unit']}]" + (f" {tuple(part['shape'])}" if part["shape"] else "") for name, part in self.fields.items())
        return f"Stream({self.name!r}: {len(self)} samples of {parts})"

    def to_pandas(self):
        """A DataFrame, one column per element (`p_NB_N[0]`), with the stamps as index. Units and frames are in `attrs`."""
        pandas = needed_module("pandas", "a DataFrame")
        columns, units, frames = {}, {}, {}
        for name, part in self.fields.items():
            values = self.contents(name) if isinstance(part["element"], dict) else self[name]
            values = values.reshape(len(self), -1)
            names = [name]
            if part["shape"]:
                names = [name + "".join(f"[{at}]" for at in index) for index in np.ndindex(*part["shape"])]
            for column, key in enumerate(names):
                columns[key] = values[:, column]
                if names_of := self.values(name):
                    numbers = list(names_of)
                    codes = np.searchsorted(np.sort(numbers), columns[key])
                    categories = [names_of[number] for number in sorted(numbers)]
                    columns[key] = pandas.Categorical.from_codes(codes, categories)
                units[key], frames[key] = part["unit"], part["frame"]
        frame = pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))
        frame.attrs = {"stream": self.name, "units": units, "frames": frames}
        return frame

    def to_xarray(self):
        """A Dataset over `t`, one variable per field, with `units` and `frame` in the attributes. A field `t` becomes `t_2`."""
        xarray = needed_module("xarray", "a Dataset")
        variables = {}
        for name, part in self.fields.items():
            inner = [f"{name}_{axis}" for axis in range(len(part["shape"]))]
            about = {"units": part["unit"]} | ({"frame": part["frame"]} if part["frame"] else {})
            if values := self.values(name):
                # As in the conventions for climate and forecast (CF) data.
                about |= {"flag_values": np.array(list(values), np.uint8), "flag_meanings": " ".join(n.replace(" ", "_") for n in values.values())}
            # This name is that of the stamps.
            values = self.contents(name) if isinstance(part["element"], dict) else self[name]
            variables["t_2" if name == "t" else name] = (["t", *inner], values, about)
        stamps = ("t", self.t, {"units": "s"})
        return xarray.Dataset(variables, coords={"t": stamps}, attrs={"stream": self.name})


class Page:
    """A report: a self-contained HTML page. A notebook displays it."""

    def __init__(self, path, html):
        self.path, self.html = path, html

    def _repr_html_(self):
        import html

        return f'<iframe srcdoc="{html.escape(self.html)}" style="width:100%;height:640px;border:0"></iframe>'

    def __repr__(self):
        return f"Page({self.path!r})"


class RunFolder:
    """A run folder: `run["plant.motion"]` is a stream, `run.figures` are the figures of merit.

    The folder is read on access, also while the run is in progress or after it has failed.
    """

    def __init__(self, folder):
        self.folder = os.path.abspath(os.fspath(folder))
        self._tape = os.path.join(self.folder, "tape")
        self._streams = {}
        index = self._json(os.path.join("tape", "index.json"))
        if index is None:
            raise TapeError(f"{self.folder} is not the folder of a run: there is no tape/index.json in it")
        if not isinstance(index, dict) or (index.get("format"), index.get("version")) != ("escapement-tape", 1):
            raise TapeError(f"{self._tape}/index.json is none of a tape of version 1, which this package reads")
        self._entries = {f"{entry['participant']}.{entry['port']}": entry for entry in index["streams"]}

    def _json(self, name):
        try:
            with open(os.path.join(self.folder, name), encoding="utf-8") as file:
                return json.load(file)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise TapeError(f"{self.folder}/{name}: {error}") from None

    def keys(self):
        """The names of the streams."""
        return self._entries.keys()

    def __iter__(self):
        return iter(self._entries)

    def __len__(self):
        return len(self._entries)

    def __contains__(self, name):
        return name in self._entries

    def __getitem__(self, name):
        if name not in self._entries:
            raise TapeError(f"there is no stream `{name}`; there is {', '.join(f'`{one}`' for one in self._entries)}")
        if name not in self._streams:
            self._streams[name] = Stream(self._tape, self._entries[name])
        return self._streams[name]

    @property
    def summary(self):
        """The content of `summary.json`; empty for a run that did not reach its end."""
        return self._json("summary.json") or {}

    @property
    def verdict(self):
        """`"met"`, `"not-met"` or `"complete"` (no criteria); None if the run did not reach its end."""
        summary = self.summary
        # A scenario without figures has no verdict in its summary.
        complete = summary.get("ending", {}).get("status") == "complete"
        return summary.get("verdict", "complete" if complete else None)

    @property
    def digest(self):
        """The digest of the tape: two tapes are identical exactly if their digests are."""
        return self.summary.get("tape_digest")

    @property
    def figures(self):
        """The figures of merit with their values: those declared by the scenario, and those of its assessment by name."""
        kept = ("verdict", "ending", "simulated_time_s", "wall_time_s", "real_time_factor", "tape_digest", "run_folder")
        kept += ("recovered", "tape_has_only", "pace", "trace", "placement", "timing", "measures", "criteria", "shadows")
        summary = self.summary
        figures = {key: value for key, value in summary.items() if key not in kept}
        figures.update({name: one.get("value") for name, one in summary.get("measures", {}).items()})
        return figures

    @property
    def criteria(self):
        """The criteria and their results."""
        return self.summary.get("criteria", [])

    @property
    def events(self):
        """The events of the run: faults, substitutions, restarts, failures."""
        try:
            with open(os.path.join(self._tape, "events.jsonl"), encoding="utf-8") as file:
                return [json.loads(line) for line in file if line.endswith("\n")]
        except FileNotFoundError:
            return []

    def log(self, participant):
        """The log of a participant; empty if it wrote nothing."""
        try:
            with open(os.path.join(self.folder, "log", f"{participant}.stderr"), encoding="utf-8", errors="replace") as file:
                return file.read()
        except FileNotFoundError:
            return ""

    def to_pandas(self, name):
        """The stream `name` as a DataFrame."""
        return self[name].to_pandas()

    def to_xarray(self, name=None):
        """The stream `name` as a Dataset; without a name, all streams as a dict of Datasets, because each has its own stamps."""
        if name is not None:
            return self[name].to_xarray()
        return {one: self[one].to_xarray() for one in self}

    def report(self, *others, out=None):
        """The report page of this run, overlaid with `others`. It is written to `report.html` in the folder, or to `out`."""
        folders = [self.folder, *(os.fspath(getattr(other, "folder", other)) for other in others)]
        html = _native.report_html(folders, [])
        path = os.fspath(out) if out is not None else os.path.join(self.folder, "report.html")
        with open(path, "w", encoding="utf-8") as file:
            file.write(html)
        return Page(path, html)

    def __repr__(self):
        return f"RunFolder({self.folder!r}: {self.verdict or 'not complete'}, {len(self)} streams)"

    def _repr_html_(self):
        import html

        rows = [("verdict", self.verdict or "not complete"), *self.figures.items(), ("folder", self.folder)]
        cells = "".join(f"<tr><th style='text-align:left'>{html.escape(str(key))}</th><td>{html.escape(str(value))}</td></tr>" for key, value in rows)
        return f"<table>{cells}</table>"


def open_run(folder):
    """The run in `folder`."""
    return RunFolder(folder)
