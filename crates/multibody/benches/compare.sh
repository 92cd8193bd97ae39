#!/bin/bash
# Builds Pinocchio's side of the comparison and ours, runs them alternately on one core over the same 64 random states,
# and prints the ratios of the 5th percentiles of thread CPU time.
#
# usage: compare.sh [SCRATCH]     CORE=1 (which core), TURNS=8 (how often to alternate), ROUNDS=101 (rounds per turn)
#
# Needs python3.11 with venv and clang++-16 (Debian: clang-16). gcc makes Pinocchio's ABA some 1.6 times slower, which
# would flatter us. The first run takes a few minutes: it installs the `pin` wheel below SCRATCH and compiles against it.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
scratch=$(realpath -m "${1:-$here/../../../target/compare}")
mkdir -p "$scratch"
cd "$scratch"

[ -d v ] || { python3.11 -m venv v && v/bin/pip -q install pin==4.1.0; }
[ -d eig ] || { v/bin/pip -q download --no-deps -d w cmeel-eigen==3.4.1 && mkdir eig && v/bin/python -m zipfile -e w/*.whl eig; }
prefix=$(v/bin/python -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')/cmeel.prefix
defines="-DNDEBUG -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_FUSION_INVOKE_MAX_ARITY=12"
if [ ! -x bench_pin ] || [ "$here/pinocchio/bench_pin.cpp" -nt bench_pin ]; then
    clang++-16 -Wno-enum-constexpr-conversion -std=c++17 -O3 -march=native $defines -I"$prefix/include" \
        -I"$scratch/eig/cmeel.prefix/include/eigen3" -I"$here/pinocchio" "$here/pinocchio/bench_pin.cpp" -o bench_pin \
        -L"$prefix/lib" -Wl,-rpath,"$prefix/lib"
fi
ours=$(cd "$here" && cargo bench -q -p multibody --bench dynamics --no-run --message-format=json |
    "$scratch/v/bin/python" "$here/executable.py" dynamics)
model=$here/pinocchio/servicer.txt
./bench_pin "$model" --states > states.txt

: > pinocchio.jsonl
: > ours.jsonl
for _ in $(seq "${TURNS:-8}"); do
    taskset -c "${CORE:-1}" ./bench_pin "$model" "${ROUNDS:-101}" >> pinocchio.jsonl
    taskset -c "${CORE:-1}" "$ours" states.txt "${ROUNDS:-101}" >> ours.jsonl
done
v/bin/python "$here/table.py" pinocchio.jsonl ours.jsonl
