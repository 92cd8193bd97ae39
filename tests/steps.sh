# Steps that are independent of each other. Sourced by .ci/run and tests/external_tools.sh.
#
#     step NAME COMMAND…      runs the command or function, whatever the result of the steps before
#     failed_steps            prints the steps that failed, and fails if there are any

steps_failed=()

step() {
    local name=$1 code
    shift
    printf '\n== %s (%d s)\n' "$name" "$SECONDS"
    # As a condition the command would run without `set -e`, and a function would continue after its first error.
    set +e
    (
        set -euo pipefail
        "$@"
    )
    code=$?
    set -e
    if [ "$code" -ne 0 ]; then
        printf '== %s: FAILED (exit code %d)\n' "$name" "$code"
        steps_failed+=("$name")
    fi
}

failed_steps() {
    if [ "${#steps_failed[@]}" -gt 0 ]; then
        printf 'failed: %s\n' "${steps_failed[@]}"
        return 1
    fi
}
