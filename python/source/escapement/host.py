"""`python -m escapement.host FILE.py:CLASS`: a participant in a separate process.

A scenario names it as `run = { exe = "python3", args = ["-m", "escapement.host", "pid.py:Pid"] }`. The file is relative to the scenario's
folder; `package.module:Class` is imported as usual.
"""

import hashlib
import importlib
import importlib.util
import os
import sys

from .errors import EscapementError


def find(name, folder="."):
    """The class that `FILE.py:CLASS` or `MODULE:CLASS` names."""
    place, colon, attribute = name.rpartition(":")
    if not colon or not place or not attribute:
        raise EscapementError(f"{name!r} names no class: write FILE.py:CLASS or MODULE:CLASS")
    module = _file(os.path.join(folder, place)) if place.endswith(".py") else _module(place, folder)
    found = module
    for part in attribute.split("."):
        if not hasattr(found, part):
            from .participant import Participant

            known = [key for key, value in vars(module).items() if isinstance(value, type) and issubclass(value, Participant)]
            known = ", ".join(f"`{key}`" for key in known if key != "Participant")
            raise EscapementError(f"{place} has no class `{attribute}`; its participants are {known or 'none'}")
        found = getattr(found, part)
    return found


def _file(path):
    path = os.path.abspath(path)
    if not os.path.isfile(path):
        raise EscapementError(f"there is no file {path}")
    # Saved states name classes by their modules, so a file has the same module name wherever it is loaded.
    stem = os.path.splitext(os.path.basename(path))[0]
    name = f"_escapement_{hashlib.sha256(path.encode()).hexdigest()[:8]}_{stem}"
    main = sys.modules.get("__main__")
    if getattr(main, "__file__", None) and os.path.abspath(main.__file__) == path:
        return main
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    sys.path.insert(0, os.path.dirname(path))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        sys.path.remove(os.path.dirname(path))
    return module


def _module(place, folder):
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError:
        sys.path.insert(0, os.path.abspath(folder))
        return importlib.import_module(place)


def main(arguments=None):
    """Hosts the class named on the command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    from . import _native, participant

    participant._hosting = True
    # Line-wise output reaches the log immediately, even if the process is killed later.
    sys.stdout.reconfigure(line_buffering=True)
    name = arguments[0]
    try:
        held = find(name)
    except Exception as error:
        # Reported when the run queries the ports: the report then has the participant's name and its line in the scenario.
        held = error
    return _native.host(held, f"python {name}")


if __name__ == "__main__":
    sys.exit(main())
