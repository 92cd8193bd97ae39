"""Two FMUs feed each other 27 variables each way: what a step costs, in several tools in turn.

    compare.py ESCAPEMENT FOLDER ROUNDS
"""

import os
import resource
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from statistics import median

from ecospy import EcosSimulation, EcosSimulationStructure
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimSlave import CosimLocalSlave

escapement, work, rounds = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
COUNT, STEP = 27, 1e-3
# Few enough that a round takes a second or so in each of them.
BARE, OURS, THEIRS, PYTHON = 2_000_000, 100_000, 50_000, 10_000
# How much an FMU does itself in a step, where the question is what share of it the rest is.
ROOTS = (0, 50, 200, 500, 1000)


class Clock:
    """Wall time and processor time since it was made: of this process, or of those that it waited for."""

    def __init__(self, children=False):
        self.children = children
        self.begin = self.now()

    def now(self):
        used = resource.getrusage(resource.RUSAGE_CHILDREN if self.children else resource.RUSAGE_SELF)
        return time.perf_counter(), used.ru_utime + used.ru_stime

    def spent(self, steps):
        return [(end - begin) / steps for begin, end in zip(self.begin, self.now())]


def fmu():
    variables = "".join(
        f'<ScalarVariable name="{name}{number}" valueReference="{first + number}" causality="{causality}" {more}>'
        f"<Real {start}/></ScalarVariable>"
        for first, name, causality, more, start in [
            (0, "u", "input", 'variability="continuous"', 'start="0"'),
            (COUNT, "y", "output", 'variability="continuous" initial="exact"', 'start="0"'),
        ]
        for number in range(COUNT)
    )
    outputs = "".join(f'<Unknown index="{COUNT + number + 1}" dependencies=""/>' for number in range(COUNT))
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="exchange" guid="{exchange}">'
        '<CoSimulation modelIdentifier="exchange" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" '
        f'canSerializeFMUstate="true"/><ModelVariables>{variables}</ModelVariables>'
        f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
    )
    path = work / "exchange.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(work / "exchange.so", "binaries/linux64/exchange.so")
    return path


FMU = fmu()
OTHER = work / "exchange-other.fmu"
OTHER.write_bytes(FMU.read_bytes())


def bare(steps=BARE):
    said = subprocess.run(
        [work / "bare", work / "exchange.so", work / "exchange-two.so", str(steps)], check=True, capture_output=True, text=True
    )
    wall, processor, _ = map(float, said.stdout.split())
    return [wall / steps, processor / steps]


def scenario():
    pairs = "\n".join(f'u{number} = "y{number}"' for number in range(COUNT))
    parts = "".join(f'[participants.{name}]\nperiod = "1 ms"\nrun.fmu = "exchange.fmu"\n' for name in ("one", "two"))
    links = "".join(
        f'[connections.{a}-{b}]\nfrom = "{a}.outputs"\nto = "{b}.inputs"\n[connections.{a}-{b}.map]\n{pairs}\n'
        for a, b in (("one", "two"), ("two", "one"))
    )
    (work / "exchange.toml").write_text('duration = "1 s"\n' + parts + links)
    return work / "exchange.toml"


def ours(*more):
    """The time of many steps less that of few: without start and end."""

    def run(steps):
        out = Path("/dev/shm") / f"escapement-compare-{steps}"
        clock = Clock(children=True)
        subprocess.run(
            [escapement, "run", scenario(), "--quiet", "--duration", f"{steps} ms", "--out", out, "--force", *more], check=True
        )
        spent = clock.spent(1)
        subprocess.run(["rm", "-rf", out], check=True)
        return spent

    few = OURS // 10
    return [(many - less) / (OURS - few) for many, less in zip(run(OURS), run(few))]


def libcosim():
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(step_size=int(STEP * 1e9))
    numbers = [execution.add_local_slave(local_slave=CosimLocalSlave(fmu_path=str(one), instance_name=name)) for one, name in ((FMU, "one"), (OTHER, "two"))]
    for source, target in (numbers, numbers[::-1]):
        for number in range(COUNT):
            execution.connect_real_variables(
                output_slave_index=source, output_variable_reference=COUNT + number, input_slave_index=target, input_variable_reference=number
            )
    execution.step()
    clock = Clock()
    execution.step(step_count=THEIRS)
    return clock.spent(THEIRS)


def ecos():
    with EcosSimulationStructure() as structure:
        structure.add_model("one", str(FMU))
        structure.add_model("two", str(OTHER))
        for source, target in (("one", "two"), ("two", "one")):
            for number in range(COUNT):
                structure.make_real_connection(f"{source}::y{number}", f"{target}::u{number}")
        with EcosSimulation(structure=structure, step_size=STEP) as simulation:
            simulation.init()
            simulation.step()
            clock = Clock()
            simulation.step(THEIRS)
            spent = clock.spent(THEIRS)
            simulation.terminate()
    return spent


def fmpy():
    models = []
    for name, file in (("one", FMU), ("two", OTHER)):
        description = read_model_description(str(file))
        model = FMU2Slave(guid=description.guid, unzipDirectory=extract(str(file)), modelIdentifier="exchange", instanceName=name)
        model.instantiate()
        model.setupExperiment(startTime=0.0)
        model.enterInitializationMode()
        model.exitInitializationMode()
        models.append(model)
    one, two = models
    inputs, outputs = list(range(COUNT)), list(range(COUNT, 2 * COUNT))
    clock = Clock()
    for step in range(PYTHON):
        a, b = one.getReal(outputs), two.getReal(outputs)
        two.setReal(inputs, a)
        one.setReal(inputs, b)
        for model in models:
            model.doStep(currentCommunicationPoint=step * STEP, communicationStepSize=STEP)
    spent = clock.spent(PYTHON)
    for model in models:
        model.terminate()
        model.freeInstance()
    return spent


TOOLS = {
    "bare calls": bare,
    "ours, one process": lambda: ours("--in-process"),
    "ours, a process each": ours,
    "libcosim, one process": libcosim,
    "Ecos, one process": ecos,
    "FMPy, called from Python": fmpy,
}
measured = {name: [] for name in TOOLS}
for _ in range(rounds):
    for name, measure in TOOLS.items():
        measured[name].append([seconds * 1e6 for seconds in measure()])
print(f"two FMUs, {COUNT} variables each way, a step of both; {rounds} rounds: least, median and largest, µs, and medians of ratios")
for kind, title in enumerate(["wall time", "processor time of all processes"]):
    print(title)
    for name, rows in measured.items():
        own = [row[kind] for row in rows]
        beside = [
            median(one / other[kind] for one, other in zip(own, measured[reference])) for reference in ("bare calls", "ours, one process")
        ]
        figures = f"{min(own):9.3f} {median(own):9.3f} {max(own):9.3f}"
        print(f"  {name:<26} {figures}   {beside[0]:8.2f} times bare calls {beside[1]:8.2f} times ours in one process")

print("the same where a step of an FMU works itself: processor time of a step of both, least, µs, and the median of ratios")
for roots in ROOTS:
    os.environ["EXCHANGE_WORK"] = str(roots)
    pairs = [(bare(OURS)[1] * 1e6, ours("--in-process")[1] * 1e6) for _ in range(rounds)]
    own, whole = (min(column) for column in zip(*pairs))
    ratio = median(with_us / alone for alone, with_us in pairs)
    print(f"  {roots:5} roots: bare calls {own:8.3f}   ours, one process {whole:8.3f}   {ratio:6.2f} times bare calls")
