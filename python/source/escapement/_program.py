"""Where the program `escapement` is."""

import importlib.metadata
import os
import shutil
import sysconfig

from . import _native
from .errors import ProgramError


def _candidates():
    yield os.environ.get("ESCAPEMENT")
    yield os.path.join(sysconfig.get_path("scripts"), "escapement")
    try:
        for file in importlib.metadata.files("escapement") or ():
            if file.name == "escapement" and "bin" in file.parts:
                yield str(file.locate())
    except importlib.metadata.PackageNotFoundError:
        pass
    yield shutil.which("escapement")


def find():
    """The path of the program, or None: the one that ESCAPEMENT names, the one installed with this package, or one in PATH."""
    for path in _candidates():
        if path and os.access(path, os.X_OK) and os.path.isfile(path):
            return os.path.abspath(path)
    return None


def needed(what):
    """The path of the program, or an error that names `what` needs it."""
    path = find()
    if path is None:
        raise ProgramError(
            f"{what} needs the program `escapement`, which did not come with this package: put it into PATH, or its name into the "
            "environment variable ESCAPEMENT (cargo build --release makes target/release/escapement)"
        )
    _native.program(path)
    return path
