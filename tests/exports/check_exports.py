"""Exports runs in every format, reads them back with the tools' own packages and compares them with the tapes, value by value.

    python3 tests/exports/check_exports.py ORCHESTRATOR RUN…

ORCHESTRATOR is the program, each RUN a run folder. The tape of edge_cases.py is checked as well. Needs the packages of requirements.txt
beside this file.
"""

import csv
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import pandas
import pyarrow
import pyarrow.parquet
import scipy.io
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import edge_cases

NUMPY = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "i16": "<i2", "i8": "i1", "u64": "<u8", "u32": "<u4", "u16": "<u2", "u8": "u1", "bool": "?", "enum": "u1"}


def is_padding(field):
    """Bytes without a meaning, which no export has."""
    return field["element"] == "u8" and re.fullmatch("padding_?[0-9]*", field["name"]) is not None


def read_tape(run):
    """The tape by its documentation alone: index.json and plain files of records. By stream: its entry, fields, stamps and payloads."""
    tape = run / "tape"
    index = json.loads((tape / "index.json").read_text())
    streams = {}
    for stream in index["streams"]:
        fields = stream["descriptor"]["fields"]
        payload = np.dtype([(f["name"], NUMPY[f["element"]], tuple(f["shape"])) for f in fields])
        dtype = np.dtype([("t", "<f8"), ("payload", payload)])
        assert dtype.itemsize == stream["record_bytes"], stream["file"]
        # A torn last record belongs to nobody.
        data = (tape / stream["file"]).read_bytes()
        records = np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype=dtype)
        streams[f"{stream['participant']}.{stream['port']}"] = (stream, [field for field in fields if not is_padding(field)], records["t"], records["payload"])
    return streams


def assert_identical(a, b, what):
    """Bit for bit, with NaN equal to NaN."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape, f"{what}: {a.shape} against {b.shape}"
    equal = (a == b) | ((a != a) & (b != b))
    assert equal.all(), f"{what}: first difference at {np.argwhere(~equal)[0]}"


def wide(field):
    return np.prod(field["shape"], dtype=int) > 256


def displayed(field, values):
    """Values as tables show them: those of an enumeration by their names."""
    if field["element"] != "enum":
        return values
    names = {one["value"]: one["name"] for one in field["values"]}
    return np.array([names[value] for value in values.flat]).reshape(values.shape)


def columns(fields, records):
    """Name, field and values of every column after the time, one column for a wide field."""
    wanted = []
    for field in fields:
        values = records[field["name"]].reshape(len(records), int(np.prod(field["shape"], dtype=int)))
        if wide(field):
            wanted.append((field["name"], field, values))
            continue
        for k in range(values.shape[1]):
            place = "".join(f"[{i}]" for i in np.unravel_index(k, field["shape"])) if field["shape"] else ""
            wanted.append((field["name"] + place, field, displayed(field, values[:, k])))
    # A name or a truth value has no unit.
    heading = lambda name, field: f"{name} [{field['unit']}]" if field["unit"] and field["element"] not in ("bool", "enum") else name
    # The stamp has its name first; a name that occurs again gets a number that makes it a new one.
    original, taken = {heading(name, field) for name, field, _ in wanted}, {"t [s]"}
    for name, field, values in wanted:
        column, n = heading(name, field), 2
        while column in taken or (n > 2 and column in original):
            column, n = heading(f"{name}_{n}", field), n + 1
        taken.add(column)
        yield column, field, values


def exact(text, kind):
    """A cell of a table as a number of its own type: no integer on the way through a double."""
    return text if kind.kind == "U" else int(text) if kind.kind in "iub" else float(text)


def check_csv(out, streams):
    checked, files = 0, set()
    for name, (_, fields, stamps, records) in streams.items():
        path = out / f"{name}.csv"
        with open(path, newline="") as file:
            header, *rows = csv.reader(file)
        assert header[0] == "t [s]" and len(set(header)) == len(header), header
        assert all(len(row) == len(header) for row in rows)
        assert_identical([float(row[0]) for row in rows], stamps, f"{name}.t")
        expected = [one for one in columns(fields, records) if not wide(one[1])]
        assert header[1:] == [column for column, _, _ in expected], header
        # As pandas reads it. Before version 3 its parser rounds correctly only when it is asked to.
        frame = pandas.read_csv(path, **({} if int(pandas.__version__.split(".")[0]) >= 3 else {"float_precision": "round_trip"}))
        assert list(frame.columns) == header, f"{name}: pandas has {list(frame.columns)}"
        for k, (column, _, values) in enumerate(expected):
            got = np.array([exact(row[k + 1], values.dtype) for row in rows], dtype=values.dtype)
            assert_identical(got, values, f"{name} {column}")
            if len(values):
                assert_identical(frame[column].to_numpy().astype(values.dtype), values, f"{name} {column} in pandas")
            checked += len(values)
        arrays = {array.name: np.load(array, allow_pickle=False) for array in out.glob(f"{name}.*.npy")}
        files.update(array.lower() for array in arrays)
        for field in filter(wide, fields):
            values = records[field["name"]]
            same_type = [file for file, array in arrays.items() if array.dtype == values.dtype and array.shape == values.shape]
            found = [file for file in same_type if arrays[file].tobytes() == values.tobytes()]
            assert found, f"{name}.{field['name']}: no array has its values"
            arrays.pop(found[0])
            checked += values.size
        assert not arrays, f"{name}: arrays of no field: {list(arrays)}"
    assert len(files) == len(list(out.glob("*.npy"))), "two arrays have names that differ in case only"
    return checked


def exported_descriptor(descriptor):
    """A descriptor as it is exported: without padding, and fields of a tape that was made before enumerations were have no values."""
    return {**descriptor, "fields": [{"values": [], **field} for field in descriptor["fields"] if not is_padding(field)]}


def check_parquet(out, streams):
    checked = 0
    for name, (stream, fields, stamps, records) in streams.items():
        path = out / f"{name}.parquet"
        table = pyarrow.parquet.read_table(path)
        frame = pandas.read_parquet(path)
        assert table.num_rows == len(records) == len(frame)
        assert table.column_names == list(frame.columns) and len(set(table.column_names)) == table.num_columns
        assert_identical(table.column("t [s]").to_numpy(), stamps, f"{name}.t")
        for column, field, values in columns(fields, records):
            got, kind = table.column(column), table.schema.field(column).type
            if not wide(field):
                assert kind == pyarrow.from_numpy_dtype(values.dtype), f"{name} {column}: {kind}"
                assert_identical(frame[column].to_numpy(), values, f"{name} {column} in pandas")
                got = got.to_numpy().astype(values.dtype) if field["element"] == "enum" else got.to_numpy()
            elif field["element"] == "u8":
                assert kind == pyarrow.binary(values.shape[1]), f"{name} {column}: {kind}"
                got = np.frombuffer(b"".join(got.to_pylist()), np.uint8).reshape(values.shape)
            else:
                assert kind.list_size == values.shape[1] and kind.value_type == pyarrow.from_numpy_dtype(values.dtype), f"{name} {column}: {kind}"
                got = got.combine_chunks().flatten().to_numpy().reshape(values.shape)
            assert got.dtype == values.dtype, f"{name} {column}: {got.dtype} against {values.dtype}"
            assert_identical(got, values, f"{name} {column}")
            metadata = table.schema.field(column).metadata
            assert metadata[b"unit"].decode() == field["unit"], f"{name} {column}: {metadata}"
            assert metadata[b"field"].decode() == field["name"]
            assert metadata.get(b"frame", b"").decode() == field["frame"]
            assert json.loads(metadata.get(b"shape", b"[]")) == (field["shape"] if wide(field) else [])
            checked += values.size
        about = json.loads(pyarrow.parquet.read_metadata(path).metadata[b"escapement.stream"])
        assert about["period"] == stream["period"] and about["descriptor"] == exported_descriptor(stream["descriptor"])
        if any(map(wide, fields)) and len(records) * stream["record_bytes"] > 1e6:
            assert path.stat().st_size < 1.01 * len(records) * stream["record_bytes"], f"{name}: {path.stat().st_size} bytes"
    return checked


def check_mat(out, streams):
    checked = 0
    # The name of a variable is the valid one of its stream's, and its stream's own name is in it.
    variables = scipy.io.loadmat(out / "run.mat", struct_as_record=False, squeeze_me=False)
    variables = {key: value[0, 0] for key, value in variables.items() if not key.startswith("__")}
    variables.pop("escapement")
    text = lambda value: "".join(value)
    by_stream = {text(struct.stream): (key, struct) for key, struct in variables.items()}
    assert by_stream.keys() == streams.keys(), by_stream.keys() ^ streams.keys()
    for name, (_, fields, stamps, records) in streams.items():
        key, struct = by_stream[name]
        names = struct.info[0, 0]._fieldnames
        for valid in [key, *struct._fieldnames, *names]:
            assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", valid) and valid not in ("end", "for", "if"), valid
        assert struct._fieldnames == ["t", *names, "info", "stream"] and len(set(struct._fieldnames)) == len(struct._fieldnames)
        assert_identical(struct.t, stamps.reshape(-1, 1), f"{name}.t")
        assert len(names) == len(fields)
        for valid, field in zip(names, fields):
            about = getattr(struct.info[0, 0], valid)[0, 0]
            assert [text(getattr(about, what)) for what in ("name", "unit", "frame")] == [field[what] for what in ("name", "unit", "frame")]
            values, got = records[field["name"]], getattr(struct, valid)
            if field["element"] == "bool":
                # As scipy reads what is logical.
                values = values.astype(np.uint8)
            if wide(field):
                values = np.moveaxis(values, 0, -1)
            elif not field["shape"]:
                values = values.reshape(-1, 1)
            assert got.dtype == values.dtype, f"{name}.{valid}: {got.dtype} against {values.dtype}"
            assert got.tobytes(order="C") == np.ascontiguousarray(values).tobytes() and got.shape == values.shape, f"{name}.{valid}"
            checked += values.size
    return checked


def check_mcap(out, streams):
    checked = 0
    transforms, scenes, counts = {}, 0, dict.fromkeys(streams, 0)
    last = -1
    with open(out / "run.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        topics = {channel.topic: channel for channel in summary.channels.values()}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert message.log_time >= last, "messages are in the order of time"
            last = message.log_time
            if channel.topic == "/tf":
                assert schema.name == "foxglove.FrameTransforms"
                for t in decoded.transforms:
                    assert abs(t.rotation.w**2 + t.rotation.x**2 + t.rotation.y**2 + t.rotation.z**2 - 1) < 1e-9, f"{t.child_frame_id} has no attitude"
                    assert t.timestamp.seconds * 10**9 + t.timestamp.nanos == message.log_time
                    key = (t.parent_frame_id, t.child_frame_id)
                    p, q = t.translation, t.rotation
                    transforms.setdefault(key, []).append((message.log_time, [p.x, p.y, p.z], [q.w, q.x, q.y, q.z]))
                continue
            if channel.topic == "/scene":
                scenes += len(decoded.entities)
                continue
            name = channel.topic[1:].replace("/", ".")
            _, fields, stamps, records = streams[name]
            k = counts[name]
            counts[name] += 1
            record = records[k]
            assert message.log_time == round(float(stamps[k]) * 1e9), f"{name} sample {k}"
            # The message's fields are those of the payload in its order; the channel tells names that protobuf does not allow.
            described = decoded.DESCRIPTOR.fields
            assert [channel.metadata.get(f"field.{d.name}", d.name) for d in described] == [f["name"] for f in fields], name
            for field, d in zip(fields, described):
                got = getattr(decoded, d.name)
                value = record[field["name"]].reshape(-1)
                got = np.array(list(got) if field["shape"] else [got], dtype=value.dtype)
                assert_identical(got, value, f"{name}.{field['name']} sample {k}")
                checked += len(value)
    for name, (stream, fields, _, records) in streams.items():
        assert counts[name] == len(records), f"{name}: {counts[name]} of {len(records)}"
        metadata = topics["/" + name.replace(".", "/")].metadata
        for field in fields:
            assert metadata[f"unit.{field['name']}"] == field["unit"]
    assert summary.statistics.message_count == sum(c for c in summary.statistics.channel_message_counts.values())
    poses = [(name, f["name"]) for name, (_, fields, *_) in streams.items() for f in fields if f["name"] == "p_NB_N"]
    if poses:
        _, _, stamps, records = streams[next(name for name, _ in poses if name.endswith(".truth"))]
        stamps = np.round(stamps * 1e9).astype(np.int64)
        for time, p, q in transforms[("N", "B")]:
            k = int(np.searchsorted(stamps, time))
            assert_identical(p, records["p_NB_N"][k], "frame B")
            assert_identical(q, records["quat_NB"][k], "frame B")
        # Everything hangs together: every parent but the world is somebody's child.
        children = {child for _, child in transforms}
        assert {parent for parent, _ in transforms} - children == {"N"}, sorted(transforms)
        print(f"  mcap: {len(transforms)} frames, {scenes} bodies in the scene")
    return checked


def check_rerun(program, run, out, streams):
    """Where Rerun is installed: the recording that it makes, read back by its own package, and its transforms."""
    beside = pathlib.Path(sys.executable).parent
    if not (shutil.which("rerun") or shutil.which("rerun", path=str(beside))):
        refused = subprocess.run([program, "export", run, "--to", "rrd"], capture_output=True, text=True)
        assert refused.returncode == 2 and "rerun-sdk" in refused.stderr, refused
        return "rrd: Rerun is not installed, and the refusal says so"
    from rerun.chunk import RrdReader

    path = f"{beside}{os.pathsep}{os.environ['PATH']}"
    subprocess.run([program, "export", run, "--to", "rrd", "--out", out], check=True, capture_output=True, env={**os.environ, "PATH": path})
    checked, frames, counts = 0, {}, dict.fromkeys(streams, 0)
    chunks = [(chunk.entity_path, chunk.to_record_batch()) for chunk in RrdReader(str(out / "run.rrd")).stream()]
    chunks = [(entity, batch) for entity, batch in chunks if "message_log_time" in batch.schema.names]
    chunks.sort(key=lambda one: (one[0], one[1].column("message_log_time")[0].value))
    for entity, batch in chunks:
        stamps = [stamp.value for stamp in batch.column("message_log_time")]
        if entity == "/tf":
            children, positions = (batch.column(f"Transform3D:{name}").to_pylist() for name in ("child_frame", "translation"))
            for stamp, names, places in zip(stamps, children, positions):
                for name, place in zip(names or [], places or []):
                    frames.setdefault(name, []).append((stamp, place))
            continue
        name = entity[1:].replace("/", ".")
        if name not in streams:
            continue
        _, fields, taped, records = streams[name]
        first, counts[name] = counts[name], counts[name] + len(stamps)
        records = records[first : counts[name]]
        assert stamps == [round(float(t) * 1e9) for t in taped[first : counts[name]]], f"{name}: other stamps"
        column = next(column for column in batch.schema.names if column.endswith(":message"))
        messages = batch.column(column).flatten()
        for k, field in enumerate(fields):
            values = messages.field(k)
            if wide(field) and field["element"] == "u8":
                values = np.frombuffer(b"".join(values.to_pylist()), np.uint8)
            else:
                values = (values.flatten() if field["shape"] else values).to_numpy(zero_copy_only=False)
            assert_identical(values.astype(records[field["name"]].dtype), records[field["name"]].reshape(-1), f"{name}.{field['name']}")
            checked += records[field["name"]].size
    assert counts == {name: len(records) for name, (*_, records) in streams.items()}, counts
    for name, (_, fields, stamps, records) in streams.items():
        if name.endswith(".truth"):
            times = np.round(stamps * 1e9).astype(np.int64)
            for stamp, place in frames["B"]:
                k = int(np.searchsorted(times, stamp))
                assert np.allclose(place, records["p_NB_N"][k], rtol=1e-6, atol=1e-6), f"frame B at {stamp}"
    return f"rrd: Rerun shows {checked} values equal to those of the tape, and {len(frames)} moving frames"


def check_documentation(program, run, made):
    """The snippets of the pages do what the pages say: those of numbers on a capture, the one of pictures on pictures."""
    docs = pathlib.Path(__file__).parents[2] / "docs"
    snippets = lambda page: re.findall(r"```python\n(.*?)```", (docs / page).read_text(), re.DOTALL)
    (numbers,), (pictures, matrices) = snippets("run-folder.md"), snippets("exports.md")
    has = {}
    exec(numbers.replace("RUN", str(run)), has)
    _, _, stamps, records = read_tape(run)["plant.truth"]
    assert_identical(has["t"], stamps, "the stamps of the page's snippet")
    assert_identical(has["truth"]["p_NE_N"], records["p_NE_N"], "the fields of the page's snippet")
    subprocess.run([program, "export", str(run), "--to", "mat"], check=True, stdout=subprocess.DEVNULL)
    exec(matrices.replace("RUN", str(run)), has)
    assert_identical(has["place"], records["p_NE_N"], "the fields of the page's snippet")
    assert has["unit"] == "m"
    for kind in ("csv", "parquet"):
        subprocess.run([program, "export", str(made), "--to", kind], check=True, stdout=subprocess.DEVNULL)
    has = {}
    exec(pictures.replace("RUN", str(made)), has)
    expected = read_tape(made)["camera.picture"][3]["rgb"]
    assert_identical(has["pictures"], expected, "the pictures of the page's snippet")
    assert_identical(has["first"], expected[0], "the first picture of the page's snippet")
    print("the snippets of the pages read what is on the tape")


def check_about(program, run, out):
    """What the files say of the run, as far as its folder says it; and what is chosen of it."""
    with open(out / "run.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert {chunk.compression for chunk in reader.get_summary().chunk_indexes} == {"lz4"}
        about = {record.name: record.metadata for record in reader.iter_metadata()}
    streams = read_tape(run)
    names = [name for name, (_, _, stamps, _) in streams.items() if len(stamps) > 2]
    parquet = pyarrow.parquet.read_metadata(out / f"{names[0]}.parquet").metadata
    if (run / "plan.toml").exists():
        about = about["escapement"]
        struct = scipy.io.loadmat(out / "run.mat", struct_as_record=False)["escapement"][0, 0]
        assert {key: "".join(getattr(struct, key)) for key in struct._fieldnames} == about
        assert about["plan"] == (run / "plan.toml").read_text()
        assert about["digest"] == json.loads((run / "tape/seal.json").read_text())["digest"]
        assert about["version"] == json.loads((run / "run.json").read_text())["version"] and about["seed"]
        for key, value in about.items():
            assert parquet[f"escapement.{key}".encode()].decode() == value, key
    else:
        assert about == {} and b"escapement.plan" not in parquet
    # A field of one stream, from its second sample to the one before the last.
    name = names[0]
    _, fields, stamps, records = streams[name]
    field = fields[-1]["name"]
    chosen = ["--of", f"{name}.{field}", "--from", f"{float(stamps[1])!r} s", "--until", f"{float(stamps[-2])!r} s"]
    part = out / "part"
    subprocess.run([program, "export", str(run), "--to", "parquet", "--out", str(part), *map(str, chosen)], check=True, stdout=subprocess.DEVNULL)
    assert [file.name for file in part.iterdir()] == [f"{name}.parquet"]
    table = pyarrow.parquet.read_table(part / f"{name}.parquet")
    assert len(table) == len(stamps) - 2 and len(table.column_names) == 1 + (1 if wide(fields[-1]) else int(np.prod(fields[-1]["shape"], dtype=int)))
    assert_identical(table[0].to_numpy(), stamps[1:-1], "the stamps that were chosen")
    print("the files say what they are of, and have what was chosen")


def check_run(program, run):
    streams = read_tape(run)
    assert streams, "a tape without streams shows nothing"
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        for kind, check in [("csv", check_csv), ("parquet", check_parquet), ("mat", check_mat), ("mcap", check_mcap)]:
            subprocess.run([program, "export", str(run), "--to", kind, "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
            print(f"{kind}: {check(out, streams)} values equal those of the tape")
        check_about(program, run, out)
        print(check_rerun(program, run, out, streams))


def main():
    program = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        made = pathlib.Path(folder) / "edge_cases"
        edge_cases.write(made)
        for run in [*map(pathlib.Path, sys.argv[2:]), made]:
            check_run(program, run)
        captures = [run for run in map(pathlib.Path, sys.argv[2:]) if (run / "tape/plant.truth.bin").exists()]
        if captures:
            check_documentation(program, captures[0], made)


if __name__ == "__main__":
    main()
