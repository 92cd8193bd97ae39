"""An exchange of 27 doubles each way between two processes, recorded: the ring of `escapement bench` as a scenario, for programs of any language."""

import json
import subprocess

SCENARIO = """
duration = "{steps} ms"
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


def exchange(escapement, folder, seats, steps):
    """µs for an exchange. `seats` replaces the Rust builtins: the value of `run` by slot."""
    scenario = folder / "ring.toml"
    scenario.write_text(SCENARIO.format(steps=steps))
    command = [escapement, "run", scenario, "--json", "--quiet", "--force", "--out", folder / "ring"]
    for seat, run in seats.items():
        command += ["--set", f"participants.{seat}.run={run}"]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(said)["wall_time_s"] / steps * 1e6
