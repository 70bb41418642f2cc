"""What a direction costs against how many there are, and a fit against starts, geometries and parameters.

    python benchmarks/curves.py [--output FOLDER] [--format svg|png] [--rounds R] [--quick]

Writes ``curves.svg`` and ``curves.json`` into the folder. Four panels, both axes logarithmic:

* nanoseconds a direction of ``mueller()`` (double precision, NumPy arrays in and out) against 10² … 10⁷ directions, for
  the bundled matte white paint and for σ = 0.1, to 1.3 rad of zenith angle;
* milliseconds of ``pbrdf.fit`` against the number of starts, of geometries (I, Q, U each, 64 starts), and of free
  parameters: 1 … 6 of the paint's, then a body of its own (a, k, b, t) for each of 2, 4 and 8 groups of 42 geometries.

Times are medians of warm calls in rounds over all sizes; bars reach from the lower to the upper quartile.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from evaluation import PAINT, random_geometries
from machine import processor
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from rich.console import Console

import pbrdf
from pbrdf.backend import llvm_version, thread_count

#: Free parameters in the order in which they are let go.
FREED = ("a", "n", "sigma", "k", "t", "b")
Measured = dict[str, dict[int, Callable[[], Any]]]


def directions(largest: int) -> Measured:
    """Calls of ``mueller`` by paint and number of directions."""
    counts = [10**power for power in range(2, 8) if 10**power <= largest]
    models = {
        "matte white, σ = 0.04": pbrdf.DoubleGauss(**PAINT._asdict()),
        "σ = 0.1": pbrdf.DoubleGauss(**PAINT._replace(sigma=0.1)._asdict()),
    }

    def call(model: Any, count: int) -> Callable[[], Any]:
        angles = random_geometries(count, 1.3)
        return lambda: model.mueller(*angles)

    return {name: {count: call(model, count) for count in counts} for name, model in models.items()}


def measured(count: int, groups: int = 1) -> Any:
    """A data set of ``count`` geometries a group, in the plane of incidence, (I, Q, U) with 1 % noise."""
    random = np.random.default_rng(5)
    model = pbrdf.DoubleGauss(**PAINT._asdict())
    per_group = -(-count // 6)
    theta_i = np.repeat(np.deg2rad([15.0, 25.0, 35.0, 45.0, 55.0, 65.0]), per_group)[:count]
    theta_r = np.tile(np.deg2rad(np.linspace(0.0, 75.0, per_group)), 6)[:count]
    angles = [np.tile(angle, groups) for angle in (theta_i, theta_r, np.zeros(count))]
    stokes = model.stokes(*angles)[:, :3]
    std = np.broadcast_to(0.01 * stokes[:, :1], stokes.shape)
    values = stokes + std * random.standard_normal(stokes.shape)
    columns = {name: values[:, i] for i, name in enumerate("IQU")}
    uncertainties = {name: std[:, i] for i, name in enumerate("IQU")}
    group = np.repeat(np.arange(groups), count)
    return pbrdf.make_dataset(*angles, quantity="brdf", **columns, std=uncertainties, group=group)


def fits(quick: bool) -> dict[str, Measured]:
    """Calls of ``fit`` by panel, curve and size."""
    few = measured(42)
    starts = [1, 4, 16, 64] if quick else [1, 4, 16, 64, 256, 1024, 4096]
    geometries = [42, 420] if quick else [42, 130, 420, 1300, 4200]
    groups = [2] if quick else [2, 4, 8]

    def fit(dataset: Any, **options: Any) -> Callable[[], Any]:
        return lambda: pbrdf.fit(dataset, **options)

    def fixed(kept: int) -> dict[str, float]:
        return {name: getattr(PAINT, name) for name in FREED[kept:]}

    split = dict.fromkeys(("a", "k", "b", "t"), "group")
    return {
        "starts": {"6 parameters, 42 geometries": {n: fit(few, starts=n) for n in starts}},
        "geometries": {"6 parameters, 64 starts": {n: fit(measured(n), starts=64) for n in geometries}},
        "free parameters": {
            "one group": {n: fit(few, starts=64, fix=fixed(n)) for n in range(1, 7)},
            "body of each group": {2 + 4 * g: fit(measured(42, g), starts=64, split=split) for g in groups},
        },
    }


def times(
    panels: dict[str, Measured], rounds: int, longest: float
) -> dict[str, dict[str, dict[int, list[float]]]]:
    """Seconds of every call in every round; a call that takes longer than ``longest`` seconds counts once."""
    seconds: dict[str, dict[str, dict[int, list[float]]]] = {
        panel: {curve: {size: [] for size in calls} for curve, calls in curves.items()}
        for panel, curves in panels.items()
    }
    for round_ in range(-1, rounds):
        for panel, curves in panels.items():
            for curve, calls in curves.items():
                for size, call in calls.items():
                    kept = seconds[panel][curve][size]
                    if kept and kept[0] > longest:
                        continue
                    start = time.perf_counter()
                    call()
                    taken = time.perf_counter() - start
                    # the first round compiles
                    if round_ >= 0:
                        kept.append(taken)
    return seconds


def draw(seconds: dict[str, dict[str, dict[int, list[float]]]]) -> Figure:
    """The figure of four panels."""
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    for ax, (panel, curves) in zip(axes, seconds.items(), strict=True):
        for number, (curve, sizes) in enumerate(curves.items()):
            x = np.array(list(sizes))
            scale = 1e9 / x if panel == "directions" else np.full(x.size, 1e3)
            low, middle, high = (
                np.array([np.percentile(t, [25.0, 50.0, 75.0]) for t in sizes.values()]).T * scale
            )
            ax.errorbar(
                x,
                middle,
                yerr=[middle - low, high - middle],
                marker="os"[number],
                markersize=4,
                capsize=2,
                label=curve,
            )
        if panel != "directions":
            # through a point in the middle of the last curve
            centre = x.size // 2
            ax.plot(x, middle[centre] * x / x[centre], ":", color="0.5", label="proportional")
        ax.set(xscale="log", yscale="log", xlabel=f"number of {panel}")
        ax.set_ylabel("time of a direction (ns)" if panel == "directions" else "time of a fit (ms)")
        ax.xaxis.set_minor_formatter(NullFormatter())
        if panel == "free parameters":
            ax.set_xticks([1, 2, 3, 4, 6, 10, 18, 34], labels=["1", "2", "3", "4", "6", "10", "18", "34"])
        ax.grid(True, which="major", color="0.9")
        ax.legend(frameon=False, fontsize=8)
    return figure


def main() -> int:
    """Measure, draw and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("curves"), help="folder (default ./curves)")
    parser.add_argument("--format", choices=("svg", "png"), default="svg")
    parser.add_argument("--rounds", type=int, default=5, help="rounds over all sizes (default 5)")
    parser.add_argument("--quick", action="store_true", help="small sizes, 2 rounds: does it run?")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error("--rounds must be at least 1")
    rounds = 2 if options.quick else options.rounds
    panels = {"directions": directions(10**4 if options.quick else 10**7), **fits(options.quick)}
    backend = pbrdf.get_backend()
    machine = {
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": thread_count(),
        "backend": backend.name,
        "llvm": ".".join(map(str, llvm_version() or ())) or "unknown",
        "python": platform.python_version(),
        "pbrdf": pbrdf.__version__,
    }
    seconds = times(panels, rounds, longest=3.0)
    options.output.mkdir(parents=True, exist_ok=True)
    figure = draw(seconds)
    figure.suptitle(f"{machine['processor']}, {machine['cores']} cores, {machine['backend']}", fontsize=9)
    picture = options.output / f"curves.{options.format}"
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "pbrdf"}):
        figure.savefig(picture, dpi=90, metadata={"Date": None} if options.format == "svg" else None)
    told = json.dumps({"machine": machine, "seconds": seconds}, indent=1, ensure_ascii=False)
    (options.output / "curves.json").write_text(told + "\n", encoding="utf-8")
    Console().print(f"written: {picture}, {options.output / 'curves.json'}", highlight=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
