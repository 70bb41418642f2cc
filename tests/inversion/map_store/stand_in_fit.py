"""A fit of pixels that takes no time, and what processes of the tests do with it."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
import zarr.storage._local as zarr_files

from pbrdf.inversion.map_store import DatasetSource, prepare_store, run_units

SHARD, CHUNK = {"y": 16, "x": 16}, {"y": 8, "x": 8}
PARAMETERS = ["first", "second", "third"]
MEANINGS = "converged not_converged too_few_values failed not_measured masked not_yet_fitted"
#: What stands for numbers of pixels that nobody has come to.
UNDONE = {"optima": -1, "starts": -1, "flags": 128, "status": -1}
VARIABLES = {
    "estimate": (("parameter",), np.float64),
    "standard_error": (("parameter",), np.float64),
    "chi2": ((), np.float64),
    "optima": ((), np.int16),
    "starts": ((), np.int16),
    "flags": (("parameter",), np.uint8),
    "status": ((), np.int8),
}


@dataclass
class StandInFit:
    """Has the form of a map's fit; the numbers are a cheap function of a pixel's own values."""

    sizes: dict[str, int]
    seed: int = 0
    delay: float = 0.0

    @property
    def settings(self):
        return {"seed": self.seed, "model": {"name": "StandIn", "options": {"facets": "all"}}}

    @property
    def dims(self):
        return tuple(self.sizes)

    def _assembled(self, arrays):
        attrs = {
            "status": {"flag_values": np.array([*range(6), -1], dtype=np.int8), "flag_meanings": MEANINGS},
            "flags": {
                "flag_masks": np.array([1, 128], dtype=np.uint8),
                "flag_meanings": "high not_yet_fitted",
            },
        }
        return xr.Dataset(
            {
                name: ((*VARIABLES[name][0], *self.dims), values, attrs.get(name, {}))
                for name, values in arrays.items()
            },
            {"parameter": PARAMETERS, "unit": ("parameter", ["1", "µm", ""])},
            {"model": "StandIn"},
        )

    def template(self):
        shapes = {name: (*(3,) * len(front), *self.sizes.values()) for name, (front, _) in VARIABLES.items()}
        return self._assembled(
            {
                name: np.broadcast_to(VARIABLES[name][1](UNDONE.get(name, np.nan)), shapes[name])
                for name in VARIABLES
            }
        )

    def fit_block(self, block, progress=None):
        time.sleep(self.delay)
        values = block["I"].transpose("geometry", *self.dims).values
        mean, spread = values.mean(0), values.std(0)
        estimate = np.stack([mean, spread, np.sin(1e3 * mean + self.seed)])
        status = np.where(np.isnan(mean), 4, np.where(spread > 0.4, 1, 0)).astype(np.int8)
        arrays = {
            "estimate": estimate,
            "standard_error": np.where(estimate > 0.9, np.nan, 0.1 * estimate),
            "chi2": (values**2).sum(0),
            "optima": np.where(np.isnan(mean), 0, 1 + (mean > 0.6)).astype(np.int16),
            "starts": np.where(np.isnan(mean), 0, 1 + 63 * (spread > 0.2)).astype(np.int16),
            "flags": (estimate > 0.9).astype(np.uint8),
            "status": status,
        }
        # in another order of dimensions than the store's
        return self._assembled(arrays).transpose(*reversed(self.dims), "parameter")


def picture(y=40, x=28, geometries=5):
    rng = np.random.default_rng(4)
    values = rng.uniform(0.0, 1.0, (geometries, y, x))
    values[:, :9, :3] = np.nan
    return xr.Dataset({"I": (("geometry", "y", "x"), values)}, attrs={"quantity": "brdf"})


def store_at(path, dataset=None, **settings):
    dataset = picture() if dataset is None else dataset
    fit = StandInFit({dim: dataset.sizes[dim] for dim in ("y", "x")}, **settings)
    return prepare_store(path, fit, DatasetSource(dataset), shard=SHARD, chunk=CHUNK)


def contents(path: Path) -> dict[str, bytes]:
    """Everything in a store but what a killed writer has left."""
    return {
        file.relative_to(path).as_posix(): file.read_bytes()
        for file in sorted(path.rglob("*"))
        if file.is_file()
        and file.suffix != ".partial"
        and not any(p.name.endswith(".tmp") for p in file.parents)
    }


def run_process(path, delay=0.0, worker=None, ready=None):
    """What a process does that is killed from outside."""
    if ready is not None:
        ready.set()
    run_units(store_at(path, delay=delay), worker=worker)


def run_killed_in_a_write(path, number, half):
    """Work until the file of this number is being written, and die in the middle of it, or before its last step."""
    written = zarr_files._atomic_write
    count = 0

    class Dying:
        def __init__(self, file):
            self.file = file

        def write(self, view):
            content = bytes(view)
            self.file.write(content[: len(content) // 2] if half else content)
            self.file.flush()
            os.kill(os.getpid(), signal.SIGKILL)

    import contextlib

    @contextlib.contextmanager
    def counted(target, mode, exclusive=False):
        nonlocal count
        with written(target, mode, exclusive=exclusive) as file:
            count += 1
            yield Dying(file) if count == number else file

    zarr_files._atomic_write = counted
    run_units(store_at(path))


class EndlessSource:
    """A picture of any size that is nowhere: each block is made when it is asked for."""

    def __init__(self, y, x, geometries):
        self.shape = (geometries, y, x)

    def outline(self):
        return xr.Dataset({"I": (("geometry", "y", "x"), np.broadcast_to(0.0, self.shape))})

    def block(self, slices):
        y, x = (np.arange(self.shape[1 + k])[slices[dim]] for k, dim in enumerate("yx"))
        g = np.arange(self.shape[0])
        values = np.cos(g[:, None, None] + 0.37 * y[:, None] + 0.73 * x) ** 2
        return xr.Dataset({"I": (("geometry", "y", "x"), values)})

    def identity(self):
        return {"endless": list(self.shape)}


def work_on_a_large_map(path, queue):
    """Begin a map of 10⁸ pixels, do four units of it, and say how much memory and time that took."""

    def peak():
        (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if "VmHWM" in line)
        return int(line.split()[1]) * 1024

    small = store_at(path.with_name("small.zarr"))
    run_units(small)  # whatever is loaded and started once
    before, clock = peak(), time.perf_counter()
    source = EndlessSource(10_000, 10_000, 42)
    store = prepare_store(path, StandInFit({"y": 10_000, "x": 10_000}), source)
    planned = time.perf_counter() - clock
    count = store.grid.count
    work = run_units(store, worker=(7, count // 4))
    queue.put((count, work, planned, peak() - before))
