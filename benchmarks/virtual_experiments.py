"""Acceptance of the inversion on virtual experiments: prediction, honest standard errors, speed.

For every bundled paint the protocol of ``scripts/make_bundled_experiment.py`` is run many times, each time with
noise of its own (1 % of the intensity on I, Q, U and 5 % on V). Camera positions 1 and 2 are fitted, position 3 is
predicted. All runs of a paint are searched from all starts in one batch, with the draft accuracy; the best end of
each run is then refined. Checked:

* DoLP at position 3: standard deviation of the error over its 21 points, at most 0.028 in every run;
* intensity and DoLP at the strongest specular point of position 3: relative error at most 3 % in every run, for
  samples 2 to 5; sample 1, whose lobe is 0.34° wide, is shown apart;
* σ, n and k: each within three of its standard errors of the truth in at least 99 % of the runs;
* five bundled experiments fitted from 64 starts each, stepwise with polish, warm: less than 3 s on two cores. Wall
  time counts; processor time stands beside it, because wall time means little on a machine with other work.

"Error" can be that of the prediction against the truth, or against one noisy measurement, as in a laboratory,
where the truth is not known. Both are shown. The standard deviation of the DoLP is checked against the
measurement, the larger of the two. The strongest point is checked against the truth: the noise of a single
measurement (1 % of I and some 1.8 % of the DoLP there) alone passes 3 % in about one run of ten.

Usage: ``python benchmarks/virtual_experiments.py [--runs 100] [--starts 16] [--rounds 5] [--json FILE]``.
Status 1 if a target is missed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.backend import thread_count
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import solve
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.statistics import covariance, prior_spread

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
from make_bundled_experiment import NOISE

#: Largest standard deviation of the DoLP error, largest relative error at the strongest specular point (the paper's
#: figures for its sample 3), smallest share of runs within three standard errors, and seconds.
DOLP_STD, SPECULAR_ERROR, COVERAGE, SECONDS = 0.028, 0.03, 0.99, 3.0
CHECKED = ("sigma", "n", "k")
#: Its lobe is narrower than the step of the angles, so that the target for the strongest point leaves it out.
APART = "white"


@dataclass(frozen=True)
class Outcome:
    """Results of all runs of one paint.

    ``..._truth`` compares the prediction with the noiseless model, ``..._measured`` with the noisy position 3. Largest
    values are over the runs, shares over the runs too.
    """

    paint: str
    runs: int
    missed: int
    dolp_std_truth: float
    dolp_std_measured: float
    intensity_truth: float
    intensity_measured: float
    dolp_truth: float
    dolp_measured: float
    share_truth_within: float
    share_measured_within: float
    coverage: dict[str, float]
    coverage_together: float
    seconds: float


def problem(paint: str) -> tuple[Space, Observations]:
    """The problem that ``pbrdf.fit`` states for the bundled experiment, and its data at all positions."""
    dataset = pbrdf.open_experiment(paint)
    space = pbrdf.fit(dataset, hold_out="group=3", starts=1).space
    return space, Observations.from_dataset(dataset)


def noisy(data: Observations, truth: np.ndarray, rng: np.random.Generator) -> Observations:
    """One run: the truth, shape (4, G), with noise of its own."""
    std = np.stack([NOISE[c] * truth[0] for c in data.channels])
    return replace(data, values=truth + std * rng.standard_normal(truth.shape), std=std)


def fit_runs(
    space: Space, runs: list[Observations], starts: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Parameters and standard errors, shape (R, P), χ², shape (R,), and seconds."""
    low, high = space.box
    first = np.tile(sobol_starts(low, high, starts, seed), (len(runs), 1))
    clock = time.perf_counter()
    search = solve(residuals(space, runs, starts, accuracy="draft"), first, low, high, tolerance=1e-6)
    cost = np.where(np.isfinite(search.cost), search.cost, np.inf).reshape(len(runs), starts)
    best = np.arange(len(runs)) * starts + cost.argmin(axis=1)
    solution = solve(residuals(space, runs), search.u[best], low, high)
    seconds = time.perf_counter() - clock
    values = space.to_parameters(solution.u)
    prior = prior_spread(low, high)
    error = np.sqrt([np.diag(covariance(information, prior)) for information in solution.information])
    return values, error * space.derivative(values), 2.0 * solution.cost, seconds


def experiments(paint: str, count: int, starts: int, seed: int) -> Outcome:
    """Run, fit and predict ``count`` virtual experiments of a paint."""
    space, data = problem(paint)
    third = np.asarray(data.group) == 3
    truth = pbrdf.load_paint(paint).stokes(data.theta_i, data.theta_r, data.phi).T
    rng = np.random.default_rng([seed, list(pbrdf.PAINTS).index(paint)])
    everything = [noisy(data, truth, rng) for _ in range(count)]
    fitted = [run.subset(~third) for run in everything]
    values, error, chi2, seconds = fit_runs(space, fitted, starts, seed)

    # the true parameters fit too: a higher χ² than theirs means that the search has missed the optimum
    at_truth = [(((r.values - truth[:, ~third]) / r.std) ** 2).sum() for r in fitted]
    maps = {name: values[:, i, None] for i, name in enumerate(space.names)}
    position = data.subset(third)
    model = pbrdf.DoubleGauss.from_values({**space.fixed, **maps})
    predicted = np.moveaxis(model.stokes(position.theta_i, position.theta_r, position.phi), -1, 1)
    measured = np.stack([run.values[:, third] for run in everything])
    true = np.broadcast_to(truth[:, third], measured.shape)

    def dolp(stokes: np.ndarray) -> np.ndarray:
        return np.hypot(stokes[:, 1], stokes[:, 2]) / stokes[:, 0]

    def at_peak(reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Relative errors of intensity and DoLP at the brightest point, shape (R,)."""
        peak = reference[:, 0].argmax(axis=1)[:, None]
        errors = []
        for found, expected in ((predicted[:, 0], reference[:, 0]), (dolp(predicted), dolp(reference))):
            errors.append(
                np.take_along_axis(found, peak, 1)[:, 0] / np.take_along_axis(expected, peak, 1)[:, 0] - 1.0
            )
        return np.abs(errors[0]), np.abs(errors[1])

    paint_values = pbrdf.load_paint(paint).values
    expected = np.array([float(paint_values[name]) for name in space.names])
    within = np.abs(values - expected) <= 3.0 * error
    checked = [space.names.index(name) for name in CHECKED]
    (i_true, p_true), (i_measured, p_measured) = at_peak(true), at_peak(measured)
    return Outcome(
        paint=paint,
        runs=count,
        missed=int((chi2 > np.array(at_truth)).sum()),
        dolp_std_truth=float((dolp(predicted) - dolp(true)).std(axis=1).max()),
        dolp_std_measured=float((dolp(predicted) - dolp(measured)).std(axis=1).max()),
        intensity_truth=float(i_true.max()),
        intensity_measured=float(i_measured.max()),
        dolp_truth=float(p_true.max()),
        dolp_measured=float(p_measured.max()),
        share_truth_within=float(((i_true <= SPECULAR_ERROR) & (p_true <= SPECULAR_ERROR)).mean()),
        share_measured_within=float(((i_measured <= SPECULAR_ERROR) & (p_measured <= SPECULAR_ERROR)).mean()),
        coverage={name: float(within[:, i].mean()) for name, i in zip(CHECKED, checked, strict=True)},
        coverage_together=float(within[:, checked].all(axis=1).mean()),
        seconds=seconds,
    )


def fit_times(rounds: int) -> tuple[dict[str, float], dict[str, float]]:
    """Wall and processor seconds for five paints from 64 starts each, smallest of the rounds, warm, by strategy."""
    datasets = [pbrdf.open_experiment(paint) for paint in pbrdf.PAINTS]
    strategies = ("joint", "stepwise")
    wall: dict[str, list[float]] = {strategy: [] for strategy in strategies}
    processor: dict[str, list[float]] = {strategy: [] for strategy in strategies}
    for number in range(rounds + 1):
        for strategy in strategies:
            clock, used = time.perf_counter(), time.process_time()
            for dataset in datasets:
                pbrdf.fit(dataset, hold_out="group=3", strategy=strategy, starts=64)
            if number:  # the first round loads or compiles the kernels
                wall[strategy].append(time.perf_counter() - clock)
                processor[strategy].append(time.process_time() - used)
    return {s: min(wall[s]) for s in strategies}, {s: min(processor[s]) for s in strategies}


def checks(outcomes: list[Outcome], times: dict[str, float]) -> dict[str, bool]:
    """Targets by name, and whether they are met."""
    others = [o for o in outcomes if o.paint != APART]
    return {
        f"DoLP at position 3, samples 2-5: standard deviation ≤ {DOLP_STD} against the measurement": all(
            o.dolp_std_measured <= DOLP_STD for o in others
        ),
        f"strongest specular point, samples 2-5: error ≤ {SPECULAR_ERROR:.0%} against the truth": all(
            max(o.intensity_truth, o.dolp_truth) <= SPECULAR_ERROR for o in others
        ),
        f"each of {', '.join(CHECKED)} within 3 standard errors in ≥ {COVERAGE:.0%} of runs": all(
            share >= COVERAGE for o in outcomes for share in o.coverage.values()
        ),
        "no run missed its optimum": all(o.missed == 0 for o in outcomes),
        f"five paints from 64 starts, stepwise with polish: < {SECONDS:g} s": times["stepwise"] < SECONDS,
    }


def show(
    outcomes: list[Outcome], times: dict[str, float], processor: dict[str, float], met: dict[str, bool]
) -> None:
    """Print everything."""
    console = Console()
    prediction = Table(title=f"Position 3 predicted, worst of {outcomes[0].runs} runs a paint")
    for heading in ("", "against", "DoLP std", "I at peak", "DoLP at peak", f"≤ {SPECULAR_ERROR:.0%}"):
        prediction.add_column(heading, justify="left" if heading in ("", "against") else "right")
    parameters = Table(title="Runs within three standard errors")
    for heading in ("", *CHECKED, "all three", "seconds a run"):
        parameters.add_column(heading, justify="right" if heading else "left")
    for o in outcomes:
        prediction.add_row(
            o.paint,
            "truth",
            f"{o.dolp_std_truth:.4f}",
            f"{o.intensity_truth:.2%}",
            f"{o.dolp_truth:.2%}",
            f"{o.share_truth_within:.0%}",
        )
        prediction.add_row(
            "",
            "measurement",
            f"{o.dolp_std_measured:.4f}",
            f"{o.intensity_measured:.2%}",
            f"{o.dolp_measured:.2%}",
            f"{o.share_measured_within:.0%}",
        )
        shares = [f"{share:.1%}" for share in (*o.coverage.values(), o.coverage_together)]
        parameters.add_row(o.paint, *shares, f"{o.seconds / o.runs:.4f}")
    console.print(prediction)
    console.print(parameters)
    used = ", ".join(f"{k} {v:.2f} s (processor {processor[k]:.2f} s)" for k, v in times.items())
    console.print(f"five paints from 64 starts, {thread_count()} threads: {used}")
    for name, passed in met.items():
        console.print(f"{'[green]pass' if passed else '[red]FAIL'}[/] {name}")


def main() -> int:
    """Run everything, print it, and return 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--runs", type=int, default=100, help="virtual experiments a paint")
    parser.add_argument("--starts", type=int, default=16, help="starts of each run")
    parser.add_argument("--rounds", type=int, default=5, help="rounds of the timing")
    parser.add_argument("--seed", type=int, default=1, help="seed of the noise and of the starts")
    parser.add_argument("--json", type=Path, help="write the numbers there")
    options = parser.parse_args()
    outcomes = [experiments(paint, options.runs, options.starts, options.seed) for paint in pbrdf.PAINTS]
    times, processor = fit_times(options.rounds)
    met = checks(outcomes, times)
    show(outcomes, times, processor, met)
    if options.json:
        content = {
            "outcomes": [asdict(o) for o in outcomes],
            "seconds": times,
            "processor_seconds": processor,
            "targets": met,
        }
        options.json.write_text(json.dumps(content, indent=2, ensure_ascii=False))
    return 0 if all(met.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
