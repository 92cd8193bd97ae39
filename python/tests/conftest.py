"""What all tests share: where the project's scenarios and programs are. They run against the installed package."""

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
def elsewhere(tmp_path, monkeypatch):
    """Runs leave their folders in a place of the test's own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def built():
    """Where the programs of the examples are."""
    folder = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
    for needed in ("escapement", "spring", "libposition_loop.so"):
        assert (folder / needed).is_file(), f"{folder / needed} is not built: cargo build --release --workspace"
    return folder


@pytest.fixture
def scenario(tmp_path):
    """Writes a scenario: a Python class of the test's own alone, or fed by another."""

    def write(text, name="own.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write
