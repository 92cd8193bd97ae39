#!/usr/bin/env bash
# Checks a run with the tools of its user: exports read back by the tools' own packages, the report opened in a real browser,
# and a run in progress followed in it. Where Rerun is installed (`pip install rerun-sdk`) it makes and reads its recording too.
#
#     tests/external_tools.sh [ORCHESTRATOR [SCREENSHOTS]]
#
# A check that fails does not keep the others from running. Installs what is missing: Chromium with its driver (Debian packages) and the Python packages of the requirements.txt files.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/steps.sh
orchestrator=${1:-target/release/escapement}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if ! command -v chromium >/dev/null || ! command -v chromedriver >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium chromium-driver
fi
python=python3
if ! "$python" -c "import mcap_protobuf, numpy, pandas, pyarrow, scipy, selenium" 2>/dev/null; then
    "$python" -m venv "$work/venv"
    python=$work/venv/bin/python
    "$python" -m pip install --quiet -r tests/exports/requirements.txt -r tests/pages/requirements.txt
fi

"$orchestrator" run scenarios/close.toml --in-process --quiet --out "$work/close"
# A second run to lay over the first: the same capture with a slower controller. Whether it succeeds does not matter here.
"$orchestrator" run scenarios/close.toml --in-process --quiet --set participants.controller.period=20ms --out "$work/slower" || [ $? -eq 3 ]
# And two whose momenta follow other laws: the propellant on a ball joint, and the target held by the gripper.
"$orchestrator" run scenarios/close.toml --in-process --quiet --set 'participants.plant.parameters.slosh="spherical"' --out "$work/spherical"
"$orchestrator" run scenarios/capture-and-stabilise.toml --in-process --quiet --duration "34 s" --out "$work/grasped" || [ $? -eq 3 ]
step "exports" "$python" tests/exports/check_exports.py "$orchestrator" "$work/close"
step "measures" "$python" tests/measures/check_measures.py "$orchestrator"
step "report" "$python" tests/pages/check_report.py "$orchestrator" "$work/close" "$work/slower" --bodies "$work/spherical" --bodies "$work/grasped" ${2:+--screenshots "$2"}
step "report of any run" "$python" tests/pages/check_any.py "$orchestrator" "$(dirname "$orchestrator")/lander" ${2:+--screenshots "$2"}
# The scene of participants in Python needs the package: that of python/tests/run.sh, or one that is installed here.
packaged=$PWD/target/python/bin/python
if ! "$packaged" -c "import escapement" 2>/dev/null; then
    "$python" -m venv "$work/packaged"
    packaged=$work/packaged/bin/python
    ESCAPEMENT=$(realpath "$orchestrator") "$packaged" -m pip install --quiet ./python
fi
step "scenes" "$python" tests/pages/check_scene.py "$orchestrator" "$(dirname "$orchestrator")/lander" --python "$packaged" ${2:+--screenshots "$2"}
step "cases" "$python" tests/pages/check_cases.py "$orchestrator" ${2:+--screenshots "$2"}
step "live page" "$python" tests/pages/check_live.py "$orchestrator" ${2:+--screenshots "$2"}

# A participant in Python takes the place of one in Rust, and the tape stays the same: docs/protocol.md is enough.
foreign_participant() {
    if ! "$python" -c "import iceoryx2" 2>/dev/null; then
        "$python" -m venv "$work/foreign"
        python=$work/foreign/bin/python
        "$python" -m pip install --quiet -r tests/protocol/requirements.txt
    fi
    "$orchestrator" run examples/spring/spring.toml --quiet --out "$work/rust"
    in_python="participants.right.run={ exe = \"$(command -v "$python")\", args = [\"../../tests/protocol/spring.py\"] }"
    "$orchestrator" run examples/spring/spring.toml --quiet --out "$work/python" --set "$in_python"
    "$orchestrator" compare "$work/rust" "$work/python"
    # Random delays and drops too. Whether they meet the criterion of the scenario is irrelevant here.
    late=(--set connections.to-right.jitter=7ms --set connections.to-left.drop=0.2 --set connections.to-left.hold=initial)
    "$orchestrator" run examples/spring/spring.toml --quiet --out "$work/rust-late" "${late[@]}" || [ $? -eq 3 ]
    "$orchestrator" run examples/spring/spring.toml --quiet --out "$work/python-late" "${late[@]}" --set "$in_python" || [ $? -eq 3 ]
    "$orchestrator" compare "$work/rust-late" "$work/python-late"
    # The program rejects what it does not support.
    for more in 'connections.to-right.map="by-name"' 'connections.to-left.hold="linear"'; do
        output=$("$orchestrator" run examples/spring/spring.toml --quiet --out "$work/refused-${#more}" --set "$more" --set "$in_python" 2>&1) && return 1
        grep -q "which this program does not do" <<< "$output"
    done
}
step "participant in Python" foreign_participant

step "FMUs in other tools, and FMUs of other tools in runs" tests/fmus/external_tools.sh "$orchestrator"

failed_steps
