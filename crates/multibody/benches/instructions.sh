#!/bin/bash
# Counts the instructions of each algorithm on the stock servicer (callgrind, so no noise) and compares them with the
# limits in instructions.txt: fails when one is more than 3 % above. With --record, writes what it counts as the limits;
# do that with the change that explains it.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
command -v valgrind > /dev/null || { echo "instructions.sh needs valgrind (Debian: apt-get install valgrind)" >&2; exit 2; }
bench=$(cd "$here" && cargo bench -q -p multibody --bench dynamics --no-run --message-format=json | grep -o '"executable":"[^"]*/dynamics-[^"]*"' | tail -1 | cut -d'"' -f4)
states=64
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --collect-atstart=no --toggle-collect='dynamics::counted*' \
        "$bench" --count "$1" 2>&1 | sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}
status=0
recorded=
while read -r limit name; do
    found=$(($(count "$name") / states))
    recorded+="$found $name"$'\n'
    if [ "${1:-}" != --record ] && [ $((found * 100)) -gt $((limit * 103)) ]; then
        echo "$name: $found instructions a state, the limit is $limit (+ 3 %)"
        status=1
    else
        echo "$name: $found instructions a state"
    fi
done < "$here/instructions.txt"
[ "${1:-}" != --record ] || printf '%s' "$recorded" > "$here/instructions.txt"
exit $status
