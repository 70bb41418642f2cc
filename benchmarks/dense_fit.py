"""A dense table fitted with the search on part of it, against one on all in one kernel: processor time and result.

Both run in this process, one after the other, with the same starts; the first call of each compiles its kernels, which
is part of its time. Ends with status 1 if the part takes more than a tenth of all, or the results differ.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

import pbrdf
from pbrdf.inversion import solver, thinning

#: What the search on part of the table may take of the time of one on all.
AIM = 0.1


def table(rows: int):
    """Intensities of a paint in random directions, to 3 %."""
    paint = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.5, k=1.1, b=0.1, t=0.6)
    rng = np.random.default_rng(0)
    theta_i = np.deg2rad(rng.choice([15.0, 30.0, 45.0, 60.0], rows))
    theta_r, phi = np.deg2rad(rng.uniform(0.0, 80.0, rows)), rng.uniform(-np.pi, np.pi, rows)
    exact = paint.stokes(theta_i, theta_r, phi)[:, 0]
    noisy = exact * (1.0 + 0.03 * rng.standard_normal(rows))
    return pbrdf.make_dataset(theta_i, theta_r, phi, quantity="brdf", I=noisy, std={"I": 0.03 * exact})


def timed(dataset, starts: int):
    began = time.process_time()
    result = pbrdf.fit(dataset, starts=starts)
    return result, time.process_time() - began


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=20_000)
    parser.add_argument("--starts", type=int, default=64)
    given = parser.parse_args()
    dataset = table(given.rows)
    part, short = timed(dataset, given.starts)
    print(f"search on part: {short:.1f} s of processor time, χ² {part.goodness.chi2:.6f}", flush=True)
    # every start searches all geometries, each start in one lane, the whole search in one kernel
    thinning.WORTH_IT = solver.SLICE = sys.maxsize
    solver.LAUNCH = 1000 * given.rows * given.starts
    everything, long = timed(dataset, given.starts)
    print(f"search on all:  {long:.1f} s of processor time, χ² {everything.goodness.chi2:.6f}")
    print(f"ratio {short / long:.3f} (aim {AIM})")
    same = abs(part.goodness.chi2 / everything.goodness.chi2 - 1.0) < 1e-6
    return 0 if same and short <= AIM * long else 1


if __name__ == "__main__":
    sys.exit(main())
