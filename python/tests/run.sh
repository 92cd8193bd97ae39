#!/usr/bin/env bash
# Installs the package as its users do, into an environment of its own, and tests what was installed. The project is built already
# (cargo build --release --workspace): only the module is compiled here, on what is there.
#
#     python/tests/run.sh [ARGUMENTS OF PYTEST]
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=$PWD/target/python
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --upgrade pip
ESCAPEMENT=$PWD/target/release/escapement "$venv/bin/python" -m pip install --quiet './python[frames,gym]' 'pytest>=8'
# Not from the sources: what is tested is what was installed.
unset ESCAPEMENT PYTHONPATH
"$venv/bin/python" -m pytest --quiet -p no:cacheprovider python/tests "$@"
