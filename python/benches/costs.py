"""What Python costs, as ratios that are measured side by side: python python/benches/costs.py [ROUNDS]

The same participants in Rust and in Python take turns; the least and the middle of the rounds are printed. Needs
cargo build --release --workspace, and the package.
"""

import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "examples" / "python"), str(ROOT / "python" / "benches")]

import json

import escapement as esc
import pid as loop
from escapement import _program
from escapement.gym import Env

PID = ROOT / "examples" / "pid" / "pid.toml"
LIBRARY = str(ROOT / "target" / "release" / "libposition_loop.so")
SEATS = {"plant": "plant", "controller": "pid", "reference": "reference"}
LOOP = {"plant": loop.Plant, "controller": loop.Pid, "reference": loop.Reference}
IN_RUST = {f"participants.{seat}.run": {"library": LIBRARY, "participant": name} for seat, name in SEATS.items()}
STEPS = 30_000
RING = f"""
duration = "{STEPS} ms"
[participants.first]
run = {{ builtin = "bench-continuous" }}
period = "1 ms"
[participants.second]
run = {{ builtin = "bench-sampled" }}
period = "1 ms"
[connections.there]
from = "first.to"
to = "second.from"
[connections.back]
from = "second.to"
to = "first.from"
"""


def ring(folder, python):
    """µs for an exchange of 27 doubles each way between two processes, recorded."""
    scenario = folder / "ring.toml"
    scenario.write_text(RING)
    command = [_program.needed("the ring"), "run", str(scenario), "--json", "--quiet", "--force", "--out", str(folder / "ring")]
    for seat, name in (("first", "First"), ("second", "Relay")) if python else ():
        host = f'{{ exe = "{sys.executable}", args = ["-m", "escapement.host", "{ROOT}/python/benches/relay.py:{name}"] }}'
        command += ["--set", f"participants.{seat}.run={host}"]
    said = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    return said["wall_time_s"] / STEPS * 1e6


def position_loop(folder, python, here):
    """µs for an activation of the position loop."""
    run = esc.run(
        PID,
        set={"duration": "100 s", **({} if python else IN_RUST)},
        participants=LOOP if python else None,
        in_process=here,
        out=folder / "loop",
        force=True,
        progress=False,
    )
    return run.summary["wall_time_s"] / (100 * (1000 + 200 + 30)) * 1e6


def episode(folder):
    """Steps of an environment in a second: the position loop with an agent, everybody else in Rust."""
    env = Env(PID, "controller", set={**IN_RUST, "duration": "1000 s"}, reward=lambda seen, action, t: 0.0)
    env.reset()
    started, steps = time.perf_counter(), 20_000
    for _ in range(steps):
        env.step([1.0])
    env.close()
    return steps / (time.perf_counter() - started)


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    ways = {
        "exchange of 27 doubles, processes": [lambda at: ring(at, False), lambda at: ring(at, True)],
        "position loop, processes": [lambda at: position_loop(at, False, False), lambda at: position_loop(at, True, False)],
        "position loop, one process": [lambda at: position_loop(at, False, True), lambda at: position_loop(at, True, True)],
    }
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, (rust, python) in ways.items():
            rounds_of = [(rust(folder), python(folder)) for _ in range(rounds)]
            least = [min(column) for column in zip(*rounds_of)]
            middle = [sorted(column)[rounds // 2] for column in zip(*rounds_of)]
            for what, (one, other) in (("least", least), ("median", middle)):
                print(f"{name}, {what}: {one:.2f} µs in Rust, {other:.2f} µs in Python, {other / one:.1f} times")
        print(f"steps of an environment: at most {max(episode(folder) for _ in range(rounds)):.0f} a second")


if __name__ == "__main__":
    main()
