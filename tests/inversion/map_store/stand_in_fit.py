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
MEANINGS = "converged not_converged too_few_values failed not_measured masked"
VARIABLES = {
    "estimate": (("parameter",), np.float64),
    "standard_error": (("parameter",), np.float64),
    "chi2": ((), np.float64),
    "optima": ((), np.int16),
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
        attrs = {"status": {"flag_values": np.arange(6, dtype=np.int8), "flag_meanings": MEANINGS}}
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
            {name: np.broadcast_to(VARIABLES[name][1](0), shapes[name]) for name in VARIABLES}
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
