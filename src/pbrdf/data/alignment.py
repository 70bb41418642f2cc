"""Arrays that are put together or beside each other go by their labels, never by their places."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.schema import STOKES_AXES
from pbrdf.errors import DataError
from pbrdf.optics.stokes import STOKES, stokes_places

__all__ = ["few", "in_stokes_order", "require_same_labels"]

#: Labels are told one by one where there are no more than so many.
_FEW = 8


def in_stokes_order(dataset: xr.Dataset) -> xr.Dataset:
    """Data whose Stokes components are labelled, in the order of the schema: I, Q, U, V along each axis.

    Raises
    ------
    DataError
        If the labels of an axis are others.
    """
    for axis in STOKES_AXES:
        if axis not in dataset.coords or dataset[axis].dims != (axis,):
            continue
        labels = dataset[axis].values.astype(str)
        places = stokes_places(labels)
        if places is None:
            raise DataError(f"the coordinate {axis} must be {', '.join(STOKES)}, not {', '.join(labels)}")
        if places != sorted(places):
            dataset = dataset.isel({axis: places})
    return dataset


def require_same_labels(
    ours: xr.Dataset | xr.DataArray,
    name: str,
    others: xr.Dataset | xr.DataArray,
    others_name: str,
    dims: Iterable[str],
) -> None:
    """Check that places along some dimensions are the same in both, as far as both have coordinates that say so.

    Parameters
    ----------
    ours, others
        What is put together.
    name, others_name
        What they are called, for messages.
    dims
        The dimensions.

    Raises
    ------
    DataError
        If a coordinate differs, or its unit; says its values in both.
    """
    for dim in dims:
        if dim not in ours.coords or dim not in others.coords:
            continue
        here, there = ours[dim], others[dim]
        units = [str(one.attrs.get("units", "1")) for one in (here, there)]
        if units[0] == units[1] and _are_same(here.values, there.values):
            continue
        said = [
            few(one.values) + (f" {unit}" if units[0] != units[1] else "")
            for one, unit in zip((here, there), units, strict=True)
        ]
        raise DataError(
            f"{dim} is {said[0]} in {name}, and {said[1]} in {others_name}: these are not the same places. Put them in "
            f"the same order, or leave the coordinate {dim} out of one where they are the same all the same"
        )


def few(values: Any) -> str:
    """Values in words: all of a few, else the first ones and the last."""
    texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in np.ravel(values).tolist()]
    if len(texts) <= _FEW:
        return ", ".join(texts)
    return f"{', '.join(texts[:2])}, … {texts[-1]}"


def _are_same(here: np.ndarray, there: np.ndarray) -> bool:
    if here.shape != there.shape:
        return False
    if here.dtype.kind in "iuf" and there.dtype.kind in "iuf":
        spread = float(np.ptp(there)) if there.size else 0.0
        # single precision is no difference
        return bool(np.allclose(here, there, rtol=1e-6, atol=1e-6 * (spread or 1.0)))
    return bool((here.astype(str) == there.astype(str)).all())
