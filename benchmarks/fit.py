"""Fitting thousands of data sets at once, against SciPy fitting one after the other.

Each data set is a virtual in-plane measurement of one paint (camera positions 1 and 2 of the bundled experiment, 42
geometries; I, Q and U with 1 % noise of their own). All fits start from the same rough guess. pbrdf solves
them in one batch; SciPy's ``least_squares`` (trust-region reflective, bounded) takes the same weighted
residuals, computed

* by the NumPy implementation of ``peers/double_gauss_numpy.py`` with SciPy's finite differences, and
* by pbrdf's own ``stokes`` with SciPy's finite differences.

The peer is whichever is faster. Both must end at the same optimum, and the script checks it. The numbers depend
on the machine; what counts is the ratio in one run.

Usage: ``python benchmarks/fit.py [--count 4096] [--scipy 20] [--json FILE]``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

import pbrdf
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import solve

sys.path.insert(0, str(Path(__file__).parent))
from peers import double_gauss_numpy as numpy_peer

PAINT = "matte-white-thick"
NAMES = ("sigma", "n", "a", "k", "b", "t")
GUESS = np.array([0.05, 1.5, 1.2, 1.0, 0.0, 0.5])
AIM = 200.0


def measurements(count: int) -> list[Observations]:
    """Data sets with noise of their own."""
    experiment = pbrdf.open_experiment(PAINT)
    first = experiment.isel(geometry=np.flatnonzero(experiment["group"].values < 3))
    angles = [first[name].values for name in ("theta_i", "theta_r", "phi")]
    stokes = pbrdf.load_paint(PAINT).stokes(*angles)[:, :3].T
    std = np.broadcast_to(0.01 * stokes[0], stokes.shape)
    rng = np.random.default_rng(1)
    return [
        Observations(
            *angles,
            ("I", "Q", "U"),
            stokes + std * rng.standard_normal(stokes.shape),
            std,
            (1.0, 0.0, 0.0, 0.0),
            True,
        )
        for _ in range(count)
    ]


def space() -> Space:
    """The six parameters of a dielectric coating with their default bounds."""
    free = tuple(p for p in pbrdf.DoubleGauss.parameters if p.name in NAMES)
    lower, upper = (np.array([getattr(p, which) for p in free]) for which in ("lower", "upper"))
    return Space(pbrdf.DoubleGauss, {}, free, {"kappa": 0.0}, lower, upper)


def fit_batch(data: list[Observations]) -> tuple[float, np.ndarray]:
    """Seconds and parameters (B, 6) of one batched solution."""
    problem = space()
    low, high = problem.box
    start = np.tile(problem.to_unknowns(GUESS), (len(data), 1))
    clock = time.perf_counter()
    solution = solve(residuals(problem, data), start, low, high)
    seconds = time.perf_counter() - clock
    assert solution.converged.all(), f"{(~solution.converged).sum()} fits did not converge"
    return seconds, problem.to_parameters(solution.u)


def fit_scipy(data: list[Observations], stokes) -> tuple[float, np.ndarray]:
    """Seconds and parameters (N, 6) of SciPy's fits, one after the other."""
    box = space()
    found = []
    clock = time.perf_counter()
    for observed in data:

        def residual(x, observed=observed):
            modelled = stokes(x, observed.theta_i, observed.theta_r, observed.phi)
            return ((modelled.T - observed.values) / observed.std).ravel()

        found.append(
            least_squares(residual, GUESS, bounds=(box.lower, box.upper), x_scale=np.abs(GUESS) + 0.1).x
        )
    return time.perf_counter() - clock, np.array(found)


def by_numpy(x, theta_i, theta_r, phi):
    """I, Q, U by the NumPy peer."""
    from evaluation import default_rule

    return numpy_peer.mueller(theta_i, theta_r, phi, numpy_peer.Paint(*x), default_rule())[:, :3, 0]


def by_pbrdf(x, theta_i, theta_r, phi):
    """I, Q, U by pbrdf."""
    return pbrdf.DoubleGauss(*x).stokes(theta_i, theta_r, phi)[:, :3]


def main() -> int:
    """Run, print a table, and fail if the optima differ."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=4096, help="data sets fitted in the batch")
    parser.add_argument("--scipy", type=int, default=20, help="of them fitted by SciPy too")
    parser.add_argument("--json", type=Path, help="write the numbers there")
    options = parser.parse_args()
    data = measurements(options.count)
    few = data[: options.scipy]
    cold, _ = fit_batch(data)
    by_numpy(GUESS, few[0].theta_i, few[0].theta_r, few[0].phi)
    by_pbrdf(GUESS, few[0].theta_i, few[0].theta_r, few[0].phi)
    # interleaved, so that a change of the machine's speed touches all alike
    times: dict[str, list[float]] = {"batch": [], "SciPy on NumPy": [], "SciPy on pbrdf": []}
    for _ in range(3):
        seconds, ours = fit_batch(data)
        times["batch"].append(seconds / len(data))
        for name, stokes in (("SciPy on NumPy", by_numpy), ("SciPy on pbrdf", by_pbrdf)):
            seconds, theirs = fit_scipy(few, stokes)
            times[name].append(seconds / len(few))
            scale = np.abs(ours[: len(few)]) + 0.1
            difference = np.abs(theirs - ours[: len(few)]) / scale
            # SciPy's default tolerance (1e-8 on the cost) leaves its parameters this uncertain
            if difference.max() > 1e-4:
                print(f"{name} ended elsewhere: {difference.max():.1e}", file=sys.stderr)
                return 1
    best = {name: min(values) for name, values in times.items()}
    ratio = min(best["SciPy on NumPy"], best["SciPy on pbrdf"]) / best["batch"]
    table = Table(title=f"{options.count} fits of 6 parameters to 42 geometries x (I, Q, U)")
    for heading in ("", "ms a fit", "times the batch"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, seconds in best.items():
        table.add_row(name, f"{1e3 * seconds:.3f}", f"{seconds / best['batch']:.0f}")
    console = Console()
    console.print(table)
    console.print(
        f"batch: {1.0 / best['batch']:.0f} fits/s; first call, kernels compiled or loaded: {cold:.2f} s"
    )
    console.print(f"ratio to the faster SciPy: {ratio:.0f} (aim: {AIM:.0f})")
    if options.json:
        options.json.write_text(
            json.dumps({"seconds_per_fit": best, "first_call": cold, "ratio": ratio}, indent=2)
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
