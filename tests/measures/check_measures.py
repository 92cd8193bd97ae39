"""Measures of random tapes against the same figures computed with numpy, from the documentation alone.

    python3 tests/measures/check_measures.py ORCHESTRATOR [TAPES [SEED]]

Streams at rates that do not meet, of every type of number, with vectors and attitudes, some without a sample, some with NaN or infinity as
a fault leaves them; windows that end exactly on a sample, between two, or where nothing is. What cannot be measured must have a reason.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
from fractions import Fraction

import numpy as np

ELEMENTS = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "u64": "<u8", "u32": "<u4", "u8": "u1"}


def text(time):
    return f"{time.numerator}/{time.denominator} s"


class Stream:
    """A stream with one field of each kind, as numbers and as bytes."""

    def __init__(self, name, rng, samples):
        self.name = name
        self.period = Fraction(int(rng.integers(1, 40)), int(rng.choice([300, 1000, 7, 64])))
        self.offset = Fraction(int(rng.integers(0, 30)), 100)
        self.times = [self.offset + k * self.period for k in range(samples)]
        self.fields = [("x", "f64", ()), ("v", "f64", (3,)), ("q", "f64", (4,)), ("i", "i64", ()), ("u", "u64", ()), ("f", "f32", (2,)),
                       ("n", "i32", ()), ("m", "u32", ()), ("flags", "u8", (8,))]
        self.type = np.dtype([("t", "<f8"), *[(name, ELEMENTS[element], shape) for name, element, shape in self.fields]])
        self.records = np.zeros(samples, self.type)
        self.records["t"] = [float(time) for time in self.times]
        for name, element, shape in self.fields:
            values = self.records[name]
            if values.dtype.kind == "f":
                values[...] = rng.normal(size=values.shape) * 10.0 ** rng.integers(-6, 6) if rng.random() < 0.5 else np.cumsum(rng.normal(size=values.shape), axis=0)
            else:
                info = np.iinfo(values.dtype)
                low, high = (info.min, info.max) if rng.random() < 0.3 else (max(info.min, -5), 5)
                values[...] = rng.integers(low, high, size=values.shape, dtype=values.dtype, endpoint=True)

    def insert_non_finite_value(self, rng):
        """What a fault may leave: one value that is no number, or infinite."""
        field = rng.choice(["x", "v", "q"])
        at = int(rng.integers(0, len(self.records)))
        self.records[field].reshape(len(self.records), -1)[at, 0] = rng.choice([np.nan, np.inf, -np.inf])

    def index(self):
        at, fields = 0, []
        for name, element, shape in self.fields:
            fields.append({"name": name, "element": element, "shape": list(shape), "unit": "1" if name == "q" else "m", "frame": "", "offset": at})
            at += int(np.prod(shape, dtype=int)) * np.dtype(ELEMENTS[element]).itemsize
        assert at == self.type.itemsize - 8
        participant, port = self.name.split(".")
        return {"file": f"{self.name}.bin", "record_bytes": at + 8, "participant": participant, "port": port, "offset": text(self.offset),
                "period": text(self.period), "first_index": 0, "descriptor": {"name": "M", "size": at, "fields": fields}}


def angle(p, q):
    """The angle of the rotation from p to q by their matrices' trace and skew part, in twice the precision."""
    def matrix(q):
        w, x, y, z = (q / np.sqrt(np.sum(q * q))).astype(np.longdouble)
        return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    if not (np.isfinite(p).all() and np.isfinite(q).all()):
        return np.nan
    r = matrix(p.astype(np.longdouble)).T @ matrix(q.astype(np.longdouble))
    skew = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return float(np.arctan2(np.sqrt(np.sum(skew * skew)) / 2, (np.trace(r) - 1) / 2))


def signal(of, minus, through, field, start, end):
    """Instants and values (a column for each signal) of a measure from `start` to `end`, both included."""
    picked = [k for k, time in enumerate(of.times) if (start is None or time >= start) and (end is None or time <= end)]
    columns = lambda stream: stream.records[field].reshape(len(stream.records), int(np.prod(stream.type[field].shape, dtype=int))).astype(np.float64)
    values = columns(of)
    pairs = [(k, None) for k in picked]
    if minus is not None:
        # The newest sample at or before, by the exact times.
        known = lambda time: (time - minus.offset) // minus.period
        pairs = [(k, min(int(known(of.times[k])), len(minus.times) - 1)) for k in picked if known(of.times[k]) >= 0 and minus.times]
        # Where the other stream has ended, its newest sample is not known any more, except at the one instant that ends the first stream.
        ended = minus.offset + len(minus.times) * minus.period
        ends = lambda k: 0 < k == len(of.times) - 1 and of.times[k - 1] < ended
        pairs = [(k, other) for k, other in pairs if known(of.times[k]) == other or ends(k)]
        others = columns(minus)
    rows = []
    for k, other in pairs:
        if through == "angle":
            rows.append([angle(values[k], others[other] if minus is not None else np.array([1.0, 0, 0, 0]))])
            continue
        row = values[k] - (others[other] if minus is not None else 0.0)
        rows.append([np.sqrt(np.sum(row * row))] if through == "norm" else row)
    return [k for k, _ in pairs], np.array(rows).reshape(len(rows), -1) if rows else np.zeros((0, 1))


def figure(compute, x, t, period, more):
    """The figure of one signal, or nothing where it cannot be measured."""
    if len(x) == 0 or not np.all(np.isfinite(x)):
        return None
    dt = float(period)
    threshold, (low, high) = more.get("threshold"), more.get("band", (0, 0))
    trapezoid = lambda x: np.sum((x[1:] + x[:-1]).astype(np.longdouble) / 2) * dt
    if compute == "first-crossing":
        there = x >= threshold if x[0] < threshold else x <= threshold
        return float(t[np.argmax(there)]) if there.any() else None
    if compute == "settling-time":
        outside = np.flatnonzero((x < low) | (x > high))
        first = outside[-1] + 1 if len(outside) else 0
        return t[first] - t[0] if first < len(x) else None
    if compute == "rate":
        return np.max(np.abs(np.diff(x)) / dt) if len(x) > 1 else None
    wide = x.astype(np.longdouble)
    return float({
        "min": lambda: x.min(), "max": lambda: x.max(), "max-abs": lambda: np.abs(x).max(), "range": lambda: x.max() - x.min(),
        "mean": lambda: wide.mean(), "rms": lambda: np.sqrt((wide * wide).mean()), "final": lambda: x[-1],
        "integral": lambda: trapezoid(x), "integral-abs": lambda: trapezoid(np.abs(x)),
        "time-above": lambda: np.count_nonzero(x > threshold) * dt, "time-below": lambda: np.count_nonzero(x < threshold) * dt,
        "changes": lambda: np.count_nonzero(x[1:] != x[:-1]),
        # Not numpy's: it rounds percent / 100, and takes the 103rd of 300 values for 34 %.
        "percentile": lambda: np.sort(x)[max(-(-more["percent"] * len(x) // 100), 1) - 1],
    }[compute]())


COMPUTE = ["min", "max", "max-abs", "range", "mean", "rms", "final", "integral", "integral-abs", "rate", "time-above", "time-below",
           "first-crossing", "settling-time", "changes", "percentile"]
# What is a value of the signal, a count or an instant, and not a sum: equal to the last digit.
EXACT = {"min", "max", "max-abs", "final", "changes", "percentile", "first-crossing"}


def random_time(rng, stream):
    """A time on a sample, between two, before or after all of them."""
    kind = rng.integers(0, 4)
    if kind == 0 and stream.times:
        return stream.times[int(rng.integers(0, len(stream.times)))]
    return Fraction(int(rng.integers(0, 4000)), 997) if kind < 3 else Fraction(int(rng.integers(500, 900)))


def random_measure(rng, streams):
    of = streams[int(rng.integers(0, len(streams)))]
    field = str(rng.choice([name for name, *_ in of.fields]))
    through = None
    if field in ("v", "f") and rng.random() < 0.4:
        through = "norm"
    if field == "q" and rng.random() < 0.6:
        through = "angle"
    compute = str(rng.choice(COMPUTE))
    other = streams[int(rng.integers(0, len(streams)))]
    start, end = (random_time(rng, of) if rng.random() < 0.5 else None for _ in range(2))
    if start is not None and end is not None and end < start:
        start, end = end, start
    return {
        "of": of, "field": field, "through": through, "compute": compute,
        "minus": other if other is not of and rng.random() < 0.5 else None,
        "from": start, "to": end,
        "threshold": float(np.round(rng.normal(), 3)), "band": sorted(np.round(rng.normal(size=2) * 3, 3).tolist()),
        "percent": int(rng.integers(0, 101)),
    }


def toml(name, one):
    unit = "rad" if one["through"] == "angle" else "1" if one["field"] == "q" else "m"
    quantity = lambda value: str(value) if unit == "1" else f'"{value} {unit}"'
    lines = [f"[measures.{name}]", f'of = "{one["of"].name}.{one["field"]}"', f'compute = "{one["compute"]}"']
    if one["minus"] is not None:
        lines.append(f'minus = "{one["minus"].name}.{one["field"]}"')
    if one["through"]:
        lines.append(f'through = "{one["through"]}"')
    lines += [f'{key} = "{text(one[key])}"' for key in ("from", "to") if one[key] is not None]
    if one["compute"] in ("time-above", "time-below", "first-crossing"):
        lines.append(f'threshold = {quantity(one["threshold"])}')
    if one["compute"] == "settling-time":
        lines.append(f'band = {quantity(one["band"])}')
    if one["compute"] == "percentile":
        lines.append(f'percent = {one["percent"]}')
    return "\n".join(lines) + "\n"


def check_tape(orchestrator, folder, rng):
    streams = [Stream(name, rng, int(rng.choice([0, 1, 2, 40, 300]))) for name in ("a.x", "a.y", "b.x")]
    for stream in streams:
        if len(stream.records) and rng.random() < 0.3:
            stream.insert_non_finite_value(rng)
    tape = folder / "tape"
    tape.mkdir()
    for stream in streams:
        (tape / f"{stream.name}.bin").write_bytes(stream.records.tobytes())
    index = {"format": "escapement-tape", "version": 1, "streams": [stream.index() for stream in streams]}
    (tape / "index.json").write_text(json.dumps(index))
    measures = {f"m{number}": random_measure(rng, streams) for number in range(60)}
    file = folder / "measures.toml"
    file.write_text('duration = "1 s"\n' + "".join(toml(name, one) for name, one in measures.items()))
    output = subprocess.run([orchestrator, "measure", str(tape), "--measures", str(file), "--json"], capture_output=True, text=True)
    assert output.returncode == 0, output.stderr
    found = json.loads(output.stdout)["measures"]
    measured = absent = 0
    for name, one in measures.items():
        picked, values = signal(one["of"], one["minus"], one["through"], one["field"], one["from"], one["to"])
        own = found[name]
        reported = own["value"] if isinstance(own["value"], list) else [own["value"]]
        times = one["of"].records["t"][picked]
        columns = values.T if len(values) else [np.zeros(0)] * len(reported)
        assert len(reported) == len(columns) or not len(values), f"{toml(name, one)}: {own}"
        for value, x in zip(reported, columns):
            expected = figure(one["compute"], x, times, one["of"].period, one)
            if expected is not None and not np.isfinite(expected):
                expected = None
            where = f"{toml(name, one)}{own}: numpy has {expected}"
            if expected is None:
                assert value is None and own.get("reason"), where
                absent += 1
                continue
            exact = one["compute"] in EXACT and one["through"] is None
            scale = max(abs(expected), np.abs(x).max() * (1 if one["compute"] != "integral" else len(x) * float(one["of"].period)))
            assert value is not None and (value == expected if exact else abs(value - expected) <= 4e-15 * len(x) ** 0.5 * scale + 1e-300 or abs(value - expected) <= 1e-13 * scale), where
            measured += 1
    return measured, absent


def main():
    orchestrator = sys.argv[1]
    tapes, seed = (int(word) for word in (sys.argv[2:] + ["40", "7"][len(sys.argv) - 2:])[:2])
    rng = np.random.default_rng(seed)
    measured = absent = 0
    for _ in range(tapes):
        with tempfile.TemporaryDirectory() as folder:
            some, none = check_tape(orchestrator, pathlib.Path(folder), rng)
        measured, absent = measured + some, absent + none
    assert measured > 1000 and absent > 200, (measured, absent)
    print(f"measures: {measured} figures of {tapes} tapes equal those of numpy; {absent} cannot be measured, and say why")


if __name__ == "__main__":
    main()
