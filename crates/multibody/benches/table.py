"""Prints the ratio table from two files of JSON lines {"what": ..., "ns": [...]}, Pinocchio's and ours."""
import json
import sys


def read(path):
    samples = {}
    for line in open(path):
        record = json.loads(line)
        samples.setdefault(record["what"], []).extend(record["ns"])
    return {what: sorted(ns)[len(ns) // 20] for what, ns in samples.items()}


pinocchio, ours = read(sys.argv[1]), read(sys.argv[2])
rows = [  # ours, Pinocchio's, the acceptance limit
    ("aba", "aba", 0.45),
    ("rnea", "rnea", 0.47),
    ("crba", "crba", 0.60),
    ("M+C+J", "M+C+J", 0.60),
    ("M a + C nu_r", "M+C", 0.15),
    ("rk4 step", "rk4 step", 0.45),
    ("aba, 4 lanes", "aba", 0.12),
    ("aba, 8 lanes", "aba", 0.10),  # only on processors with AVX-512
]
print(f"{'ours':16}{'ns':>9}   {'Pinocchio':12}{'ns':>9}   {'ratio':>6}   {'limit':>5}")
missed = 0
for mine, theirs, limit in rows:
    if mine not in ours:
        continue
    ratio = ours[mine] / pinocchio[theirs]
    missed += ratio > limit
    print(f"{mine:16}{ours[mine]:9.1f}   {theirs:12}{pinocchio[theirs]:9.1f}   {ratio:6.3f}   {limit:5.2f}{'  MISSED' if ratio > limit else ''}")
sys.exit(1 if missed else 0)
