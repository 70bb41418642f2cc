"""Memory that a million evaluations and a fit of a million geometries take, against their inputs and outputs.

    python benchmarks/memory.py [--size N] [--quick] [--json FILE]

Each is done in a process of its own: first a small one, which compiles the kernels and loads what is needed; then the
inputs are loaded; then the highest resident memory during the call is taken, less what stood before the inputs. It is
given as a multiple of the inputs and outputs:

* evaluation: three angles (3 × 8 bytes) and a Mueller matrix (16 × 8 bytes) a direction; four times as many directions
  are evaluated in several pieces;
* fit: all arrays of the data set (angles, group, I, Q, U and their standard uncertainties) and of the result's
  ``comparison`` (measured, modelled, residual and uncertainty of each channel, DoLP, facet tilt and masks). The
  observations that the result keeps for later work count as memory taken, not as output.

Linux only, as the highest resident memory must be set back before the call. The script ends with status 1 if one takes
more than twice its inputs and outputs.
"""

from __future__ import annotations

import argparse
import gc
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf

TARGET = 2.0
PAINT = pbrdf.DoubleGauss(sigma=0.04, n=1.5, a=1.0, k=1.2, b=0.2, t=0.5)
CHANNELS = ("I", "Q", "U")
#: Size of the call that comes before, larger than what a fit searches as it is.
WARM = 20_000
MEBI = 1024.0 * 1024.0


def angles(size: int) -> np.ndarray:
    """Random directions to 75°, shape (3, size)."""
    rng = np.random.default_rng(0)
    return rng.random((3, size)) * np.array([np.radians(75.0), np.radians(75.0), 2.0 * np.pi])[:, None]


def measurements(size: int) -> np.ndarray:
    """Angles, Stokes components with noise, and their standard uncertainties, shape (9, size)."""
    directions = angles(size)
    exact = PAINT.stokes(*directions)[:, :3].T
    std = np.repeat(0.01 * exact[:1] + 1e-4, 3, axis=0)
    return np.concatenate(
        [directions, exact + std * np.random.default_rng(1).standard_normal(exact.shape), std]
    )


def evaluate(columns: list[np.ndarray]) -> tuple[int, Callable[[], int]]:
    """Bytes of the inputs, and the call, which returns those of the outputs."""
    return sum(c.nbytes for c in columns), lambda: PAINT.mueller(*columns).nbytes


def fit(columns: list[np.ndarray]) -> tuple[int, Callable[[], int]]:
    """As ``evaluate``."""
    values, std = (dict(zip(CHANNELS, part, strict=True)) for part in (columns[3:6], columns[6:]))
    dataset = pbrdf.make_dataset(*columns[:3], quantity="brdf", std=std, **values)

    def call() -> int:
        result = pbrdf.fit(dataset, starts=8)
        return sum(v.nbytes for v in result.comparison.data_vars.values())

    return sum(v.nbytes for v in dataset.variables.values()), call


WORK = {"evaluation": (angles, evaluate), "fit": (measurements, fit)}


def resident() -> float:
    """Resident memory of this process in MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / MEBI


def measure(work: str, file: Path) -> dict[str, float]:
    """In a process of its own: do the work with the columns in a file; MiB."""
    make, prepare = WORK[work]
    prepare(list(make(WARM)))[1]()
    gc.collect()
    before = resident()
    inputs, call = prepare([column.copy() for column in np.load(file, mmap_mode="r")])
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")  # the highest resident memory from now on
    outputs = call()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"inputs": inputs / MEBI, "outputs": outputs / MEBI, "taken": peak - before}


def run(work: str, size: int) -> dict[str, Any]:
    """Start such a process."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "columns.npy"
        np.save(file, WORK[work][0](size))
        command = [sys.executable, __file__, "--child", work, str(file)]
        found = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    ratio = found["taken"] / (found["inputs"] + found["outputs"])
    return {"work": work, "size": size, **found, "ratio": ratio, "target": TARGET, "met": ratio <= TARGET}


def show(console: Console, results: list[dict[str, Any]]) -> None:
    """Print a table."""
    table = Table(title="highest memory, MiB", title_justify="left", box=SIMPLE_HEAD, padding=0)
    table.add_column("", no_wrap=True, width=12)
    for column in ("geometries", "inputs", "outputs", "taken", "÷ in + out", "aim"):
        table.add_column(column, justify="right", no_wrap=True, width=12)
    for r in results:
        aim = f"≤ {r['target']:g}x {'met' if r['met'] else 'missed'}"
        sizes = (f"{r[name]:.0f}" for name in ("inputs", "outputs", "taken"))
        table.add_row(r["work"], str(r["size"]), *sizes, f"{r['ratio']:.2f}", aim)
    console.print(table)


def main() -> int:
    """Run the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--size", type=int, default=1_000_000, help="geometries (default 10⁶)")
    parser.add_argument("--quick", action="store_true", help="few geometries: does it run?")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all results to this file")
    parser.add_argument("--child", nargs=2, metavar=("WORK", "FILE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        print(json.dumps(measure(options.child[0], Path(options.child[1]))))
        return 0
    size = 100_000 if options.quick else options.size
    if size < 1:
        parser.error("--size must be at least 1")
    results = [run("evaluation", size), run("evaluation", 4 * size), run("fit", size)]
    show(Console(), results)
    if options.json is not None:
        options.json.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    return 0 if options.quick or all(r["met"] for r in results) else 1


if __name__ == "__main__":
    sys.exit(main())
