"""One piece of ``cuda.sh``: pbrdf on a card against LLVM on the processor of the same machine, in one run.

    python benchmarks/cuda.py machine|evaluation|fit|render [--device cuda|llvm] [--json FILE]

``evaluation``: full Mueller matrices, in double precision with NumPy arrays in and out (``mueller()``), and as a
renderer has them: directions and matrices stay in the device's memory, double and single precision. ``fit``: the batch
of ``fit.py``, measured values in the device's memory, parameters and their information matrices back in the host's; in
double precision throughout, and as the solver does it by itself, where it searches in single precision first; and a map
of 256 x 256 pixels as a user has it (``pbrdf.fit_map``).
``render``: the scene of ``rendering.py``; Mitsuba's variants compute in single precision.

The two take turns; printed are medians and their ratio. They must agree: matrices to 1e-9 of f00 in double and 1e-4 in
single precision, fitted parameters to 1e-5 of their size, pictures to 1 % of their mean (other random numbers). The
status is 1 otherwise. ``--device llvm`` is the rehearsal of ``cuda.sh``.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from evaluation import PAINT, random_geometries
from machine import processor
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.backend import llvm_version, thread_count
from pbrdf.optics.geometry import geometry_from_angles

#: Aims on one H100, directions and fits a second; of what the host's memory and its bus do not hold up.
DIRECTIONS_AIM, FITS_AIM = 500e6, 1e6
#: Work of a turn on a card and on a processor: a card wants many lanes.
DIRECTIONS = {"cuda": 1 << 24, "llvm": 1 << 20}
FITS = {"cuda": 1 << 18, "llvm": 1 << 13}
ROUNDS = 5


class Row:
    """What both devices do in turn: functions by device, amounts of work, and results to compare."""

    def __init__(self, name: str, unit: str, tolerance: float, aim: float | None = None) -> None:
        self.name, self.unit, self.tolerance, self.aim = name, unit, tolerance, aim
        self.work: dict[str, tuple[float, Callable[[], Any]]] = {}
        self.compared: dict[str, np.ndarray] = {}
        self.scale: Any = 1.0

    def measure(self) -> dict[str, Any]:
        """Amount of work a second by place (``device``, ``processor``), and how far the results are apart."""
        first = {}
        for place, (_, function) in self.work.items():
            start = time.perf_counter()
            function()
            first[place] = time.perf_counter() - start
        seconds: dict[str, list[float]] = {place: [] for place in self.work}
        for _ in range(ROUNDS):
            for place, (_, function) in self.work.items():
                start = time.perf_counter()
                function()
                seconds[place].append(time.perf_counter() - start)
        rate = {place: amount / float(np.median(seconds[place])) for place, (amount, _) in self.work.items()}
        apart = np.abs(self.compared["device"] - self.compared["processor"]) / self.scale
        return {
            "name": self.name,
            "unit": self.unit,
            "aim_a_second": self.aim,
            "first_call_s": first,
            "seconds": seconds,
            "a_second": rate,
            "ratio": rate["device"] / rate["processor"],
            "difference": float(apart.max()),
            "tolerance": self.tolerance,
            "agree": bool(apart.max() <= self.tolerance),
        }


def places(device: str) -> dict[str, str]:
    """Backends by place."""
    return {"device": device, "processor": "llvm"}


def on(backend: str, function: Callable[[], Any]) -> Callable[[], Any]:
    """The function with pbrdf's backend set."""

    def run() -> Any:
        pbrdf.set_backend(backend)
        return function()

    return run


def evaluation(device: str) -> list[dict[str, Any]]:
    """Mueller matrices of random directions to 1.3 rad."""
    import drjit as dr

    model = pbrdf.DoubleGauss(**PAINT._asdict())
    checked = random_geometries(20_000, 1.3)
    rows = []

    row = Row("mueller(), NumPy in and out, double", "directions", 1e-9)
    for place, backend in places(device).items():
        angles = random_geometries(min(DIRECTIONS[backend], 1 << 20), 1.3)
        call = on(backend, lambda angles=angles: model.mueller(*angles))
        row.work[place] = (angles[0].size, call)
        row.compared[place] = on(backend, lambda: model.mueller(*checked))()
    row.scale = row.compared["processor"][:, :1, :1]
    rows.append(row.measure())
    reference = row.compared["processor"]

    for precision, accuracy, tolerance in (("double", "default", 1e-9), ("single", "fast", 1e-4)):
        row = Row(f"in the device's memory, {precision}, {accuracy}", "directions", tolerance, DIRECTIONS_AIM)
        row.scale = reference[:, 0, :1]
        chosen = model.with_accuracy(accuracy)
        for place, backend in places(device).items():
            pbrdf.set_backend(backend)
            module = pbrdf.get_backend().module
            Float = module.Float64 if precision == "double" else module.Float

            def matrices(angles: tuple[np.ndarray, ...], Float: Any = Float, chosen: Any = chosen) -> Any:
                held = [Float(angle) for angle in angles]
                values = {name: dr.opaque(Float, float(value)) for name, value in chosen.values.items()}
                values |= {
                    p.name: None for p in chosen.parameters if p.vanishing and chosen.values[p.name] == 0.0
                }
                dr.eval(held)
                dr.sync_thread()

                def kernel() -> Any:
                    f = chosen.kernel(geometry_from_angles(*held), values)
                    out = [Float(x) for line in f for x in line]
                    dr.eval(out)
                    dr.sync_thread()
                    return out

                return kernel

            row.work[place] = (DIRECTIONS[backend], matrices(random_geometries(DIRECTIONS[backend], 1.3)))
            out = [np.broadcast_to(x.numpy(), checked[0].shape) for x in matrices(checked)()]
            row.compared[place] = np.stack(out, -1)
        rows.append(row.measure())
    return rows


def fit(device: str) -> list[dict[str, Any]]:
    """Batches of fits of 6 parameters to 42 geometries of (I, Q, U), the data in the device's memory."""
    import fit as script

    from pbrdf.inversion.problem import residuals
    from pbrdf.inversion.solver import WORTH_SINGLE, solve

    problem = script.space()
    low, high = problem.box
    data = script.measurements(max(FITS[backend] for backend in places(device).values()))
    rows = []
    for name in ("double", "single, then double"):
        row = Row(f"batch fit, {name}", "fits", 1e-5, FITS_AIM)
        for place, backend in places(device).items():
            pbrdf.set_backend(backend)
            count = FITS[backend]
            prepared = residuals(problem, data[:count])
            rough = None if name == "double" else prepared.single()
            assert rough is None or count * prepared.points >= WORTH_SINGLE
            prepared = dataclasses.replace(
                prepared, single=None if rough is None else lambda rough=rough: rough
            )
            start = np.tile(problem.to_unknowns(script.GUESS), (count, 1))

            def call(prepared: Any = prepared, start: np.ndarray = start) -> np.ndarray:
                solution = solve(prepared, start, low, high)
                assert solution.converged.all(), f"{(~solution.converged).sum()} fits did not converge"
                return problem.to_parameters(solution.u)

            row.work[place] = (count, on(backend, call))
            row.compared[place] = row.work[place][1]()[: min(FITS.values())]
        row.scale = np.abs(row.compared["processor"]) + 0.1
        rows.append(row.measure())
    rows.append(_map(device))
    return rows


def _map(device: str) -> dict[str, Any]:
    """The image of ``maps.py``, from NumPy arrays to the finished map with its standard errors."""
    from maps import image

    data, _ = image(256)
    row = Row("fit_map, NumPy arrays in and out", "pixels", 1e-5)

    def call() -> np.ndarray:
        return np.asarray(pbrdf.fit_map(data)["estimate"].values)

    for place, backend in places(device).items():
        row.work[place] = (256.0 * 256.0, on(backend, call))
        row.compared[place] = row.work[place][1]()
    row.scale = np.abs(row.compared["processor"]) + 0.1
    return row.measure()


def render(device: str) -> list[dict[str, Any]]:
    """A picture of 256 x 256 pixels with the plugin, and with ``pplastic``, Stokes vectors."""
    if importlib.util.find_spec("mitsuba") is None:
        print("render: left out, Mitsuba is not installed")
        return []
    import mitsuba as mi

    import rendering as script

    pbrdf.register_bsdf()
    spp = {"cuda": 256, "llvm": 16}
    rows = {name: Row(f"render, {name}, single", "samples", 0.01) for name in ("pbrdf", "pplastic")}
    for place, backend in places(device).items():
        variant = f"{backend}_ad_mono_polarized"
        mi.set_variant(variant)
        mi.set_log_level(mi.LogLevel.Error)
        for name, row in rows.items():
            scene = script.load_scene(script.MATERIALS[name], 256)

            def call(scene: Any = scene, variant: str = variant, count: int = spp[backend]) -> Any:
                mi.set_variant(variant)
                return script.render(scene, count, 1)

            row.work[place] = (256 * 256 * spp[backend], call)
            image = np.asarray(mi.render(scene, spp=spp[backend], seed=2))[..., :3]
            row.compared[place] = image.mean(axis=(0, 1))
            row.scale = row.compared[place][0]
    return [row.measure() for row in rows.values()]


def card() -> str:
    """Name and driver of the card, as its own tool tells."""
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=15)
    except (OSError, subprocess.SubprocessError):
        return "no card: nvidia-smi does not answer"
    return done.stdout.strip().splitlines()[0]


def machine(device: str) -> dict[str, Any]:
    """What the numbers belong to; ends with BackendError if the device cannot be used."""
    import drjit as dr

    for backend in places(device).values():
        pbrdf.set_backend(backend)
        pbrdf.get_backend()
    return {
        "device": card() if device == "cuda" else "REHEARSAL: LLVM in the card's place",
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": thread_count(),
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, llvm_version() or ())) or "unknown",
        "python": sys.version.split()[0],
        "pbrdf": pbrdf.__version__,
    }


def show(rows: list[dict[str, Any]], title: str) -> None:
    """Print the table of a piece."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    for heading in ("", "device", "processor", "ratio", "first call", "aim on an H100", "difference"):
        table.add_column(heading, justify="right" if heading else "left")
    for row in rows:
        aim = row["aim_a_second"]
        met = "" if aim is None else "met" if row["a_second"]["device"] >= aim else "missed"
        table.add_row(
            row["name"],
            f"{row['a_second']['device']:.3g} {row['unit']}/s",
            f"{row['a_second']['processor']:.3g}",
            f"{row['ratio']:.3g}x",
            f"{row['first_call_s']['device']:.1f} s",
            "" if aim is None else f"{aim:.0e} {met}",
            f"{row['difference']:.1e} {'' if row['agree'] else 'DIFFER'}",
        )
    Console(width=140).print(table, highlight=False)


def main() -> int:
    """Run one piece; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    pieces = {"evaluation": evaluation, "fit": fit, "render": render}
    parser.add_argument("piece", choices=["machine", *pieces])
    parser.add_argument("--device", choices=("cuda", "llvm"), default="cuda")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was measured to this file")
    options = parser.parse_args()
    try:
        told = machine(options.device)
    except pbrdf.PbrdfError as error:
        print(error, file=sys.stderr)
        return 1
    rows: list[dict[str, Any]] = []
    if options.piece == "machine":
        print(", ".join(f"{key} {value}" for key, value in told.items()))
    else:
        rows = pieces[options.piece](options.device)
        if rows:
            show(
                rows, f"{options.piece}: {told['device']} against {told['processor']}, {told['cores']} cores"
            )
    if options.json is not None:
        text = json.dumps({"machine": told, "rows": rows}, indent=2, ensure_ascii=False)
        options.json.write_text(text + "\n", encoding="utf-8")
    return 0 if all(row["agree"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
