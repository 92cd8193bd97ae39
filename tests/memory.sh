#!/usr/bin/env bash
# Memory and undefined behaviour of the examples in C and C++, as programs and as plug-ins, with the compiler's sanitizers. (Valgrind
# cannot run the program that loads plug-ins: it changes the page size that the kernel reports.)
#
#     tests/memory.sh [FOLDER OF THE BUILT PROGRAMS]
#
# The project is built already (cargo build --release --workspace). The examples, their headers and the table of
# functions between them and the host are checked; a short run is enough, because every step does the same.
set -euo pipefail
cd "$(dirname "$0")/.."
built=$(realpath "${1:-target/release}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

crates/escapement-c/install.sh "$work/prefix" "$built"
export PKG_CONFIG_PATH=$work/prefix/lib/pkgconfig
flags=(-O1 -g -Wall -Wextra -Werror -fno-omit-frame-pointer)
sanitizers=(-fsanitize=address,undefined -fno-sanitize-recover=all)

program() {
    # The compiler with its standard, then the source.
    local compiler=("${@:1:$#-1}")
    # shellcheck disable=SC2046
    "${compiler[@]}" "${flags[@]}" "${sanitizers[@]}" "${@: -1}" -o "$work/program" $(pkg-config --cflags --libs escapement)
}

plugin() {
    local compiler=("${@:1:$#-2}")
    # shellcheck disable=SC2046
    "${compiler[@]}" "${flags[@]}" "${sanitizers[@]}" "${@: -2:1}" -o "$work/${*: -1}" $(pkg-config --cflags --libs escapement-plugin)
}

c=(cc -std=c11 -D_GNU_SOURCE)
cpp=(c++ -std=c++17)

# As programs: both masses of the spring, in processes of their own, with a checkpoint and resumed.
for source in examples/c/spring.c examples/cpp/spring.cpp; do
    case $source in
    *.c) program "${c[@]}" "$source" ;;
    *) program "${cpp[@]}" "$source" ;;
    esac
    overrides=()
    for slot in left right; do overrides+=(--set "participants.$slot.run={ exe = \"$work/program\" }"); done
    rm -rf "$work/run" "$work/again"
    "$built/escapement" run examples/spring/spring.toml --quiet --duration 1s --checkpoint-every 0.5s "${overrides[@]}" --out "$work/run" ||
        [ $? -eq 3 ]
    "$built/escapement" resume "$work/run" --from 0.5s --quiet --out "$work/again" || [ $? -eq 3 ]
    echo "$source: no error of the sanitizers"
done

# As plug-ins in one process.
plugin "${c[@]}" examples/c/spring.c libspring.so
plugin "${c[@]}" examples/c/crossing.c libcrossing.so
plugin "${cpp[@]}" examples/cpp/operator.cpp liboperator.so
# The sanitizer must be there before the program's own memory is; what the program keeps to its end is no leak of a plug-in.
checked() {
    LD_PRELOAD=$(cc -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0 "$@" || [ $? -eq 3 ]
}
checked "$built/escapement" run examples/spring/spring.toml --quiet --in-process --duration 1s \
    --set "participants.left.run={ library = \"$work/libspring.so\" }" \
    --set "participants.right.run={ library = \"$work/libspring.so\" }" --out "$work/springs"
checked "$built/escapement" run examples/c/crossing.toml --quiet --in-process --duration 60s \
    --set "participants.light.run={ library = \"$work/libcrossing.so\", participant = \"light\" }" \
    --set "participants.crowd.run={ library = \"$work/libcrossing.so\", participant = \"crowd\" }" --out "$work/crossing"
checked "$built/tank" run examples/tank/tank.toml --quiet --in-process --duration 5s \
    --set "participants.operator.run={ library = \"$work/liboperator.so\" }" --out "$work/tank"
echo "plug-ins in C and C++: no error of the sanitizers"
