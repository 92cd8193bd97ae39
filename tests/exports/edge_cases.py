"""A tape of the edge cases of tables and file formats, written from the documentation of tapes alone.

    python3 tests/exports/edge_cases.py RUN

Names that another column has, that differ in case only, or that other tools read as paths; pictures and point clouds; the ends of
every number's range; a stream without a sample; streams whose messages would get one name.
"""

import json
import pathlib
import sys

import numpy as np

ELEMENTS = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "u64": "<u8", "u32": "<u4", "u8": "u1"}


def extremes(element):
    """The ends of the range, what lies beside them, and for integers what no double can hold."""
    kind = np.dtype(ELEMENTS[element])
    if kind.kind == "f":
        info = np.finfo(kind)
        return [np.nan, np.inf, -np.inf, -0.0, info.max, info.min, info.tiny, info.smallest_subnormal, 0.1, 1 / 3]
    info = np.iinfo(kind)
    middle = [2**53 + 1, -(2**53) - 1] if info.bits == 64 else [127, 128]
    return [info.min, info.max, info.max - 1, 0, 1] + [x for x in middle if info.min <= x <= info.max]


def field(name, element="f64", shape=(), unit="1", frame=""):
    return {"name": name, "element": element, "shape": list(shape), "unit": unit, "frame": frame}


# Stream: the message's name, how many samples, the fields.
STREAMS = {
    "camera.picture": ("Picture", 20, [field("exposure", unit="s"), field("rgb", "u8", [480, 640, 3])]),
    # The names of its arrays differ in case only.
    "camera.depth": ("Picture", 3, [field("Z", "f32", [20, 30], "m"), field("z", "f32", [600], "m"), field("z.2", "u32", [257])]),
    "lidar.scan": ("Scan", 4, [field("when", "u64", unit="ns"), field("points", "f64", [100, 3], "m", "L"), field("count", "i64", [256]), field("id", "i64", [257])]),
    # The stamp's own name, and a field that has by right what the other would be called.
    "gps.fix": ("Fix", 5, [field("t", unit="s"), field("t_2", unit="s"), field("T", unit="s"), field("x", unit="m")]),
    "gps.week": ("Fix", 5, [field("x", unit="m"), field("t", "u32", unit="1"), field("week", "u32")]),
    "arm.state": ("ArmState", 5, [field(name) for name in ("q_1", "q1", "a_b", "aB", "AB", "p_AB_C", "pAB_C", "_x", "x", "x_")]),
    "odd.names": ("Odd Name", 5, [
        field("a", shape=[2], unit="m"), field("a[0]", unit="m"), field("imu"), field("imu.acc"), field(".front"), field("[0]"), field("[x"),
        field("α"), field("per cent"), field("per_cent"), field("1st"), field('quote"d', unit='kg "net"'), field("comma", unit="m,s"), field("'"),
        field("in"), field("constructor"), field(" space "), field("list"), field("element"), field("m", shape=[2, 2], unit=""), field("\\"),
    ]),
    "odd.message": ("Odd_Name", 2, [field("x")]),
    "Odd.message": ("odd name", 2, [field("x")]),
    "numbers.extreme": ("Numbers", 10, [field(e, e) for e in sorted(ELEMENTS, key=lambda e: -np.dtype(ELEMENTS[e]).itemsize)] + [field(f"{e}_list", "u8", [3]) for e in ("a",)]),
    "numbers.wide": ("Wide numbers", 10, [field(e, e, [300]) for e in sorted(ELEMENTS, key=lambda e: -np.dtype(ELEMENTS[e]).itemsize)]),
    "never.published": ("Empty", 0, [field("x", unit="m"), field("picture", "u8", [1000]), field("list", "u32", [1000])]),
    "wide.table": ("Table", 3, [field(f"row_{k}", shape=[256]) for k in range(20)]),
}


def aligned(fields):
    """The fields with their offsets: larger elements first, so that each is aligned, and bytes to fill up."""
    fields = sorted(fields, key=lambda f: -np.dtype(ELEMENTS[f["element"]]).itemsize)
    at, out = 0, []
    for one in fields:
        out.append({**one, "offset": at})
        at += int(np.prod(one["shape"], dtype=int)) * np.dtype(ELEMENTS[one["element"]]).itemsize
    largest = np.dtype(ELEMENTS[fields[0]["element"]]).itemsize
    if at % largest:
        out.append({**field("padding", "u8", [largest - at % largest]), "offset": at})
        at += largest - at % largest
    return out, at


def write(run):
    tape = run / "tape"
    tape.mkdir(parents=True)
    draw, entries = np.random.default_rng(11), []
    for name, (message, samples, fields) in STREAMS.items():
        fields, size = aligned(fields)
        payload = np.dtype([(f["name"], ELEMENTS[f["element"]], tuple(f["shape"])) for f in fields])
        assert payload.itemsize == size
        records = np.zeros(samples, np.dtype([("stamp", "<f8"), ("payload", payload)]))
        records["stamp"] = np.arange(samples) * 0.01
        for one in fields:
            values = records["payload"][one["name"]]
            pool = extremes(one["element"])
            if name.startswith("numbers"):
                values[...] = np.resize(np.array(pool, dtype=values.dtype), values.shape)
            elif values.dtype.kind == "f":
                values[...] = draw.normal(size=values.shape)
            else:
                values[...] = draw.integers(0, np.iinfo(values.dtype).max, size=values.shape, dtype=values.dtype, endpoint=True)
        participant, port = name.split(".")
        (tape / f"{name}.bin").write_bytes(records.tobytes())
        entries.append({
            "file": f"{name}.bin", "record_bytes": size + 8, "participant": participant, "port": port, "offset": "0 s",
            "period": "10 ms", "first_index": 0, "descriptor": {"name": message, "size": size, "fields": fields},
        })
    (tape / "index.json").write_text(json.dumps({"format": "escapement-tape", "version": 1, "streams": entries}))


if __name__ == "__main__":
    write(pathlib.Path(sys.argv[1]))
