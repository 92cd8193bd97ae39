#!/usr/bin/env bash
# What a step of two coupled FMUs with 27 variables each way costs: as bare calls, in one process and in two of ours, in libcosim, in Ecos and
# called one by one from Python with FMPy. All of it side by side in one run, as ratios. No test: figures are those of the machine.
#
#     crates/fmu/benches/compare.sh [ESCAPEMENT]       ROUNDS=9 (how often all are measured, in turn)
#
# Needs a C compiler, python3 with venv, and libtbb12 for Ecos. Installs Python packages into a folder that it removes.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
escapement=$(realpath "${1:-$here/../../../target/release/escapement}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python=${PYTHON:-}
if [ -z "$python" ]; then
    python3 -m venv "$work/venv"
    python=$work/venv/bin/python
    "$python" -m pip install --quiet ecospy==0.7.2 fmpy==0.3.32 libcosimpy==0.0.6
fi
cc -O2 -shared -fPIC -o "$work/exchange.so" "$here/exchange.c" -lm
cp "$work/exchange.so" "$work/exchange-two.so"
cc -O2 -o "$work/bare" "$here/bare.c" -ldl
"$python" "$here/compare.py" "$escapement" "$work" "${ROUNDS:-9}"
