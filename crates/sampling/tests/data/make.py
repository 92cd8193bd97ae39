"""Numbers of SciPy that the tests of this package compare with, and the table of direction numbers.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install scipy==1.17.1
    /tmp/venv/bin/python crates/sampling/tests/data/make.py

writes `crates/sampling/tests/data/scipy.json` and `crates/sampling/src/design/joe_kuo.rs`.
"""

import glob
import json
import os

import numpy as np
import scipy
from scipy import stats
from scipy.stats import qmc

here = os.path.dirname(os.path.abspath(__file__))

u = [1e-300, 1e-100, 1e-16, 1e-6, 0.001, 0.02, 0.25, 0.4999, 0.5, 0.51, 0.75, 0.98, 0.999, 1 - 1e-6, 1 - 2.0**-53]
cases = {
    "uniform": stats.uniform(-2, 5),
    "normal": stats.norm(3, 0.5),
    "truncated": stats.truncnorm((2 - 3) / 0.5, (3.2 - 3) / 0.5, 3, 0.5),
    "upper-tail": stats.truncnorm(6, 9, 0, 1),
    "log-normal": stats.lognorm(0.3, scale=2),
    "triangular": stats.triang((2 - 1) / (6 - 1), 1, 5),
}
quantiles = {"u": u, "standard": list(stats.norm.ppf(u))}
for name, case in cases.items():
    quantiles[name] = list(case.ppf(u[3:-1]))

sobol = qmc.Sobol(d=32, scramble=False).random(64)
first = qmc.Sobol(d=5, scramble=False).random(256)
rng = np.random.default_rng(1)
x = np.round(rng.normal(size=40), 1)
y = np.round(x**3 + rng.normal(size=40), 1)

ranks = []
for n in [1, 5, 10, 59, 200, 2000, 100_000]:
    for part in [0.01, 0.05, 0.5, 0.9, 0.95, 0.99]:
        law = stats.binom(n, part)
        k = np.arange(0, n + 1)
        low = int(np.sum(law.cdf(k) <= 0.025))
        above = law.sf(k - 1)
        good = np.nonzero(above <= 0.025)[0]
        ranks.append([n, part, min(low, n), max(int(good[0]), 1) if len(good) else n + 1])

with open(os.path.join(here, "scipy.json"), "w") as file:
    json.dump(
        {
            "scipy": scipy.__version__,
            "quantiles": quantiles,
            "sobol": [[int(value * 2**32) for value in row] for row in sobol],
            "discrepancy": {
                "sobol-256-5": qmc.discrepancy(first, method="CD"),
                "random-256-5": float(
                    np.mean([qmc.discrepancy(rng.random((256, 5)), method="CD") for _ in range(20)])
                ),
                "scrambled-256-5": max(
                    qmc.discrepancy(qmc.Sobol(d=5, rng=seed).random(256), method="CD") for seed in range(20)
                ),
            },
            "spearman": {"x": list(x), "y": list(y), "rho": float(stats.spearmanr(x, y).statistic)},
            "ranks": ranks,
        },
        file,
        indent=1,
    )
    file.write("\n")

DIMENSIONS = 128
numbers = np.load(glob.glob(os.path.join(os.path.dirname(scipy.__file__), "stats/*sobol*npz"))[0])
flat = []
for dimension in range(1, DIMENSIONS):
    polynomial = int(numbers["poly"][dimension])
    flat += [polynomial] + [int(value) for value in numbers["vinit"][dimension, : polynomial.bit_length() - 1]]
lines, line = [], "   "
for value in flat:
    if len(line) + len(f" {value},") > 120:
        lines.append(line)
        line = "   "
    line += f" {value},"
lines.append(line)
with open(os.path.join(here, "../../src/design/joe_kuo.rs"), "w") as file:
    file.write(f"""//! Direction numbers of Sobol' sequences.
//!
//! S. Joe and F. Y. Kuo, Constructing Sobol sequences with better two-dimensional projections, SIAM J. Sci. Comput. 30 (2008),
//! the set new-joe-kuo-6.21201 as SciPy {scipy.__version__} (BSD-3-Clause) carries it. Written by `tests/data/make.py`.

/// How many dimensions there are, with the first, which needs no numbers.
pub const DIMENSIONS: usize = {DIMENSIONS};

/// For each dimension from the second on: its primitive polynomial as bits, the highest power first, and as many initial
/// numbers as its degree.
#[rustfmt::skip]
pub(super) const NUMBERS: [u16; {len(flat)}] = [
""" + "\n".join(lines) + "\n];\n")
