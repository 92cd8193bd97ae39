"""FMUs of other tools in runs: two subsystems of OpenModelica against the whole system, and pairs of PythonFMU and PythonFMU3.

    imported.py ORCHESTRATOR FOLDER OPENMODELICA
"""

import subprocess
import sys
from pathlib import Path

import numpy

orchestrator, work, openmodelica = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])


def run(scenario, name, *more):
    file, out = work / f"{name}.toml", work / name
    file.write_text(scenario)
    result = subprocess.run([orchestrator, "run", file, "--quiet", "--force", "--out", out, *more], capture_output=True, text=True)
    assert result.returncode == 0, result
    return out


def assert_same_tape(one, other):
    result = subprocess.run([orchestrator, "compare", one, other], capture_output=True, text=True)
    assert result.returncode == 0, result


def stream(folder, name, *fields):
    return numpy.fromfile(folder / "tape" / f"{name}.bin", dtype=[("t", "<f8")] + [(one, "<f8") for one in fields])


def half(number, other, period):
    return f"""
[participants.half{number}]
period = "{period}"
[participants.half{number}.run]
fmu = "{openmodelica}/MassSpringSubSystem{number}.fmu"
[participants.half{number}.run.ports]
neighbour = [{{ name = "x", variable = "x{other}" }}]
motion = [{{ name = "x", variable = "x{number}" }}]
[connections.from{number}]
from = "half{number}.motion"
to = "half{other}.neighbour"
initial = "first-sample"
"""


def masses(period, reference):
    """The largest distance of the halves from the whole, which has another period; both are read at the halves' instants."""
    whole = f"""
[participants.whole]
period = "{reference}"
[participants.whole.run]
fmu = "{openmodelica}/MassSpringSystem.fmu"
ports = {{ inputs = [], motion = ["x1", "x2"] }}
"""
    scenario = 'duration = "10 s"\n' + half(1, 2, period) + half(2, 1, period) + whole
    apart, together = run(scenario, "masses-apart"), run(scenario, "masses-together", "--in-process")
    assert_same_tape(apart, together)
    reference = stream(apart, "whole.motion", "x1", "x2")
    halves = [stream(apart, f"half{number}.motion", "x")["x"] for number in (1, 2)]
    every = (len(reference) - 1) // (len(halves[0]) - 1)
    return max(abs(halves[number - 1] - reference[f"x{number}"][::every]).max() for number in (1, 2))


def openmodelica_halves():
    # Both FMUs take an Euler step for each communication step, and so does the whole: with equal steps nothing is lost at the coupling.
    assert masses("10 ms", "10 ms") == 0.0
    errors = [masses(period, "0.25 ms") for period in ("20 ms", "10 ms", "5 ms")]
    print("  OpenModelica, two halves against the whole:", ", ".join(f"{error:.3g} m" for error in errors))
    # First order: half the step, half the error.
    for large, small in zip(errors, errors[1:]):
        assert 1.8 < large / small < 2.4, errors


MASS = """
{imports}


class {name}({base}):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.x, self.v, self.f = 0.0, 0.2, 0.0, 0.0
{variables}

    def do_step(self, current_time, step_size):
        {step}
        return True
"""
STEPS = {
    "Mass": "self.v += step_size * (self.f - 4.0 * self.x); self.x += step_size * self.v",
    "Brake": "self.f = -0.5 * self.v",
}
CAUSALITIES = {"Mass": {"f": "input", "x": "output", "v": "output"}, "Brake": {"v": "input", "f": "output"}}


def python_fmu(tool, name):
    """Makes an FMU of a few lines of Python."""
    version = "3" if tool == "pythonfmu3" else "2"
    base, real = f"Fmi{version}Slave", "Float64" if version == "3" else "Real"
    causality = f"Fmi{version}Causality"
    names = [base, causality, real] + ([f"Fmi{version}Variability"] if version == "3" else [])
    lines = []
    for variable, what in CAUSALITIES[name].items():
        more = f", variability=Fmi3Variability.continuous{', start=0.0' if what == 'input' else ''}" if version == "3" else ""
        lines.append(f'self.register_variable({real}("{variable}", causality={causality}.{what}{more}))')
    if version == "3":
        lines.append('self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous))')
    source = MASS.format(
        imports=f"from {tool} import {', '.join(names)}",
        name=name,
        base=base,
        variables="\n".join("        " + line for line in lines),
        step=STEPS[name],
    )
    folder = work / tool
    folder.mkdir(exist_ok=True)
    file = folder / f"{name.lower()}.py"
    file.write_text(source)
    subprocess.run([sys.executable, "-m", tool, "build", "-f", file, "-d", folder], check=True, capture_output=True)
    return folder / f"{name}.fmu"


def python_pair(tool):
    mass, brake = python_fmu(tool, "Mass"), python_fmu(tool, "Brake")
    scenario = f"""duration = "3 s"
[participants.mass]
period = "10 ms"
[participants.mass.run]
fmu = "{mass}"
ports = {{ push = ["f"], motion = ["v"], outputs = ["x", "v"] }}
[participants.brake]
period = "10 ms"
[participants.brake.run]
fmu = "{brake}"
ports = {{ motion = ["v"], push = ["f"] }}
[connections.motion]
from = "mass.motion"
to = "brake.motion"
[connections.push]
from = "brake.push"
to = "mass.push"
"""
    apart, together = run(scenario, f"{tool}-apart"), run(scenario, f"{tool}-together", "--in-process")
    assert_same_tape(apart, together)
    # The same in plain Python: each reads what the other one gave out at the beginning of the step.
    x, v, f = 0.2, 0.0, 0.0
    expected = [(x, v)]
    step = 0.01
    for _ in range(300):
        (v_next, f_next) = v + step * (f - 4.0 * x), -0.5 * v
        x, v, f = x + step * v_next, v_next, f_next
        expected.append((x, v))
    found = stream(apart, "mass.outputs", "x", "v")
    assert [(one["x"], one["v"]) for one in found] == expected, tool
    print(f"  {tool}: {len(found)} samples of a pair, to the last bit")


openmodelica_halves()
python_pair("pythonfmu")
python_pair("pythonfmu3")
