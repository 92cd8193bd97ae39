"""Builds the wheel: maturin builds the module, and the program `escapement` is added as a command.

The program is built here, unless the environment variable ESCAPEMENT names one that is already built. Module and program share the
project's target folder, so what is already compiled there is reused.
"""

import os
import shutil
import subprocess

import maturin
from maturin import (  # noqa: F401 - what a frontend asks for
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
)

_HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_ROOT = os.path.dirname(_HERE)


_SCRIPTS = os.path.join(_HERE, "data", "scripts")


def _target():
    return os.environ.get("CARGO_TARGET_DIR") or os.path.join(_ROOT, "target")


def _place_program():
    built = os.environ.get("ESCAPEMENT")
    if not built:
        # Building the module's package together with it gives both the same features, so nothing is compiled twice.
        command = ["cargo", "build", "--release", "--locked", "--bin", "escapement"]
        command += ["--package", "orchestrator", "--package", "escapement-python", "--features", "escapement-python/module"]
        subprocess.run(command, cwd=_ROOT, check=True)
        built = os.path.join(_target(), "release", "escapement")
    os.makedirs(_SCRIPTS, exist_ok=True)
    shutil.copy2(built, os.path.join(_SCRIPTS, "escapement"))


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """The metadata of the wheel before it is built."""
    os.makedirs(_SCRIPTS, exist_ok=True)
    return maturin.prepare_metadata_for_build_wheel(metadata_directory, config_settings)


def prepare_metadata_for_build_editable(metadata_directory, config_settings=None):
    """The same for one whose sources stay where they are."""
    os.makedirs(_SCRIPTS, exist_ok=True)
    return maturin.prepare_metadata_for_build_editable(metadata_directory, config_settings)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """The wheel."""
    _place_program()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """The same, with the sources where they are."""
    _place_program()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)
