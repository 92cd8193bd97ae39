#!/bin/bash
# Counts the instructions (callgrind, so no noise) that `check`, `graph` and `run --in-process` take over generated scenarios, of a size and
# of four times that size: fails when four times as many participants and connections take more than 4.4 times the instructions.
#
#     tests/scale.sh [FACTOR [PROGRAM]]      FACTOR makes all scenarios that much larger: 4 comes to 512 participants with 10 000 connections
#
# Three kinds of scenario grow: `many`, with 20 connections into each participant, at different rates and delays; `apart`, where no two
# participants share an instant; `one`, where all connections end at one input.
set -euo pipefail
cd "$(dirname "$0")/.."
factor=${1:-1}
program=${2:-target/release/escapement}
command -v valgrind > /dev/null || { echo "scale.sh needs valgrind (Debian: apt-get install valgrind)" >&2; exit 2; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# scenario PARTICIPANTS CONNECTIONS KIND
scenario() {
    awk -v n="$1" -v c="$2" -v kind="$3" 'BEGIN {
        periods = split("1 ms,2 ms,5 ms,10 ms,2.5 ms", period, ",")
        delays = split("0 s,1 ms,10 ms,3.3 ms", delay, ",")
        print "duration = \"" (kind == "apart" ? 100 : 20) " ms\""
        for (i = 0; i < n; i++) {
            print "[participants.p" i "]\nrun = { builtin = \"spring\" }"
            print "period = \"" (kind == "apart" ? "5 ms" : period[i % periods + 1]) "\""
            if (kind == "apart" && i > 0) print "offset = \"" i "/" 200 * n " s\""
            print "parameters = { position = \"0.1 m\", mass = \"1 kg\", stiffness = \"40 N/m\", coupling = \"0.5 N/m\", damping = \"0 N s/m\" }"
        }
        for (k = 0; k < c; k++) {
            from = k % n
            to = kind == "one" ? 0 : (from + 1 + int(k / n)) % n
            print "[connections.c" k "]\nfrom = \"p" from ".motion\"\nto = \"p" to ".neighbour\""
            print "delay = \"" delay[k % delays + 1] "\""
            if (kind != "apart") print "map = { position = { from = \"position\", factor = 0.01 }, velocity = \"velocity\" }\nsum = true"
        }
        if (kind == "one") print "[connections.others]\nfrom = \"p0.motion\"\nto = [" others(n) "]"
    }
    function others(n,   text, i) {
        for (i = 1; i < n; i++) text = text (i > 1 ? ", " : "") "\"p" i ".neighbour\""
        return text
    }'
}

count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$@" 2>&1 > /dev/null | sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}

status=0
while read -r kind participants connections; do
    participants=$((participants * factor)) connections=$((connections * factor))
    scenario "$participants" "$connections" "$kind" > "$folder/small.toml"
    scenario $((4 * participants)) $((4 * connections)) "$kind" > "$folder/large.toml"
    for command in check graph run; do
        found=()
        for size in small large; do
            arguments=("$command" "$folder/$size.toml")
            [ "$command" = run ] && arguments+=(--in-process --quiet --out "$folder/run-$kind-$size")
            found+=("$(count "${arguments[@]}")")
        done
        [ -n "${found[0]}" ] && [ -n "${found[1]}" ] || { echo "$kind, $command: the program did not run"; status=1; continue; }
        ratio=$((found[1] * 100 / found[0]))
        printf '%s, %d participants, %d connections, %s: %d.%02d million instructions, %d.%02d times those of a quarter\n' "$kind" \
            $((4 * participants)) $((4 * connections)) "$command" $((found[1] / 1000000)) $((found[1] / 10000 % 100)) \
            $((ratio / 100)) $((ratio % 100))
        if [ "$ratio" -gt 440 ]; then
            echo "$kind, $command: more than 4.4 times the instructions for four times the scenario"
            status=1
        fi
    done
done << 'SIZES'
many 32 640
apart 128 128
one 2 128
SIZES
exit $status
