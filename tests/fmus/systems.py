"""A system structure (SSP) in libcosim and here: each step gives the same values, to the last bit.

    systems.py ORCHESTRATOR FOLDER
"""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

orchestrator, work = sys.argv[1], Path(sys.argv[2])
REFERENCE = Path("tests/fmus/reference/fmi2")
PERIOD, STEPS = 0.01, 150
# What both can do: no nested systems, no units, no mappings.
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0" name="flat"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssd:System name="root">
    <ssd:Elements>
      <ssd:Component name="ball" source="resources/ball.fmu">
        <ssd:Connectors>
          <ssd:Connector name="h" kind="output"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="v" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
          <ssv:ParameterSet version="1.0" name="soft"><ssv:Parameters>
            <ssv:Parameter name="e"><ssv:Real value="0.6"/></ssv:Parameter>
          </ssv:Parameters></ssv:ParameterSet>
        </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
      </ssd:Component>
      <ssd:Component name="gauge" source="resources/gauge.fmu">
        <ssd:Connectors>
          <ssd:Connector name="Float64_continuous_input" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="Float64_discrete_input" kind="input"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="ball" startConnector="h" endElement="gauge" endConnector="Float64_continuous_input">
        <ssc:LinearTransformation factor="3" offset="2"/>
      </ssd:Connection>
      <ssd:Connection startElement="ball" startConnector="v" endElement="gauge" endConnector="Float64_discrete_input"
        suppressUnitConversion="true"/>
    </ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="2"/>
</ssd:SystemStructureDescription>
"""
FMUS = {"ball": REFERENCE / "BouncingBall.fmu", "gauge": REFERENCE / "Feedthrough.fmu"}
NAMES = {"ball": ["h", "v"], "gauge": ["Float64_continuous_output", "Float64_discrete_output"]}


def run(*arguments):
    subprocess.run([orchestrator, *map(str, arguments)], check=True, capture_output=True)


package = work / "flat.ssp"
with zipfile.ZipFile(package, "w", zipfile.ZIP_DEFLATED) as archive:
    archive.writestr("SystemStructure.ssd", DESCRIPTION)
    for name, file in FMUS.items():
        archive.write(file, f"resources/{name}.fmu")
run("import", package, "--period", f"{PERIOD} s", "--out", work / "flat")
run("run", work / "flat" / "scenario.toml", "--quiet", "--out", work / "flat-run")

log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_ssp_file(str(package), step_size=int(PERIOD * 1e9))
observer = CosimObserver.create_last_value()
execution.add_observer(observer=observer)
numbers = {one.name.decode() if isinstance(one.name, bytes) else one.name: one.index for one in execution.slave_infos()}
references = {
    name: {one.name: one.valueReference for one in read_model_description(str(file)).modelVariables} for name, file in FMUS.items()
}
samples = {}
for name in FMUS:
    floats = [one for one in references[name] if one.startswith("Float64") and one.endswith("output")] if name == "gauge" else ["h", "v"]
    stream = (work / "flat-run" / "tape" / f"{name}.outputs.bin").read_bytes()
    stride = len(stream) // (round(2 / PERIOD) + 1)
    table = numpy.frombuffer(stream, dtype=numpy.uint8).reshape(-1, stride)
    # The stamp, then the fields; doubles come first.
    samples[name] = {field: table[:, 8 + 8 * at : 16 + 8 * at].copy().view("<f8").ravel() for at, field in enumerate(floats)}
for step in range(1, STEPS + 1):
    execution.step()
    for name, fields in NAMES.items():
        found = observer.last_real_values(numbers[name], [references[name][field] for field in fields])
        for field, value in zip(fields, found):
            assert value == samples[name][field][step], (name, field, step, value, samples[name][field][step])
print(f"  libcosim: {STEPS} steps of a system, to the last bit")
