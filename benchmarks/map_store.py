"""What it costs to write a unit of a map, against stores of one variable for each parameter.

    python benchmarks/map_store.py [--turns N] [--side PIXELS …]

A unit of a map of six parameters, side × side pixels of random numbers, is written in four ways that take turns: as
:mod:`pbrdf.inversion.map_store` does it, arrays with the parameters as an axis, the check of the settings before and
the mark last; the same numbers as twelve variables, straight through zarr; and both through
``xarray.Dataset.to_zarr(region=…)``. Printed are medians and quartiles of the time of a unit, and ratios to the first.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from rich.console import Console
from rich.table import Table

from pbrdf.inversion.map_store import DatasetSource, MapStore, prepare_store

PARAMETERS = ("sigma", "n", "a", "k", "b", "t")
#: Units along each side of a store.
UNITS = 4
WAYS = (
    "parameter axis, pbrdf",
    "variable a parameter, zarr",
    "parameter axis, xarray",
    "variable a parameter, xarray",
)


class RandomFit:
    """In place of :class:`pbrdf.inversion.parameter_map.MapFit`: random results of the same form."""

    def __init__(self, side: int) -> None:
        self.sizes = {"y": UNITS * side, "x": UNITS * side}
        self.dims = ("y", "x")
        self.settings: dict[str, Any] = {}
        self._rng = np.random.default_rng(0)

    def _result(self, values: Callable[[tuple[int, ...]], np.ndarray], *shape: int) -> xr.Dataset:
        each, all_of_them = (*self.dims,), ("parameter", *self.dims)
        front = (len(PARAMETERS), *shape)
        return xr.Dataset(
            {
                "estimate": (all_of_them, values(front)),
                "standard_error": (all_of_them, values(front)),
                "flags": (all_of_them, values(front).astype(np.uint8)),
                "chi2": (each, values(shape)),
                "degrees_of_freedom": (each, values(shape).astype(np.int32)),
                "optima": (each, values(shape).astype(np.int16)),
                "starts": (each, values(shape).astype(np.int16)),
                "status": (
                    each,
                    values(shape).astype(np.int8),
                    {"flag_values": [0, 1], "flag_meanings": "converged not_converged"},
                ),
            },
            {"parameter": list(PARAMETERS)},
        )

    def template(self) -> xr.Dataset:
        """No numbers."""
        return self._result(lambda shape: np.broadcast_to(0.0, shape), *self.sizes.values())

    def fit_block(self, block: xr.Dataset, progress: Any = None) -> xr.Dataset:
        """Random ones."""
        return self._result(self._rng.random, block.sizes["y"], block.sizes["x"])


def split(result: xr.Dataset) -> xr.Dataset:
    """One variable for each parameter, and no coordinates."""
    parts: dict[str, Any] = {}
    for name, variable in result.data_vars.items():
        if "parameter" in variable.dims and name != "flags":
            parts |= {f"{own}_{name}": variable[k].variable for k, own in enumerate(PARAMETERS)}
        elif "parameter" not in variable.dims:
            parts[str(name)] = variable.variable
    return xr.Dataset(parts)


def prepared(folder: Path, side: int) -> tuple[MapStore, dict[str, Callable[[int, xr.Dataset], None]]]:
    """A store for each way, and what writes a unit into it."""
    fit = RandomFit(side)
    units = {"y": side, "x": side}
    store = prepare_store(folder / "map.zarr", fit, DatasetSource(xr.Dataset()), shard=units)
    plain = prepare_store(folder / "plain.zarr", fit, DatasetSource(xr.Dataset()), shard=units)
    apart = zarr.open_group(folder / "apart.zarr", mode="w")
    for name, variable in split(fit.template()).data_vars.items():
        apart.create_array(
            str(name),
            shape=variable.shape,
            shards=(side, side),
            chunks=store.grid.chunk,
            dtype=variable.dtype,
            fill_value=0,
            dimension_names=fit.dims,
        )

    def through_zarr(number: int, result: xr.Dataset) -> None:
        place = tuple(store.grid.slices(number).values())
        for name, variable in split(result).data_vars.items():
            apart[str(name)][place] = variable.values

    def through_xarray(path: Path, number: int, result: xr.Dataset) -> None:
        region = store.grid.slices(number)
        for part in (result.drop_vars("status"), result[["status"]]):
            part.drop_vars("parameter", errors="ignore").to_zarr(
                path,
                region={**region, **{dim: slice(None) for dim in part.dims if dim not in region}},
                consolidated=False,
            )

    return store, {
        WAYS[0]: store.write,
        WAYS[1]: through_zarr,
        WAYS[2]: lambda number, result: through_xarray(plain.path, number, result),
        WAYS[3]: lambda number, result: through_xarray(folder / "apart.zarr", number, split(result)),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--turns", type=int, default=UNITS**2)
    parser.add_argument("--side", type=int, nargs="+", default=[64, 256])
    options = parser.parse_args()
    console = Console()
    for side in options.side:
        with tempfile.TemporaryDirectory() as folder:
            store, ways = prepared(Path(folder), side)
            results = [
                store.fit.fit_block(xr.Dataset(coords={"y": np.arange(side), "x": np.arange(side)}))
                for _ in range(4)
            ]
            times: dict[str, list[float]] = {name: [] for name in ways}
            for turn in range(-1, options.turns):
                for name, write in ways.items():
                    clock = time.perf_counter()
                    write(turn % UNITS**2, results[turn % len(results)])
                    if turn >= 0:
                        times[name].append(time.perf_counter() - clock)
        table = Table(title=f"A unit of {side} × {side} pixels, {len(PARAMETERS)} parameters")
        for heading in ("written as", "median, ms", "quartiles", "ratio"):
            table.add_column(heading)
        first = float(np.median(times[WAYS[0]]))
        for name, values in times.items():
            low, middle, high = 1e3 * np.quantile(values, [0.25, 0.5, 0.75])
            table.add_row(name, f"{middle:.1f}", f"{low:.1f} … {high:.1f}", f"{middle / (1e3 * first):.1f}")
        console.print(table)


if __name__ == "__main__":
    main()
