"""A map whose units are all done: it gets the attributes of the whole, and is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import xarray as xr

from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.plain_numbers import json_from_text
from pbrdf.files.zarr_chunks import StoredArray
from pbrdf.inversion.map_store.map_store import COMPLETE, MARK, MapStore, stored_attributes

__all__ = ["finish", "open_map"]

#: The array that counts the distinct optima of a pixel, where there is one.
OPTIMA = "optima"


def finish(store: MapStore) -> int:
    """Complete a map if all its units are done; returns how many are not.

    The attributes of the whole follow from what the units hold, so whoever completes the map writes the same.
    """
    left = len(store.missing())
    if left:
        return left
    if not stored_attributes(store.path).get(COMPLETE):
        attributes = _whole(store)
        file = store.path / "zarr.json"
        content = json_from_text(file.read_bytes())
        content["attributes"] |= {**attributes, COMPLETE: 1}
        with atomic_file(file) as new:
            new.write_text(json.dumps(content, indent=2), encoding="utf-8")
    return 0


def _whole(store: MapStore) -> dict[str, Any]:
    """Attributes of a whole map: how many pixels have which status, and how many have more than one optimum."""
    import zarr

    group = zarr.open_group(store.path, mode="r", zarr_format=3, use_consolidated=False)
    mark = group[MARK]
    values = list(mark.attrs["flag_values"])
    counts = dict.fromkeys(values, 0)
    several = seen = 0
    for number in range(store.grid.count):
        slices = store.grid.slices(number)
        place = tuple(slices[dim] for dim in store.grid.dims)
        status = mark[place]
        for value in values:
            counts[value] += int((status == value).sum())
        if OPTIMA in group:
            optima = group[OPTIMA]
            found = optima[tuple(slices[dim] for dim in optima.metadata.dimension_names)]
            seen, several = seen + int((found > 0).sum()), several + int((found > 1).sum())
    meanings = str(mark.attrs["flag_meanings"]).split()
    attributes: dict[str, Any] = {
        f"pixels_{meaning}": counts[value] for value, meaning in zip(values, meanings, strict=True)
    }
    if seen:
        attributes["several_optima"] = several / seen
    return attributes


def open_map(path: str | Path, *, partial: bool = False) -> xr.Dataset:
    """Open a map whose numbers are read when they are asked for.

    Parameters
    ----------
    path
        The store.
    partial
        Whether a map that is not complete is opened as well. Its pixels that are not done have the status −1; the
        attribute ``units_missing`` says how many units those are.

    Returns
    -------
    xarray.Dataset
        The map; no Dask.

    Raises
    ------
    DataError
        If there is no such map, units are missing (says how many), or a file of it is missing, cut off or damaged.
    """
    path = Path(path)
    attributes = stored_attributes(path)
    if not attributes.get(COMPLETE):
        mark = StoredArray.of(path, MARK)
        left = sum(not mark.file(index).exists() for index in mark.indices())
        if not partial:
            what = f"{left} of {mark.count} units are missing" if left else "the last step is missing"
            raise DataError(
                f"{path}: this map is not complete: {what}; the command that began it goes on with it"
            )
        found = xr.open_dataset(path, engine="zarr", zarr_format=3, consolidated=False, cache=False)
        return found.assign_attrs(units_missing=left)
    try:
        return open_zarr(path, cache=False)
    except DataError as error:
        raise DataError(f"{error}. The command that made this map writes what is lost again") from error
