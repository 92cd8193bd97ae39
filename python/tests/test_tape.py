"""Tapes: numpy arrays mapped from the files, and their conversions for other packages."""

import json
import os
import sys

import numpy as np
import pytest
from conftest import SPRING

import escapement as esc
import spring


@pytest.fixture
def run():
    return esc.run(SPRING, participants={"left": spring.Spring, "right": spring.Spring}, set={"duration": "1 s"})


def mapped(array, path):
    """Whether the array's memory is the file's."""
    address = array.__array_interface__["data"][0]
    with open("/proc/self/maps") as maps:
        for line in maps:
            start, end = (int(part, 16) for part in line.split()[0].split("-"))
            if start <= address < end:
                return line.rstrip().endswith(os.path.realpath(path))
    return False


def test_fields_map_the_file_without_a_copy(run):
    motion = run["left.motion"]
    path = os.path.join(run.folder, "tape", "left.motion.bin")
    assert mapped(motion.position, path) and mapped(motion.t, path)
    assert motion.position.base is not None and not motion.position.flags.owndata
    assert motion.position.strides == (24,)
    plain = np.fromfile(path, "<f8").reshape(-1, 3)
    assert (plain[:, 0] == motion.t).all() and (plain[:, 1] == motion.position).all()
    with pytest.raises(ValueError):
        motion.position[0] = 1.0


def test_fields_have_units_frames_and_names(run):
    motion = run["left.motion"]
    assert (motion.unit("velocity"), motion.frame("velocity")) == ("m/s", "N")
    assert list(run) == ["left.motion", "right.motion"] and "left.motion" in run
    assert "1001 samples of position [m], velocity [m/s]" in repr(motion)
    assert motion.message.descriptor == spring.Motion.descriptor
    with pytest.raises(AttributeError, match="has no field `speed`; it has `position`, `velocity`"):
        motion.speed
    with pytest.raises(esc.TapeError, match="there is no stream `left.push`; there is `left.motion`"):
        run["left.push"]


def test_tables_have_units(run):
    frame = run.to_pandas("left.motion")
    assert list(frame.columns) == ["position", "velocity"] and frame.index.name == "t"
    assert frame.attrs["units"] == {"position": "m", "velocity": "m/s"}
    assert (frame["position"].to_numpy() == run["left.motion"].position).all()
    dataset = run.to_xarray()["right.motion"]
    assert dataset.position.attrs == {"units": "m", "frame": "N"} and dataset.t.attrs == {"units": "s"}
    assert float(dataset.position.sel(t=0.5)) == run["right.motion"].position[200]


def test_missing_package_is_named_with_the_remedy(run, monkeypatch):
    for name, call in [
        ("pandas", lambda: run.to_pandas("left.motion")),
        ("xarray", lambda: run.to_xarray()),
        ("pandas", lambda: esc.sweep(SPRING, {"seed": [1]})),
    ]:
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(esc.EscapementError, match=f"needs the package {name}, which is not installed: pip install {name}"):
            call()


def test_vectors_and_pictures_keep_their_shapes(tmp_path):
    class Wide(esc.Message):
        R = esc.Field("1", shape=(2, 2))
        t = esc.Field("s")
        rgb = esc.Field("1", element="u8", shape=(4, 8))

    class Camera(esc.Participant):
        picture = esc.Output(Wide)

        def step(self, t, dt):
            self.picture.R = [[1, 2], [3, t]]
            self.picture.t = -t
            self.picture.rgb += np.uint8(1)

    path = tmp_path / "own.toml"
    path.write_text('duration = "1 s"\n[participants.camera]\nrun = { exe = "/bin/true" }\nperiod = "100 ms"\n')
    picture = esc.run(path, participants={"camera": Camera})["camera.picture"]
    assert picture.rgb.shape == (10, 4, 8) and picture.rgb[9, 0, 0] == 10
    assert picture.R[5, 1].tolist() == [3.0, 0.5]
    # A field with the name of the stamps is reached by its name alone.
    assert picture.t[5] == 0.5 and picture["t"][5] == -0.5
    columns = list(picture.to_pandas().columns)
    assert columns[:5] == ["R[0][0]", "R[0][1]", "R[1][0]", "R[1][1]", "t"] and len(columns) == 5 + 32
    dataset = picture.to_xarray()
    assert dataset["rgb"].shape == (10, 4, 8) and float(dataset["t_2"][5]) == -0.5


def test_tape_of_a_killed_run_is_readable(run, tmp_path):
    folder = tmp_path / "killed"
    os.makedirs(folder / "tape")
    for name in ("index.json", "left.motion.bin", "right.motion.bin"):
        data = open(os.path.join(run.folder, "tape", name), "rb").read()
        (folder / "tape" / name).write_bytes(data[: 24 * 7 + 5] if name == "left.motion.bin" else (b"" if name.startswith("right") else data))
    killed = esc.open(folder)
    assert len(killed["left.motion"]) == 7 and len(killed["right.motion"]) == 0
    assert killed["right.motion"].position.shape == (0,)
    assert killed.verdict is None and killed.figures == {} and killed.events == []
    assert (killed["left.motion"].position == run["left.motion"].position[:7]).all()


def test_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(esc.TapeError, match="is not the folder of a run"):
        esc.open(tmp_path)
    (tmp_path / "tape").mkdir()
    (tmp_path / "tape" / "index.json").write_text("{")
    with pytest.raises(esc.TapeError, match="index.json"):
        esc.open(tmp_path)
    (tmp_path / "tape" / "index.json").write_text('{"format": "escapement-tape", "version": 2, "streams": []}')
    with pytest.raises(esc.TapeError, match="none of a tape of version 1"):
        esc.open(tmp_path)
    index = {"format": "escapement-tape", "version": 1, "streams": [{"participant": "a", "port": "b", "file": "a.b.bin", "record_bytes": 99, "descriptor": {"fields": []}}]}
    (tmp_path / "tape" / "index.json").write_text(json.dumps(index))
    with pytest.raises(esc.TapeError, match="99 bytes"):
        esc.open(tmp_path)["a.b"]
    index["streams"][0]["file"] = "../../secret"
    (tmp_path / "tape" / "index.json").write_text(json.dumps(index))
    with pytest.raises(esc.TapeError, match="'../../secret' is none of `a.b`"):
        esc.open(tmp_path)["a.b"]


def test_memory_does_not_grow_over_a_thousand_runs(tmp_path):
    """After the first two hundred runs, the memory, mappings and open files of this process do not grow any more."""

    class Own(spring.Spring):
        def step(self, t, dt):
            super().step(t, dt)
            self.history = [t] * 10

    def used():
        with open("/proc/self/statm") as statm:
            pages = int(statm.read().split()[1])
        with open("/proc/self/maps") as maps:
            return pages * os.sysconf("SC_PAGESIZE"), len(maps.readlines()), len(os.listdir("/proc/self/fd"))

    def once(at):
        if at % 10:
            esc.run(SPRING, participants={"left": Own, "right": Own}, set={"duration": "20 ms"}, record="digest")
        else:
            run = esc.run(SPRING, participants={"left": Own, "right": Own}, set={"duration": "20 ms"}, out=tmp_path / "one", force=True)
            assert run["left.motion"].position[0] == 0.1

    for at in range(200):
        once(at)
    before = used()
    for at in range(1000):
        once(at)
    after = used()
    assert after[0] - before[0] < 2_000_000, (before, after)
    assert after[1] - before[1] < 20 and after[2] == before[2], (before, after)
