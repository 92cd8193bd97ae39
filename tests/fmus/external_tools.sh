#!/usr/bin/env bash
# FMUs of other tools in our runs, and ours in other tools: FMPy validates and drives what `fmu export` makes, libcosim and Ecos step it, and
# the FMUs of OpenModelica, PythonFMU and PythonFMU3 take part in runs, and libcosim and we run one system structure.
#
#     tests/fmus/external_tools.sh [ORCHESTRATOR]
#
# Installs the Python packages of requirements.txt into a folder that it removes. Nothing of them is kept in this project.
set -euo pipefail
cd "$(dirname "$0")/../.."
orchestrator=$(realpath "${1:-target/release/escapement}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python=python3
# Ecos needs it, and embedded Python its library.
if ! ldconfig -p | grep -q libtbb.so.12 || ! ldconfig -p | grep -q libpython3; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends libtbb12 libpython3-dev
fi
if ! "$python" -c "import ecospy, fmpy, libcosimpy, pythonfmu, pythonfmu3" 2>/dev/null; then
    "$python" -m venv "$work/venv"
    python=$work/venv/bin/python
    "$python" -m pip install --quiet -r tests/fmus/requirements.txt
fi
# Of this package only the FMUs are of interest: without what it needs to run.
"$python" -m pip download --quiet --no-deps --dest "$work" gemseo-fmu==3.1.1
"$python" -m zipfile --extract "$work"/gemseo_fmu-*.whl "$work/gemseo"

echo "FMUs in"
"$python" tests/fmus/imported.py "$orchestrator" "$work" "$work/gemseo/gemseo_fmu/problems/fmu_files/linux"
echo "Systems in"
"$python" tests/fmus/systems.py "$orchestrator" "$work"
echo "FMUs out"
"$python" tests/fmus/exported.py "$orchestrator" "$work"
"$python" tests/fmus/clients.py "$orchestrator" "$work"
