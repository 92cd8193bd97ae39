"""Exports a run in every format, reads it back with the tools' own packages and compares it with the tape, value by value.

    python3 tests/exports/check_exports.py ORCHESTRATOR RUN

ORCHESTRATOR is the program, RUN a run folder. Needs the packages of requirements.txt beside this file.
"""

import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import pyarrow.parquet
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

NUMPY = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "u64": "<u8", "u32": "<u4", "u8": "u1"}


def read_tape(run):
    """The tape by its documentation alone: index.json and plain files of records."""
    tape = run / "tape"
    index = json.loads((tape / "index.json").read_text())
    streams = {}
    for stream in index["streams"]:
        fields = stream["descriptor"]["fields"]
        dtype = np.dtype([("t", "<f8")] + [(f["name"], NUMPY[f["element"]], tuple(f["shape"])) for f in fields])
        assert dtype.itemsize == stream["record_bytes"], stream["file"]
        # A torn last record belongs to nobody.
        data = (tape / stream["file"]).read_bytes()
        records = np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype=dtype)
        streams[f"{stream['participant']}.{stream['port']}"] = (stream, fields, records)
    return streams


def same(a, b, what):
    """Bit for bit, with NaN equal to NaN."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape, f"{what}: {a.shape} against {b.shape}"
    equal = (a == b) | ((a != a) & (b != b))
    assert equal.all(), f"{what}: first difference at {np.argwhere(~equal)[0]}"


def columns(fields, records):
    """Name and values of every column after the time."""
    for field in fields:
        values = records[field["name"]].reshape(len(records), -1)
        shape = field["shape"]
        for k in range(values.shape[1]):
            place = "".join(f"[{i}]" for i in np.unravel_index(k, shape)) if shape else ""
            yield f"{field['name']}{place} [{field['unit']}]", field, values[:, k]


def check_csv(out, streams):
    checked = 0
    for name, (_, fields, records) in streams.items():
        with open(out / f"{name}.csv", newline="") as file:
            rows = csv.reader(file)
            header = next(rows)
            table = np.array([[float(x) for x in row] for row in rows]).reshape(-1, len(header))
        assert header[0] == "t [s]"
        same(table[:, 0], records["t"], f"{name}.t")
        expected = list(columns(fields, records))
        assert header[1:] == [column for column, _, _ in expected], header
        for k, (column, _, values) in enumerate(expected):
            # f32 is written as its own shortest text.
            got = table[:, k + 1].astype(values.dtype)
            same(got, values, f"{name} {column}")
            checked += len(values)
    return checked


def check_parquet(out, streams):
    checked = 0
    for name, (stream, fields, records) in streams.items():
        path = out / f"{name}.parquet"
        table = pyarrow.parquet.read_table(path)
        assert table.num_rows == len(records)
        same(table.column("t [s]").to_numpy(), records["t"], f"{name}.t")
        for column, field, values in columns(fields, records):
            got = table.column(column).to_numpy()
            assert got.dtype == values.dtype, f"{name} {column}: {got.dtype} against {values.dtype}"
            same(got, values, f"{name} {column}")
            metadata = table.schema.field(column).metadata
            assert metadata[b"unit"].decode() == field["unit"], f"{name} {column}: {metadata}"
            assert metadata[b"field"].decode() == field["name"]
            assert metadata.get(b"frame", b"").decode() == field["frame"]
            checked += len(values)
        about = json.loads(pyarrow.parquet.read_metadata(path).metadata[b"escapement.stream"])
        assert about["period"] == stream["period"] and about["descriptor"] == stream["descriptor"]
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
            _, fields, records = streams[name]
            k = counts[name]
            counts[name] += 1
            record = records[k]
            assert message.log_time == round(float(record["t"]) * 1e9), f"{name} sample {k}"
            for field in fields:
                got = getattr(decoded, field["name"])
                value = record[field["name"]].reshape(-1)
                got = np.array(list(got) if field["shape"] else [got], dtype=value.dtype)
                same(got, value, f"{name}.{field['name']} sample {k}")
                checked += len(value)
    for name, (stream, fields, records) in streams.items():
        assert counts[name] == len(records), f"{name}: {counts[name]} of {len(records)}"
        metadata = topics["/" + name.replace(".", "/")].metadata
        for field in fields:
            assert metadata[f"unit.{field['name']}"] == field["unit"]
    assert summary.statistics.message_count == sum(c for c in summary.statistics.channel_message_counts.values())
    poses = [(name, f["name"]) for name, (_, fields, _) in streams.items() for f in fields if f["name"] == "p_NB_N"]
    if poses:
        _, _, records = streams[next(name for name, _ in poses if name.endswith(".truth"))]
        stamps = np.round(records["t"] * 1e9).astype(np.int64)
        for time, p, q in transforms[("N", "B")]:
            k = int(np.searchsorted(stamps, time))
            same(p, records["p_NB_N"][k], "frame B")
            same(q, records["quat_NB"][k], "frame B")
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
        _, fields, records = streams[name]
        first, counts[name] = counts[name], counts[name] + len(stamps)
        records = records[first : counts[name]]
        assert stamps == [round(float(t) * 1e9) for t in records["t"]], f"{name}: other stamps"
        column = next(column for column in batch.schema.names if column.endswith(":message"))
        messages = batch.column(column).flatten()
        for field in fields:
            values = messages.field(field["name"])
            values = values.flatten() if field["shape"] else values
            same(values.to_numpy(zero_copy_only=False).astype(records[field["name"]].dtype), records[field["name"]].reshape(-1), f"{name}.{field['name']}")
            checked += records[field["name"]].size
    assert counts == {name: len(records) for name, (_, _, records) in streams.items()}, counts
    for name, (_, fields, records) in streams.items():
        if name.endswith(".truth"):
            times = np.round(records["t"] * 1e9).astype(np.int64)
            for stamp, place in frames["B"]:
                k = int(np.searchsorted(times, stamp))
                assert np.allclose(place, records["p_NB_N"][k], rtol=1e-6, atol=1e-6), f"frame B at {stamp}"
    return f"rrd: Rerun shows {checked} values equal to those of the tape, and {len(frames)} moving frames"


def main():
    program, run = sys.argv[1], pathlib.Path(sys.argv[2])
    streams = read_tape(run)
    assert streams, "a tape without streams shows nothing"
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        for kind, check in [("csv", check_csv), ("parquet", check_parquet), ("mcap", check_mcap)]:
            subprocess.run([program, "export", str(run), "--to", kind, "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
            print(f"{kind}: {check(out, streams)} values equal those of the tape")
        print(check_rerun(program, run, out, streams))


if __name__ == "__main__":
    main()
