"""Which part of a sample each pixel belongs to: a map of whole numbers with names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.reduction.region_files import read_regions
from pbrdf.instruments.reduction.regions import LabelRegion, Region, require_inside

__all__ = ["label_map", "label_names", "read_labels"]


def read_labels(path: str | Path, rows: int, columns: int) -> xr.DataArray:
    """Labels of a picture's pixels from a file of regions.

    Parameters
    ----------
    path
        A picture (PNG, TIFF, NPY) of whole numbers, or a file of regions with names; see
        :func:`pbrdf.instruments.reduction.region_files.read_regions`.
    rows, columns
        Size of the picture.

    Returns
    -------
    xarray.DataArray
        See :func:`label_map`.

    Raises
    ------
    DataError
        If the file cannot be read, or its regions do not fit the picture or overlap.
    """
    try:
        return label_map(read_regions(path), rows, columns)
    except DataError as error:
        raise error if str(path) in str(error) else DataError(f"{path}: {error}") from error


def label_map(regions: Mapping[str, Region], rows: int, columns: int) -> xr.DataArray:
    """Labels of a picture's pixels from regions.

    Returns
    -------
    xarray.DataArray
        int32 over (``y``, ``x``), 0 in no region; attributes ``flag_values`` and ``flag_meanings`` name the numbers,
        those of a picture of labels by themselves, others counted from 1.

    Raises
    ------
    DataError
        If a region is not within the picture, or two overlap.
    """
    require_inside(regions, rows, columns)
    labels = np.zeros((rows, columns), dtype=np.int32)
    numbers = {
        name: region.value if isinstance(region, LabelRegion) and name == str(region.value) else i
        for i, (name, region) in enumerate(regions.items(), 1)
    }
    reach = np.iinfo(labels.dtype)
    for name, region in regions.items():
        if not reach.min <= numbers[name] <= reach.max:
            raise DataError(f"region {name!r}: a label has at most 32 bits, from {reach.min} to {reach.max}")
        mask = region.mask(0, rows, columns)
        if (labels[mask] != 0).any():
            raise DataError(f"region {name!r} overlaps another one: a pixel has one label")
        labels[mask] = numbers[name]
    attrs = {
        "flag_values": [int(n) for n in numbers.values()],
        "flag_meanings": " ".join(name.replace(" ", "_") for name in numbers),
        "long_name": "part of the sample; 0 is none",
    }
    return xr.DataArray(labels, dims=("y", "x"), name="labels", attrs=attrs)


def label_names(labels: xr.DataArray) -> dict[int, str]:
    """Names by number of the labels that occur, but for 0; numbers without a name are called by themselves."""
    values = np.atleast_1d(labels.attrs.get("flag_values", []))
    names = dict(zip(map(int, values), str(labels.attrs.get("flag_meanings", "")).split(), strict=False))
    return {int(n): names.get(int(n), str(n)) for n in np.unique(labels.values) if n != 0}
