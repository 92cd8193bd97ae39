#!/usr/bin/env bash
# Campaigns on real engines, all on this machine: GNU parallel, Slurm with two nodes, HyperQueue with two workers. Each gives the table of
# one machine, byte for byte, also after a node was lost and shards were killed.
#
#     tests/engines.sh [ORCHESTRATOR]
#
# Installs what is missing (Debian packages, a Python package in an environment of its own), as root, and stops every daemon that it has started,
# whatever happens. A check that fails does not keep the others from running.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/steps.sh
escapement=$(realpath "${1:-target/release/escapement}")
work=$(mktemp -d)
chmod 755 "$work"

# Daemons by their process ids, in a file because each step is a process: nothing else is ever stopped.
register_daemon() { echo "$1" >>"$work/daemons"; }
touch "$work/daemons"
stop() {
    local pid waited=0
    for pid in $(cat "$work/daemons"); do kill "$pid" 2>/dev/null || true; done
    for pid in $(cat "$work/daemons"); do
        while kill -0 "$pid" 2>/dev/null && [ $waited -lt 50 ]; do
            sleep 0.1
            waited=$((waited + 1))
        done
        kill -9 "$pid" 2>/dev/null || true
    done
    rm -rf "$work"
}
trap stop EXIT

missing=()
command -v parallel >/dev/null || missing+=(parallel)
command -v slurmctld >/dev/null || missing+=(slurmctld)
command -v slurmd >/dev/null || missing+=(slurmd)
command -v sbatch >/dev/null || missing+=(slurm-client)
command -v munged >/dev/null || missing+=(munge)
if [ ${#missing[@]} -gt 0 ]; then
    apt-get update -qq
    # A package must not start its daemon here.
    printf '#!/bin/sh\nexit 101\n' >"$work/policy"
    chmod +x "$work/policy"
    POLICYRCD="$work/policy" DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi
python=$work/venv
python3 -m venv "$python"
"$python/bin/python" -m pip install --quiet -r tests/engines/requirements.txt

# Two systems that share nothing: the capture, and two masses that are in the program itself.
"$escapement" new "$work/project" --template spring >/dev/null
# With digests, which an audit has too: the tables of one machine and of an engine are the same to the last byte.
capture=(sweep scenarios/close.toml --digest --duration "300 ms" --vary connections.measured.delay=0ms..30ms:10ms --vary participants.controller.period=10ms,20ms)
spring=(sweep "$work/project/spring.toml" --digest --vary connections.to-right.delay=0ms..110ms:10ms)

assert_same_tables() {
    local file
    for file in table.csv table.parquet figure.svg figure.png; do
        cmp "$1/$file" "$2/$file"
    done
}

# Polls the status of a campaign until it is complete.
wait_until_complete() {
    local waited=0
    until "$escapement" sweep status "$1" >"$work/status"; do
        waited=$((waited + 1))
        if [ $waited -gt 300 ]; then
            cat "$work/status"
            return 1
        fi
        sleep 0.2
    done
}

"$escapement" "${capture[@]}" --quiet --out "$work/one-capture"
"$escapement" "${spring[@]}" --quiet --out "$work/one-spring"

on_shell() {
    local out=$work/shell
    "$escapement" "${capture[@]}" --on shell --shards 4 --audit 10% --out "$out" >"$work/lines"
    [ "$(wc -l <"$work/lines")" -eq 4 ]
    parallel --jobs 2 <"$work/lines"
    # All is there: the same command makes the table.
    "$escapement" "${capture[@]}" --on shell --audit 10% --quiet --out "$out"
    assert_same_tables "$out" "$work/one-capture"
}
step "GNU parallel" on_shell

node() {
    slurmd -D -N "$1" 2>>"$work/slurm/slurmd-$1.err" &
    echo $! >"$work/slurm/$1.pid"
    register_daemon $!
}

start_slurm() {
    local slurm=$work/slurm host
    host=$(hostname -s)
    mkdir -p "$slurm"/{state,log,run}
    chmod 755 "$slurm" "$slurm"/*
    head -c 1024 /dev/urandom >"$slurm/munge.key"
    chmod 400 "$slurm/munge.key"
    munged --force --foreground --key-file="$slurm/munge.key" --socket="$slurm/run/munge.socket" --pid-file="$slurm/run/munged.pid" \
        --log-file="$slurm/log/munged.log" --seed-file="$slurm/run/seed" --num-threads=2 >/dev/null 2>&1 &
    register_daemon $!
    cat >"$slurm/slurm.conf" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$slurm/run/munge.socket
SlurmctldPort=16817
StateSaveLocation=$slurm/state
SlurmdSpoolDir=$slurm/spool-%n
SlurmctldPidFile=$slurm/run/slurmctld.pid
SlurmdPidFile=$slurm/run/slurmd-%n.pid
SlurmctldLogFile=$slurm/log/slurmctld.log
SlurmdLogFile=$slurm/log/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MaxArraySize=3
SlurmdTimeout=5
MpiDefault=none
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=1 State=UNKNOWN
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=1 State=UNKNOWN
PartitionName=long Nodes=n1,n2 Default=NO MaxTime=INFINITE State=UP
END
    export SLURM_CONF=$slurm/slurm.conf
    local waited=0
    until [ -S "$slurm/run/munge.socket" ]; do sleep 0.1; done
    slurmctld -D -i >/dev/null 2>&1 &
    register_daemon $!
    node n1
    node n2
    until [ "$(sinfo --noheader --format='%D %t' 2>/dev/null)" = "2 idle" ]; do
        sleep 0.2
        waited=$((waited + 1))
        [ $waited -lt 150 ]
    done
    sbatch --version
}

# The processes that run shards of the campaign in $1 on node $2.
on_node() {
    local lock
    for lock in "$1"/shards/*/lock; do
        if grep -q "\"node\":\"$2\"" "$lock" 2>/dev/null && ! flock --nonblock "$lock" true; then
            sed 's/.*"pid":\([0-9]*\).*/\1/' "$lock"
        fi
    done
}

# Slurm takes at most three tasks in an array here, so eight shards are three jobs.
on_slurm() {
    local out=$work/on-slurm pid waited=0
    start_slurm
    run() { "$escapement" "${capture[@]}" --on slurm --audit 10% --out "$out" "$@"; }
    run --shards 8 --engine-args '--partition=long --time=5' | tee "$work/output"
    grep -q "slurm-wlm .*: 8 shards given in jobs .*, .*, " "$work/output"
    # Points are missing yet.
    if "$escapement" sweep status "$out" --json >"$work/output"; then return 1; fi
    grep -q '"engine":"slurm"' "$work/output"
    # Part of what waits is cancelled, and a node is lost with all that runs on it.
    scancel --state=PENDING 3
    until [ -n "$(on_node "$out" n2)" ] || [ $waited -gt 100 ]; do
        sleep 0.05
        waited=$((waited + 1))
    done
    kill -9 "$(cat "$work/slurm/n2.pid")"
    for pid in $(on_node "$out" n2); do kill -9 "$pid" || true; done
    # Slurm gives what ran there to the other node; what was cancelled is missing.
    waited=0
    until [ -z "$(squeue --noheader)" ]; do
        sleep 0.2
        waited=$((waited + 1))
        [ $waited -lt 300 ]
    done
    if "$escapement" sweep status "$out"; then return 1; fi
    # The same command gives what is missing once more.
    run --engine-args '--partition=long --time=5' | tee "$work/output"
    wait_until_complete "$out" || { cat "$out"/log/*; return 1; }
    run --quiet
    assert_same_tables "$out" "$work/one-capture"
    # An option that the cluster does not have is one error.
    if "$escapement" "${spring[@]}" --on slurm --shards 2 --engine-args --partition=nowhere --out "$work/refused" 2>"$work/output"; then
        return 1
    fi
    cat "$work/output"
    [ "$(grep -c error: "$work/output")" -eq 1 ]
    grep -q "sbatch refuses the job: .*partition" "$work/output"
}
step "Slurm" on_slurm

on_hyperqueue() {
    local out=$work/on-hyperqueue
    export PATH=$python/bin:$PATH HQ_SERVER_DIR=$work/hyperqueue
    mkdir "$HQ_SERVER_DIR"
    python3 tests/engines/local_cluster.py "$HQ_SERVER_DIR" 2 >/dev/null &
    register_daemon $!
    until [ -e "$HQ_SERVER_DIR/hq-current/access.json" ]; do sleep 0.1; done
    run() { "$escapement" "${spring[@]}" --on hyperqueue --audit 20% --out "$out" "$@"; }
    run --shards 4 --engine-args '--cpus=1' | tee "$work/output"
    grep -q "hyperqueue v0.27.0: 4 shards given" "$work/output"
    wait_until_complete "$out"
    # A shard whose folder is lost is missing, and given once more.
    rm -r "$out/shards/2-of-4"
    run | tee "$work/output"
    grep -q "1 shards given" "$work/output"
    wait_until_complete "$out"
    run --quiet
    assert_same_tables "$out" "$work/one-spring"
    # A server that is not there is one error.
    if "$escapement" "${spring[@]}" --on hyperqueue --engine-args --server-dir=/nowhere --out "$work/no" 2>"$work/output"; then
        return 1
    fi
    cat "$work/output"
    [ "$(grep -c error: "$work/output")" -eq 1 ]
    grep -q "is its server up" "$work/output"
}
step "HyperQueue" on_hyperqueue

failed_steps
