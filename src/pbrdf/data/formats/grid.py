"""Data over a grid of directions as arrays with the dimensions ``theta_i``, ``theta_r`` and ``phi``.

That is what xarray draws, selects and interpolates by the angles; the rows of :mod:`pbrdf.data.schema` are the same
numbers in one list. A netCDF file or Zarr folder may hold either: :func:`pbrdf.data.formats.stored.from_stored`
makes the list of the grid.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.formats.stored import to_stored
from pbrdf.data.schema import DIMENSION
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.netcdf_files import write_netcdf_file

__all__ = ["to_grid", "write_grid"]

#: In the order of the dimensions.
_AXES = ("theta_i", "theta_r", "phi")


def to_grid(ds: xr.Dataset) -> xr.Dataset:
    """A data set over a grid of directions, with a dimension for each angle.

    Parameters
    ----------
    ds
        A data set whose rows are all combinations of some θ_i, θ_r and φ, each once and in any order.

    Returns
    -------
    xarray.Dataset
        With the dimensions ``theta_i``, ``theta_r`` and ``phi``, angles in degrees where these are exact,
        else in radians; a wavelength or group that is one for all is a scalar.

    Raises
    ------
    DataError
        If the rows are no grid, or the data set is not valid.
    """
    stored = to_stored(ds)
    axes, where = {}, []
    for name in _AXES:
        values = stored[name].values
        distinct, first, number = np.unique(values, return_index=True, return_inverse=True)
        order = np.argsort(first)
        axes[name] = distinct[order]
        where.append(np.argsort(order)[number])
    shape = tuple(len(values) for values in axes.values())
    place = np.ravel_multi_index(tuple(where), shape)
    if len(place) != np.prod(shape) or len(np.unique(place)) != len(place):
        sizes = " × ".join(f"{len(values)} {name}" for name, values in axes.items())
        raise DataError(
            f"the {len(place)} geometries are no grid: that would be {sizes}, each combination once"
        )
    rows = np.argsort(place)
    coords: dict[str, object] = {name: (name, values, stored[name].attrs) for name, values in axes.items()}
    for key, coordinate in stored.coords.items():
        name = str(key)
        if name in _AXES:
            continue
        if DIMENSION not in coordinate.dims:
            coords[name] = coordinate
        elif (coordinate.values == coordinate.values[0]).all():
            coords[name] = ((), coordinate.values[0], coordinate.attrs)
        else:
            coords[name] = (_AXES, coordinate.values[rows].reshape(shape), coordinate.attrs)
    data = {
        name: (
            (*_AXES, *array.dims[1:]),
            array.values[rows].reshape(shape + array.shape[1:]),
            array.attrs,
        )
        for name, array in stored.data_vars.items()
    }
    return xr.Dataset(data, coords, stored.attrs)


def write_grid(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set over a grid of directions as a netCDF file with a dimension for each angle.

    Parameters
    ----------
    ds
        As for :func:`to_grid`.
    path
        The file; replaced if it exists.

    Raises
    ------
    DataError
        If the rows are no grid, the data set is not valid, or the file cannot be written.
    """
    stored = to_grid(ds)
    with atomic_file(Path(path)) as target:
        write_netcdf_file(target, {"/": stored})
