"""A map of parameters against the batch of ``fit.py``: pixels a second, estimates and standard errors.

The map: one paint whose parameters vary smoothly over an image, seen from the 42 geometries of ``fit.py`` (the same for
all pixels), I, Q and U with 1 % noise of their own. ``pbrdf.fit_map`` fits its six parameters at every pixel, from data
in memory to the finished map with all that it holds. The batch is ``fit.py``'s: 4096 data sets from one rough guess,
without standard errors. Both take turns in one run and, with a revision, so does that one's own batch (in a process of
its own, as ``versus.py`` runs it); a ratio is found within each turn, printed are medians. The target of issue 13 is a
ratio to c215ca4: five times the rate of its batch.

The map must be right, too: (estimate − truth)/standard error has a standard deviation of 1, and single fits of some
pixels end at the same place; else the status is 1.

Usage: ``python benchmarks/maps.py [REV] [--size 256] [--turns 5] [--threads 0] [--json FILE]``.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import xarray as xr
from fit import NAMES, PAINT, fit_batch, measurements
from machine import processor
from rich.console import Console
from rich.table import Table
from versus import Worker, checked_out, git

import pbrdf

#: Times the rate of REV's batch; the batch has so many fits.
AIM, BATCH = 5.0, 4096
REV = "REV's batch"


def image(size: int) -> tuple[xr.Dataset, dict[str, np.ndarray]]:
    """The measured image, and the truth."""
    like = measurements(1)[0]
    angles = (like.theta_i, like.theta_r, like.phi)
    y, x = np.mgrid[0:size, 0:size] / size
    paint = pbrdf.load_paint(PAINT)
    truth = {name: np.full((size, size), paint.values[name]) for name in NAMES}
    truth["a"] = truth["a"] * (1.0 + 0.2 * np.sin(4.0 * x + 2.0 * y))
    truth["sigma"] = truth["sigma"] * (1.0 + 0.2 * np.cos(3.0 * y))
    truth["n"] = truth["n"] + 0.05 * x
    truth["t"] = truth["t"] - 0.1 * y * x
    varied = paint.replace(**truth)
    stokes = np.empty((3, like.theta_i.size, size, size))
    for g in range(like.theta_i.size):
        here = [np.full((size, size), angle[g]) for angle in angles]
        stokes[:, g] = np.moveaxis(varied.stokes(*here)[..., :3], -1, 0)
    std = np.ascontiguousarray(np.broadcast_to(0.01 * stokes[0], stokes.shape))
    stokes += std * np.random.default_rng(1).standard_normal(stokes.shape)
    over = ("geometry", "y", "x")
    variables = {name: (over, stokes[i]) for i, name in enumerate("IQU")}
    variables |= {f"{name}_std": (over, std[i]) for i, name in enumerate("IQU")}
    coords = {
        name: ("geometry", angle) for name, angle in zip(("theta_i", "theta_r", "phi"), angles, strict=True)
    }
    coords["group"] = ("geometry", np.zeros(like.theta_i.size, dtype=int))
    attrs = {
        "quantity": "brdf",
        "stokes_convention": "p-s",
        "simulated": 1,
        "illumination": [1.0, 0.0, 0.0, 0.0],
    }
    return xr.Dataset(variables, coords, attrs), truth


def wrong(found: xr.Dataset, data: xr.Dataset, truth: dict[str, np.ndarray]) -> str:
    """What is wrong with a map; empty if nothing is."""
    if not (found["status"] == 0).all():
        return f"{int((found['status'] != 0).sum())} pixels did not converge"
    for name in NAMES:
        own = found.sel(parameter=name)
        pull = (own["estimate"].values - truth[name]) / own["standard_error"].values
        if not 0.9 < float(np.nanstd(pull)) < 1.1:
            return f"the standard errors of {name} are wrong: the pulls scatter by {np.nanstd(pull):.3f}"
    for y, x in np.random.default_rng(2).integers(0, data.sizes["y"], (5, 2)):
        own, single = found.isel(y=y, x=x), pbrdf.fit(data.isel(y=y, x=x))
        for name in NAMES:
            one, here = single.estimates[name], own.sel(parameter=name)
            if not abs(float(here["estimate"]) - one.value) < 0.001 * one.std:
                return f"a single fit of pixel ({y}, {x}) ends elsewhere"
    return ""


def main() -> int:
    """Run, print a table, and fail if the map is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "revision", nargs="?", metavar="REV", help="whose batch is the measure, such as c215ca4"
    )
    parser.add_argument("--size", type=int, default=256, help="pixels along a side")
    parser.add_argument("--turns", type=int, default=5, help="turns that count")
    parser.add_argument("--threads", type=int, default=0, help="threads of Dr.Jit (default: all)")
    parser.add_argument("--json", type=Path, help="write the numbers there")
    options = parser.parse_args()
    options.quick = False
    if options.threads:
        import drjit as dr

        dr.set_thread_count(options.threads)
    console = Console()
    data, truth = image(options.size)
    batch = measurements(BATCH)
    rates: dict[str, list[float]] = {"map": [], "batch": []}
    with ExitStack() as stack:
        worker = None
        if options.revision:
            scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pbrdf-maps-")))
            tree = stack.enter_context(
                checked_out(git("rev-parse", f"{options.revision}^{{commit}}"), scratch)
            )
            (scratch / "work").mkdir()
            worker = Worker("base", tree, scratch / "work", options)
            stack.callback(worker.stop)
            worker.ask(300.0, row="fits", do="prepare")
            rates[REV] = []
        for turn in range(-1, options.turns):
            clock = time.perf_counter()
            found = pbrdf.fit_map(data)
            taken = {"map": (time.perf_counter() - clock) / found["status"].size}
            taken["batch"] = fit_batch(batch)[0] / BATCH
            if worker is not None:
                taken[REV] = worker.ask(300.0, row="fits", do="turn")["times"]["fits"][0] / BATCH
            for name, seconds in taken.items():
                if turn >= 0:
                    rates[name].append(1.0 / seconds)
    table = Table(title=f"{options.size} × {options.size} pixels, 6 parameters, 42 geometries × (I, Q, U)")
    for heading in ("", "fits a second", "µs a fit", "map ÷ this"):
        table.add_column(heading, justify="left" if not heading else "right")
    ratio = {name: float(np.median(np.divide(rates["map"], each))) for name, each in rates.items()}
    for name, each in rates.items():
        table.add_row(name, f"{np.median(each):.0f}", f"{1e6 / np.median(each):.1f}", f"{ratio[name]:.2f}")
    console.print(table)
    console.print(
        f"{processor()}, {os.cpu_count()} cores; a megapixel: {1e6 / np.median(rates['map']):.0f} s"
    )
    if options.revision:
        met = "met" if ratio[REV] >= AIM else "missed"
        console.print(f"times the rate of REV's batch: {ratio[REV]:.1f} (aim {AIM:.0f}, {met})")
    trouble = wrong(found, data, truth)
    if trouble:
        print(trouble, file=sys.stderr)
    if options.json:
        options.json.write_text(json.dumps({"fits_per_second": rates, "map_over": ratio}, indent=2))
    return 1 if trouble else 0


if __name__ == "__main__":
    sys.exit(main())
