"""Campaigns: one scenario over a grid of values, as a table."""

import json
import os
import subprocess

from . import _program
from .errors import ProgramError, ScenarioError
from .runs import _Progress, _refuse_without_file, _scenario
from .scenarios import _toml
from .tape import needed_module


def _values(key, values):
    """The values of an axis in the syntax of `--vary`."""
    if isinstance(values, str):
        return f"{key}={values}"
    if isinstance(values, range):
        values = list(values)
    return f"{key}=" + ",".join(value if isinstance(value, str) else _toml(value) for value in values)


def sweep(scenario, vary=None, *, seeds=None, set=None, participants=None, faults=(), out=None, workers=None, keep=False, digest=False, progress=None):
    """Runs a scenario over a grid of values, on all cores, and returns a DataFrame: one row per point, with the varied values, the outcome and
    every figure.

    `vary` maps dotted keys to values: a list (`["5 ms", "10 ms"]`, `[1, 2]`), a range as the command line writes it
    (`"0ms..100ms:10ms"`); all combinations are run, the first key slowest. `seeds` is the number of seeds to run. A participant in Python is a
    separate process for each point. With `digest` the column `tape` has the digest of each point's tape. The folder with the table is in
    `attrs["folder"]`; the same call continues an interrupted one.
    """
    pandas = needed_module("pandas", "the table of a sweep")
    scenario = _scenario(scenario, set, participants, faults)
    if scenario._text is not None:
        raise ScenarioError("a sweep needs the scenario in a file", file=scenario.file)
    _refuse_without_file(scenario)
    command = [_program.needed("a sweep"), "sweep", scenario.file, "--json"]
    for key, value in (vary or {}).items():
        command += ["--vary", _values(key, value)]
    for option in scenario._options:
        command += option
    command += ["--seeds", str(seeds)] if seeds is not None else []
    command += ["--out", os.fspath(out)] if out is not None else []
    command += ["--workers", str(workers)] if workers is not None else []
    command += ["--keep"] if keep else []
    command += ["--digest"] if digest else []
    result = _run_program(command, progress)
    folder = result["folder"]
    # Before version 3, pandas does not read doubles bit-exactly by default.
    exact = {"float_precision": "round_trip"} if int(pandas.__version__.split(".")[0]) < 3 else {}
    table = pandas.read_csv(os.path.join(folder, "table.csv"), **exact)
    table.attrs = {"folder": os.path.abspath(folder), "files": result["files"]}
    return table.set_index("point") if "point" in table else table


def _run_program(command, progress):
    """Runs the program and reads its output; in a terminal the program shows its progress line itself."""
    shown = _Progress(progress)._shown
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=None if shown else subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    )
    try:
        out, errors = process.communicate()
    except KeyboardInterrupt:
        # The terminal has sent the signal to the program as well, which keeps all complete results.
        process.communicate()
        raise
    if process.returncode == 2:
        message = (errors or "").removeprefix("error: ").strip()
        raise ScenarioError(message or "the sweep was refused", file=command[2])
    try:
        return json.loads(out)
    except ValueError:
        raise ProgramError(f"`escapement sweep` failed with exit code {process.returncode}: {(errors or '').strip()}") from None
