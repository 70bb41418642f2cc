"""Seconds and memory of identifying an image: a megapixel against twenty materials.

Materials are paints of random parameters with the assumed scatter between specimens; the image shows bands of the first
of them and one that the library does not know, a specimen for each pixel. It is identified from

* a map of parameters with standard errors of a fifth of the scatter, and
* Stokes cubes of I, Q, U at 9 and at 42 geometries that all pixels share, 1 % noise, gain known and not.

Each case is read from a Zarr store without Dask in a process of its own, which reports its seconds, the highest memory
and what is more than before; accuracy and coverage are those of the image. Kernels are compiled on a small image first.

Usage: ``python benchmarks/identification_map.py [--side 1024] [--materials 20] [--case NAME ...] [--json FILE]``.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.identification.class_map import NONE_OF_THESE, identify_map
from pbrdf.identification.library import Library
from pbrdf.identification.material import material_from_model

CASES = ("parameters", "stokes-9", "stokes-42", "stokes-9-gain", "stokes-42-gain")
#: Rows of an image that are written at once, and of the image on which kernels are compiled.
ROWS, WARM = 32, 16
NOISE = 0.01


def library(count: int) -> Library:
    """Paints of random parameters, and one more at the end that is not to be known."""
    rng = np.random.default_rng(14)
    low = np.array([0.08, 1.4, 0.3, 0.7, 0.02, 0.2])
    high = np.array([0.35, 1.9, 2.0, 1.6, 0.5, 0.9])
    drawn = low * (high / low) ** rng.random((count + 1, 6))
    return Library(
        tuple(
            material_from_model(f"paint {i}", pbrdf.DoubleGauss(*map(float, p))) for i, p in enumerate(drawn)
        )
    )


def directions(count: int) -> list[np.ndarray]:
    """θ_i, θ_r, φ in radians of 9 or 42 geometries."""
    if count == 42:
        experiment = pbrdf.open_experiment("white")
        few = experiment.isel(geometry=np.flatnonzero(experiment["group"].values < 3))
        return [few[name].values for name in ("theta_i", "theta_r", "phi")]
    pairs = [30, 30, 30, 50, 50, 50, 65, 65, 65], [20, 30, 45, 35, 50, 65, 50, 65, 75]
    return [*np.radians(np.array(pairs, dtype=float)), np.zeros(count)]


def truth_of(side: int, count: int) -> np.ndarray:
    """Number of the material of each column."""
    return (np.arange(side) * (count + 1)) // side


def rows_of(case: str, known: Library, rows: int, side: int, seed: int) -> xr.Dataset:
    """Some rows of the image."""
    rng = np.random.default_rng(seed)
    materials = known.materials
    space = materials[0].space
    true = np.empty((rows, side, len(space.free)))
    column = truth_of(side, len(materials) - 1)
    for number, material in enumerate(materials):
        own = column == number
        true[:, own] = material.draw(rows * int(own.sum()), rng).reshape(rows, int(own.sum()), -1)
    if case == "parameters":
        spread = 0.2 * np.sqrt(np.diag(materials[0].covariance))
        unknowns = space.to_unknowns(true) + spread * rng.standard_normal(true.shape)
        estimate = space.to_parameters(np.clip(unknowns, *space.box))
        error = spread * space.derivative(estimate)
        over = ("parameter", "y", "x")
        return xr.Dataset(
            {
                "estimate": (over, np.moveaxis(estimate, -1, 0)),
                "standard_error": (over, np.moveaxis(error, -1, 0)),
                "flags": (over, np.zeros((len(space.free), rows, side), dtype=np.uint8)),
                "status": (("y", "x"), np.zeros((rows, side), dtype=np.int8)),
            },
            coords={"parameter": space.names},
            attrs={"model": space.model.name},
        )
    angles = directions(int(case.split("-")[1]))
    named = {p.name: true[..., i, None] for i, p in enumerate(space.free)} | dict(space.fixed)
    stokes = space.model.from_values(named, **space.options).stokes(*(a[None, None] for a in angles))[..., :3]
    if case.endswith("gain"):
        stokes = stokes * np.exp(rng.standard_normal((rows, side)))[..., None, None]
    std = NOISE * stokes[..., 0]
    variables = {}
    for i, name in enumerate("IQU"):
        noisy = stokes[..., i] + std * rng.standard_normal(std.shape)
        variables[name] = (("geometry", "y", "x"), np.moveaxis(noisy, -1, 0).astype(np.float32))
        variables[f"{name}_std"] = (("geometry", "y", "x"), np.moveaxis(std, -1, 0).astype(np.float32))
    coords = {name: ("geometry", a) for name, a in zip(("theta_i", "theta_r", "phi"), angles, strict=True)}
    attrs = {"quantity": "brdf", "illumination": [1.0, 0.0, 0.0, 0.0]}
    return xr.Dataset(variables, coords, attrs)


def write(case: str, known: Library, side: int, store: Path) -> None:
    """The image as a Zarr store, strip by strip."""
    for begin in range(0, side, ROWS):
        strip = rows_of(case, known, min(ROWS, side - begin), side, begin)
        if begin == 0:
            chunks = {
                name: {"chunks": tuple(min(ROWS, n) if d == "y" else n for d, n in array.sizes.items())}
                for name, array in strip.data_vars.items()
            }
            strip.to_zarr(store, encoding=chunks, consolidated=False)
        else:
            strip.drop_vars([n for n in strip.variables if "y" not in strip[n].dims]).to_zarr(
                store, append_dim="y", consolidated=False
            )


def measure(case: str, side: int, count: int, store: Path) -> dict[str, Any]:
    """Identify the image of a store in this process."""
    known = library(count)
    names = Library(known.materials[:-1])
    gain = case.endswith("gain")
    with xr.open_zarr(store, chunks=None, consolidated=False) as image:
        identify_map(image.isel(y=slice(0, WARM)).load(), names, gain=gain)
        before = _highest()
        clock, work = time.perf_counter(), time.process_time()
        found = identify_map(image, names, gain=gain)
        seconds, work = time.perf_counter() - clock, time.process_time() - work
        after = _highest()
    column = truth_of(side, count)
    own = column < count
    best = found["probability"].values.argmax(axis=0)
    inside = np.stack([found["in_set"].values[c, :, x] for x, c in enumerate(column) if c < count], axis=1)
    return {
        "case": case,
        "pixels": side * side,
        "materials": count,
        "seconds": seconds,
        "processor_seconds": work,
        "highest_mb": after,
        "more_mb": after - before,
        "result_mb": found.nbytes / 1e6,
        "right": float((best == column)[:, own].mean()),
        "coverage": float(inside.mean()),
        "candidates": float(found["in_set"].values.sum(axis=0)[:, own].mean()),
        "unknown_rejected": float((found["material"].values[:, ~own] == NONE_OF_THESE).mean()),
    }


def _highest() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> int:
    """Run each case in a process of its own and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--side", type=int, default=1024, help="pixels along an edge")
    parser.add_argument("--materials", type=int, default=20)
    parser.add_argument("--case", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    parser.add_argument("--store", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.store is not None:
        print(json.dumps(measure(args.case[0], args.side, args.materials, args.store)))
        return 0
    table = Table(box=SIMPLE_HEAD)
    heads = (
        "case",
        "s",
        "processor s",
        "highest MB",
        "more MB",
        "result MB",
        "right",
        "coverage",
        "in set",
        "unknown",
    )
    for head in heads:
        table.add_column(head, justify="left" if head == "case" else "right")
    results = []
    for case in args.case:
        with tempfile.TemporaryDirectory() as folder:
            store = Path(folder) / "image.zarr"
            write(case, library(args.materials), args.side, store)
            command = [sys.executable, __file__, "--case", case, "--store", str(store)]
            command += ["--side", str(args.side), "--materials", str(args.materials)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
        found = json.loads(done.stdout.splitlines()[-1])
        results.append(found)
        table.add_row(
            case,
            f"{found['seconds']:.1f}",
            f"{found['processor_seconds']:.1f}",
            *(f"{found[name]:.0f}" for name in ("highest_mb", "more_mb", "result_mb")),
            f"{100 * found['right']:.1f} %",
            f"{100 * found['coverage']:.1f} %",
            f"{found['candidates']:.2f}",
            f"{100 * found['unknown_rejected']:.1f} %",
        )
    Console(width=120).print(table)
    if args.json is not None:
        args.json.write_text(json.dumps(results, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
