"""A map whose units are all done: it gets the attributes of the whole, and is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.plain_numbers import json_from_text
from pbrdf.files.zarr_chunks import StoredArray, array_names
from pbrdf.inversion.map_store.map_store import COMPLETE, MARK, MapStore, damaged, stored_attributes

__all__ = ["finish", "open_map"]

#: The arrays that count the distinct optima that were seen at a pixel, and the starts that were followed.
_COUNTS = ("optima", "starts")
#: The statuses of pixels that were fitted.
_FITTED = ("converged", "not_converged")


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
    """Attributes of a whole map, as :func:`pbrdf.fit_map` gives them but for the seconds, unit by unit."""
    import zarr

    group: Any = zarr.open_group(store.path, mode="r", zarr_format=3, use_consolidated=False)
    arrays = {name: group[name] for name in (MARK, *_COUNTS) if name in group}
    meanings = dict(
        zip(arrays[MARK].attrs["flag_meanings"].split(), arrays[MARK].attrs["flag_values"], strict=True)
    )
    fitted = searched = several = 0
    for number in range(store.grid.count):
        slices = store.grid.slices(number)
        found = {
            name: array[tuple(slices[dim] for dim in array.metadata.dimension_names)]
            for name, array in arrays.items()
        }
        fitted += int(np.isin(found[MARK], [meanings[name] for name in _FITTED]).sum())
        if len(arrays) == 1 + len(_COUNTS):
            optima, starts = (found[name] for name in _COUNTS)
            searched += int((starts > 1).sum())
            several += int(((starts > 1) & (optima > 1)).sum())
    return {"pixels_fitted": fitted, **({"share_of_several_optima": several / searched} if searched else {})}


def open_map(path: str | Path, *, partial: bool = False) -> xr.Dataset:
    """Open a map whose numbers are read when they are asked for.

    Parameters
    ----------
    path
        The store.
    partial
        Whether a map that is not complete is opened as well. Its pixels that are not done have the status −1 and the
        flag 128, and NaN for everything else, counts too, which are floating point then; the attribute
        ``units_missing`` says how many units those are.

    Returns
    -------
    xarray.Dataset
        The map; no Dask. The counts of a complete one are integers.

    Raises
    ------
    DataError
        If there is no such map, units are missing (says how many), or a file of it is missing, cut off or damaged.
    """
    path = Path(path)
    attributes = stored_attributes(path)
    if not attributes.get(COMPLETE):
        try:
            mark = StoredArray.of(path, MARK)
            left = sum(not mark.file(index).exists() for index in mark.indices())
        except OSError as error:
            raise damaged(path, error) from error
        if not partial:
            what = f"{left} of {mark.count} units are missing" if left else "the last step is missing"
            raise DataError(
                f"{path}: this map is not complete: {what}; the command that began it goes on with it"
            )
        try:
            found = xr.open_dataset(path, engine="zarr", zarr_format=3, consolidated=False, cache=False)
        except Exception as error:  # the library raises anything over damaged metadata
            raise damaged(path, error) from error
        return found.assign_attrs(units_missing=left)
    try:
        found = open_zarr(path, cache=False, mask_and_scale=dict.fromkeys(_counts(path), False))
        for variable in found.variables.values():
            variable.attrs.pop("_FillValue", None)
        return found
    except DataError as error:
        raise DataError(f"{error}. The command that made this map writes what is lost again") from error


def _counts(path: Path) -> list[str]:
    """The arrays of integers with a value for pixels that are not done."""
    found = []
    for name in array_names(path):
        described = json_from_text((path / name / "zarr.json").read_bytes())
        if "int" in str(described.get("data_type")) and "_FillValue" in described.get("attributes", {}):
            found.append(name)
    return found
