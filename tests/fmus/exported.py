"""Exported FMUs in FMPy: validated, simulated, saved, rolled back and misused; every sample is compared with the tape, bit for bit.

    exported.py ORCHESTRATOR FOLDER
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

orchestrator, work = sys.argv[1], Path(sys.argv[2])
TYPES = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "u64": "<u8", "u32": "<u4", "u8": "u1"}


def run(*arguments, codes=(0, 3)):
    result = subprocess.run([orchestrator, *map(str, arguments)], capture_output=True, text=True)
    assert result.returncode in codes, (arguments, result)
    return result.stdout


def stream(folder, name):
    """The samples of a stream: stamps, and the payload's fields."""
    index = json.loads((folder / "tape" / "index.json").read_text())
    spec = next(one for one in index["streams"] if one["file"] == f"{name}.bin")
    fields = [(one["name"], TYPES[one["element"]], tuple(one["shape"])) for one in spec["descriptor"]["fields"]]
    return numpy.fromfile(folder / "tape" / f"{name}.bin", dtype=[("t", "<f8"), ("payload", fields)])


class Driver:
    """An FMU, driven call by call."""

    def __init__(self, file, start=0.0, values={}):
        self.description = read_model_description(str(file))
        self.version = int(self.description.fmiVersion[0])
        arguments = dict(
            guid=self.description.guid,
            unzipDirectory=extract(str(file)),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="driven",
        )
        self.references = {one.name: (one.valueReference, one.type) for one in self.description.modelVariables}
        self.messages = []
        if self.version == 2:
            self.fmu = FMU2Slave(**arguments)
            self.fmu.instantiate()
            self.fmu.setupExperiment(startTime=start)
        else:
            self.fmu = FMU3Slave(**arguments)
            self.fmu.instantiate()
        for name, value in values.items():
            self.set(name, value)
        if self.version == 2:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start)
        self.fmu.exitInitializationMode()

    def names(self, name, count):
        return [name] if self.version == 3 or not count else [f"{name}[{number}]" for number in range(count)]

    def call(self, what, name, *rest, **more):
        kind = self.references[name][1]
        return getattr(self.fmu, what + kind)([self.references[name][0]], *rest, **more)

    def get(self, name, shape=()):
        count = int(numpy.prod(shape))
        if self.version == 3:
            return self.call("get", name, nValues=count) if shape else self.call("get", name)
        return [self.call("get", one)[0] for one in self.names(name, count if shape else 0)]

    def set(self, name, value):
        values = numpy.ravel(value).tolist()
        if self.version == 3:
            return self.call("set", name, values)
        names = self.names(name, len(values) if numpy.ndim(value) else 0)
        for one, number in zip(names, values):
            self.call("set", one, [number])

    def step(self, t, span):
        return self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=span)

    def port(self, port, payload):
        for field in payload.dtype.names:
            self.set(f"{port}.{field}", payload[field])

    def compare(self, port, payload, t):
        for field in payload.dtype.names:
            shape = payload.dtype[field].shape
            found = numpy.array(self.get(f"{port}.{field}", shape))
            expected = numpy.ravel(payload[field])
            assert found.astype("<f8").tobytes() == expected.astype("<f8").tobytes(), (port, field, t, found, expected)

    def free(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


def export(out, scenario, *more):
    run("fmu", "export", scenario, "--out", out, *more)
    problems = validate_fmu(str(out))
    assert not problems, (out, problems)
    return out


def participant(folder, scenario, name, fmi, inputs, outputs, period, connections):
    """Feeds a participant what it was fed in the run, and compares what it gives out."""
    file = export(work / f"{name}-{fmi}.fmu", scenario, "--participant", name, "--fmi", fmi)
    given = {port: stream(folder, f"{name}.{port}") for port in outputs}
    taken = {port: stream(folder, connections[port]) for port in inputs}
    driver = Driver(file)
    count = min(len(one) for one in given.values())
    state, saved_at = None, count // 3
    k = 0
    back = False
    while k < count - 1:
        t = k * period
        if k % 7 == 3:
            # Inputs that are taken back after outputs were read: nothing of them stays.
            for port, samples in taken.items():
                driver.port(port, samples["payload"][-1])
            for port, samples in given.items():
                for field in samples["payload"].dtype.names:
                    driver.get(f"{port}.{field}", samples["payload"].dtype[field].shape)
        for port, samples in taken.items():
            # Without delay: the newest sample at t.
            at = numpy.searchsorted(samples["t"], t + 1e-9) - 1
            if at >= 0:
                driver.port(port, samples["payload"][at])
        for port, samples in given.items():
            driver.compare(port, samples["payload"][k], t)
        if k == saved_at and state is None:
            if driver.version == 2:
                kept = driver.fmu.getFMUstate()
                state = driver.fmu.serializeFMUstate(kept)
                driver.fmu.freeFMUstate(kept)
            else:
                kept = driver.fmu.getFMUState()
                state = driver.fmu.serializeFMUState(kept)
                driver.fmu.freeFMUState(kept)
        driver.step(t, period)
        k += 1
        if k == 2 * saved_at and not back:
            # Another instance goes on from there.
            back = True
            driver.free()
            driver = Driver(file)
            if driver.version == 2:
                kept = driver.fmu.deSerializeFMUstate(state)
                driver.fmu.setFMUstate(kept)
            else:
                kept = driver.fmu.deserializeFMUState(state)
                driver.fmu.setFMUState(kept)
            k = saved_at
    driver.free()
    print(f"  {name}, FMI {fmi}: {count} samples of {', '.join(outputs)}")
    return file


def misuse(file):
    driver = Driver(file)
    span = float(driver.description.defaultExperiment.stepSize)
    first = next(one for one in driver.description.modelVariables if one.causality == "input" and one.type in ("Real", "Float64"))
    name, bad = first.name, [float("nan")] * int(numpy.prod(first.shape or 1))
    kind = driver.references[name][1]
    for what, call in {
        "a step of one and a half": lambda: driver.step(0.0, 1.5 * span),
        "a step of nothing": lambda: driver.step(0.0, 0.0),
        "NaN": lambda: driver.call("set", name, bad),
    }.items():
        try:
            call()
        except Exception as error:
            assert "2" in str(error) or "discard" in str(error).lower(), (what, error)
        else:
            raise AssertionError(f"{what} was taken")
    # A step that was discarded leaves it as it was.
    driver.step(0.0, span)
    try:
        getattr(driver.fmu, "set" + kind)([99999], [1.0])
    except Exception:
        pass
    else:
        raise AssertionError("an unknown variable was set")
    driver.fmu.reset()
    driver.fmu.freeInstance()


def spring():
    """Two masses, each in its own FMU, simulated by FMPy alone: nothing feeds them."""
    folder = work / "spring"
    run("new", work / "spring-project", "--template", "spring")
    scenario = next((work / "spring-project").rglob("*.toml"))
    run("run", scenario, "--in-process", "--quiet", "--out", folder)
    return scenario, folder


def whole(scenario, folder, names, duration):
    """The scenario as one FMU: FMPy's own loop gives the samples of the run."""
    for fmi in ("2", "3"):
        file = export(work / f"whole-{fmi}.fmu", scenario, "--fmi", fmi, "--set", f"duration={duration} s")
        step = float(read_model_description(str(file)).defaultExperiment.stepSize)
        result = simulate_fmu(str(file), stop_time=duration, output_interval=step, step_size=step)
        for name in names:
            samples = stream(folder, name)
            samples = samples[samples["t"] <= duration + 1e-9]
            compared = 0
            for field in samples["payload"].dtype.names:
                values = samples["payload"][field]
                columns = [values] if values.ndim == 1 else [values[:, i] for i in range(values.shape[1])]
                for number, column in enumerate(columns):
                    key = f"{name}.{field}" if values.ndim == 1 else f"{name}.{field}[{number}]"
                    if key in result.dtype.names:
                        found = result[key]
                    else:
                        found = result[f"{name}.{field}"][:, number]
                    at = numpy.searchsorted(samples["t"], result["time"] + 1e-9) - 1
                    assert found.tobytes() == numpy.ascontiguousarray(column[at]).tobytes(), (key, fmi)
                    compared += len(found)
            print(f"  whole scenario, FMI {fmi}: {compared} values of {name}")


def main():
    close = work / "close"
    run("run", "scenarios/close.toml", "--in-process", "--quiet", "--duration", "1 s", "--out", close,
        "--set", "participants.guidance.parameters.schedule.start=50 ms")
    for fmi in ("2", "3"):
        plant = participant(close, "scenarios/close.toml", "plant", fmi, ["command"], ["measured", "target"], 1e-3,
                            {"command": "controller.command"})
        misuse(plant)
        participant(close, "scenarios/close.toml", "controller", fmi, ["measured", "setpoint"], ["command"], 1e-2,
                    {"measured": "plant.measured", "setpoint": "guidance.setpoint"})
    scenario, folder = spring()
    whole(scenario, folder, ["left.motion", "right.motion"], 2.0)


main()
