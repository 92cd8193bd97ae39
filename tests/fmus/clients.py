"""An exported scenario in libcosim and in Ecos: each of their steps gives the samples of the run, to the last bit.

    clients.py ORCHESTRATOR FOLDER
"""

import subprocess
import sys
from pathlib import Path

import numpy
from ecospy import EcosSimulation, EcosSimulationStructure
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

orchestrator, work = sys.argv[1], Path(sys.argv[2])
PERIOD, STEPS = 0.01, 150
NAMES = [f"{mass}.motion.{field}" for mass in ("left", "right") for field in ("position", "velocity")]


def run(*arguments):
    subprocess.run([orchestrator, *map(str, arguments)], check=True, capture_output=True)


def expected(name, t):
    """The newest sample at t."""
    stream, field = name.rsplit(".", 1)
    fields = [("t", "<f8"), ("position", "<f8"), ("velocity", "<f8")]
    samples = numpy.fromfile(work / "masses" / "tape" / f"{stream}.bin", dtype=fields)
    return samples[field][numpy.searchsorted(samples["t"], t + 1e-9) - 1]


def check(tool, values):
    """`values` gives the outputs behind each step."""
    for step, found in enumerate(values, start=1):
        for name, value in zip(NAMES, found):
            assert value == expected(name, step * PERIOD), (tool, name, step, value)
    print(f"  {tool}: {STEPS} steps, to the last bit")


def libcosim(file):
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(step_size=int(PERIOD * 1e9))
    number = execution.add_local_slave(local_slave=CosimLocalSlave(fmu_path=str(file), instance_name="masses"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    references = {one.name: one.valueReference for one in read_model_description(str(file)).modelVariables}
    for _ in range(STEPS):
        execution.step()
        yield observer.last_real_values(number, [references[name] for name in NAMES])


def ecos(file):
    with EcosSimulationStructure() as structure:
        structure.add_model("masses", str(file))
        with EcosSimulation(structure=structure, step_size=PERIOD) as simulation:
            simulation.init()
            for _ in range(STEPS):
                simulation.step()
                yield [simulation.get_real(f"masses::{name}") for name in NAMES]
            simulation.terminate()


run("new", work / "masses-project", "--template", "spring")
scenario = next((work / "masses-project").rglob("*.toml"))
run("run", scenario, "--in-process", "--quiet", "--set", "duration=2 s", "--out", work / "masses")
run("fmu", "export", scenario, "--set", "duration=2 s", "--out", work / "masses.fmu")
check("libcosim", libcosim(work / "masses.fmu"))
check("Ecos", ecos(work / "masses.fmu"))
