"""What Python costs, as ratios measured side by side: python python/benches/costs.py [ROUNDS]

The same participants in Rust and in Python take turns; the least and the middle of the rounds are printed. Needs
cargo build --release --workspace, and the package.
"""

import pathlib
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in ("examples/python", "python/benches", "crates/escapement-c/benches")]

import numpy as np

import escapement as esc
import pid as loop
from escapement import _program
from escapement.gym import Env
from ring import exchange

PID = ROOT / "examples" / "pid" / "pid.toml"
LIBRARY = str(ROOT / "target" / "release" / "libposition_loop.so")
SEATS = {"plant": "plant", "controller": "pid", "reference": "reference"}
LOOP = {"plant": loop.Plant, "controller": loop.Pid, "reference": loop.Reference}
IN_RUST = {f"participants.{seat}.run": {"library": LIBRARY, "participant": name} for seat, name in SEATS.items()}
STEPS = 30_000


def ring(folder, python):
    """µs for an exchange of 27 doubles each way between two processes, recorded."""
    host = f'{{ exe = "{sys.executable}", args = ["-m", "escapement.host", "{ROOT}/python/benches/relay.py:NAME"] }}'
    seats = {seat: host.replace("NAME", name) for seat, name in (("first", "First"), ("second", "Relay")) if python}
    return exchange(_program.needed("the ring"), folder, seats, STEPS)


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


EPISODES = {
    "environment of the spring": (ROOT / "orchestrator/src/templates/spring.toml", "left", 20_000, {"duration": "1000 s"}),
    "environment of the position loop": (PID, "controller", 20_000, {**IN_RUST, "duration": "1000 s"}),
    "environment of the close capture": (ROOT / "scenarios" / "close.toml", "controller", 3_000, {}),
}


def episode(scenario, agent, steps, sets):
    """Seconds for a step of an environment, all others in Rust, and for the same stretch of the bare run in one process."""
    env = Env(scenario, agent, set=sets, reward=lambda observation, action, t: 0.0)
    action = np.zeros(env.action_space.shape)
    env.reset()
    started = time.perf_counter()
    for _ in range(steps):
        env.step(action)
    took = time.perf_counter() - started
    env.close()
    with esc.Run(scenario, set=sets, in_process=True, record="memory") as run:
        started = time.perf_counter()
        run.run_to(f"{steps * env._period}/{env._parts} s")
        bare = time.perf_counter() - started
    return took / steps, bare / steps


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
    for name, (scenario, agent, steps, sets) in EPISODES.items():
        both = [episode(scenario, agent, steps, sets) for _ in range(rounds)]
        for what, pick in (("least", min), ("median", lambda all_of: sorted(all_of)[rounds // 2])):
            (step, bare) = (pick(column) for column in zip(*both))
            print(f"{name}, {what}: {1 / step:,.0f} steps a second, {bare / step:.2f} times the speed of the bare run in one process")


if __name__ == "__main__":
    main()
