"""Shared by all tests: the locations of the project's scenarios and programs. The tests run against the installed package."""

import os
import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "python"
SPRING = ROOT / "examples" / "spring" / "spring.toml"
PID = ROOT / "examples" / "pid" / "pid.toml"

sys.path.insert(0, str(EXAMPLES))


@pytest.fixture(autouse=True)
def run_in_tmp_path(tmp_path, monkeypatch):
    """Runs create their folders in a directory that belongs to the test."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def built():
    """The folder with the programs of the examples."""
    folder = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
    for needed in ("escapement", "spring", "libposition_loop.so"):
        assert (folder / needed).is_file(), f"{folder / needed} is not built: cargo build --release --workspace"
    return folder


@pytest.fixture
def scenario(tmp_path):
    """Writes a scenario: a Python class of the test alone, or fed by another participant."""

    def write(text, name="own.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write
