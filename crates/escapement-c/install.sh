#!/usr/bin/env bash
# Installs headers, libraries, and what pkg-config and CMake look for.
#
#     crates/escapement-c/install.sh PREFIX [FOLDER]
#
# FOLDER holds libraries that are built already; without it they are built. The result may be moved as a whole.
set -euo pipefail
if [ $# -lt 1 ] || [ $# -gt 2 ] || [[ $1 == -* ]]; then
    echo "usage: $0 PREFIX [FOLDER]" >&2
    exit 2
fi
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
built=
[ $# -eq 1 ] || built=$(cd "$2" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")"
if [ -z "$built" ]; then
    cargo build --release --quiet -p escapement-c -p escapement-fmu
    built=$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release
fi
version=$(sed -n 's/^version = "\(.*\)"/\1/p' ../../Cargo.toml)
for library in libescapement_c.so libescapement_c.a libescapement_fmu.so; do
    if [ ! -f "$built/$library" ]; then
        echo "$0: $built/$library is not there: leave out FOLDER, and it is built" >&2
        exit 1
    fi
done
install -d "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/escapement"
install -m 644 include/escapement.h include/escapement.hpp include/escapement-run.h include/escapement-run.hpp "$prefix/include"
install -m 755 "$built/libescapement_c.so" "$prefix/lib/libescapement.so.1"
ln -sf libescapement.so.1 "$prefix/lib/libescapement.so"
install -m 644 "$built/libescapement_c.a" "$prefix/lib/libescapement.a"
# Where bin/escapement looks for it, and under the name by which programs that drive runs link it.
install -m 755 "$built/libescapement_fmu.so" "$prefix/lib/libescapement_fmu.so"
ln -sf libescapement_fmu.so "$prefix/lib/libescapement_run.so"
install -m 644 cmake/escapement-config.cmake "$prefix/lib/cmake/escapement"
for file in cmake/escapement-config-version.cmake; do
    sed "s/@VERSION@/$version/" "$file" >"$prefix/lib/cmake/escapement/$(basename "$file")"
done
for file in pkgconfig/escapement.pc pkgconfig/escapement-plugin.pc pkgconfig/escapement-run.pc; do
    sed "s/@VERSION@/$version/" "$file" >"$prefix/lib/$file"
done
echo "installed in $prefix: cc \$(PKG_CONFIG_PATH=$prefix/lib/pkgconfig pkg-config --cflags --libs escapement), or CMAKE_PREFIX_PATH=$prefix"
