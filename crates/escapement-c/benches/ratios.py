#!/usr/bin/env python3
"""The cost of C and C++ relative to Rust, as ratios measured side by side: crates/escapement-c/benches/ratios.py [ROUNDS]

An exchange of 27 doubles each way between two processes, recorded: that of `escapement bench` in Rust, and the same in C and C++, are run
in turn. Prints the minimum and the median of the rounds. Needs cargo build --release --workspace and a compiler, but no Python packages.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

from ring import exchange

HERE = pathlib.Path(__file__).resolve().parent
BUILT = HERE.parents[2] / "target" / "release"
STEPS = 100_000
SEATS = {"first": "ESCAPEMENT_CONTINUOUS", "second": "ESCAPEMENT_SAMPLED"}
LANGUAGES = {"C": ("relay.c", ["cc", "-std=c11", "-D_GNU_SOURCE"]), "C++": ("relay.cpp", ["c++", "-std=c++17"])}


def told(command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


def programs(folder):
    """The programs of each language, by slot."""
    told([HERE.parent / "install.sh", folder / "prefix", BUILT])
    settings = {**os.environ, "PKG_CONFIG_PATH": str(folder / "prefix" / "lib" / "pkgconfig")}
    flags = told(["pkg-config", "--cflags", "--libs", "escapement"], env=settings).split()
    made = {}
    for language, (source, compiler) in LANGUAGES.items():
        for seat, kind in SEATS.items():
            program = folder / f"{source}-{seat}"
            told([*compiler, "-O2", f"-DRELAY_KIND={kind}", HERE / source, "-o", program, *flags])
            made.setdefault(language, {})[seat] = f'{{ exe = "{program}" }}'
    return made


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        ways = {"Rust": {}, **programs(folder)}
        times = {name: [] for name in ways}
        for _ in range(rounds):
            for name, seats in ways.items():
                times[name].append(exchange(BUILT / "escapement", folder, seats, STEPS))
        for what, pick in (("least", min), ("median", lambda all_of: sorted(all_of)[rounds // 2])):
            rust = pick(times["Rust"])
            others = (f"{pick(all_of):.2f} µs in {name} ({pick(all_of) / rust:.2f} times)" for name, all_of in times.items() if name != "Rust")
            print(f"exchange of 27 doubles, {what}: {rust:.2f} µs in Rust, {', '.join(others)}")


if __name__ == "__main__":
    main()
