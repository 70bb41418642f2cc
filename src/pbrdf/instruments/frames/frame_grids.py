"""Frames in netCDF files and Zarr folders: a variable over series, state, y and x, and repeat where there is one.

States are found by their labels, names or numbers (angles in degrees, or a count), wherever they stand. A whole number
that the variable's ``_FillValue`` says to be none was not written: frames with one are not finished.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.files.netcdf_files import open_netcdf
from pbrdf.instruments.frames.frames import named, require_raw

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["GRID_SUFFIXES", "GriddedFrames", "open_grid"]

#: Extensions of such files.
GRID_SUFFIXES = (".nc", ".nc4", ".zarr")
#: Names of the dimensions of frames in netCDF and Zarr.
_DIMENSIONS = {
    "series": ("series", "geometry", "exposure", "time"),
    "state": ("state", "states", "analyzer"),
    "y": ("y", "row", "rows"),
    "x": ("x", "column", "columns"),
    "repeat": ("repeat", "repeats", "repetition"),
}
#: Angles of states that differ by no more are the same, degrees.
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class GriddedFrames:
    """Frames in a variable of a netCDF file or a Zarr folder, which is read where it is asked for.

    Attributes
    ----------
    names
        Of the series.
    variable
        With the dimensions y and x, and series, state and repeat where there is more than one.
    path
        The file or folder, for messages.
    """

    names: tuple[str, ...]
    variable: xr.DataArray
    path: Path

    @property
    def states(self) -> int:
        return self.variable.sizes.get("state", 1)

    @property
    def rows(self) -> int:
        return self.variable.sizes["y"]

    @property
    def columns(self) -> int:
        return self.variable.sizes["x"]

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        part = self.variable.isel(y=slice(first_row, last_row))
        if "series" in part.dims:
            part = part.isel(series=series)
        order = tuple(dim for dim in ("repeat", "state", "y", "x") if dim in part.dims)
        try:
            values = part.transpose(*order).values
        except Exception as error:  # the libraries raise anything over a damaged file
            raise DataError(f"{self.path}: cannot be read: {error}") from error
        self._require_written(values, series)
        return values if "state" in part.dims else values[..., np.newaxis, :, :]

    @property
    def layers(self) -> int:
        """Repeats of each state."""
        return self.variable.sizes.get("repeat", 1)

    def _require_written(self, values: np.ndarray, series: int) -> None:
        """Raise if whole numbers are those that stand for none; what is no number is a dead pixel later."""
        fill = self.variable.attrs.get("_FillValue")
        if fill is None or values.dtype.kind not in "iu":
            return
        count = int((values == fill).sum())
        if count:
            raise DataError(
                f"{self.path}: {count} pixels of the series {self.names[series]!r} are {int(fill)}, the _FillValue of "
                f"{self.variable.name}, which stands for what was not written: the frames are not finished. If it is a "
                "number of the camera, leave the attribute _FillValue out"
            )


def open_grid(path: Path, states: Sequence[str]) -> GriddedFrames:
    """Find the frames in a netCDF file or a Zarr folder.

    Parameters
    ----------
    path
        The file or folder.
    states
        Names of the states of the polarimeter.

    Raises
    ------
    DataError
        If zarr is missing, the file cannot be read, or it does not hold such frames.
    """
    opened = open_zarr if path.suffix.lower() == ".zarr" else open_netcdf
    # of Zarr's second version every array has a fill value, which says nothing of the numbers
    plain = {"use_zarr_fill_value_as_mask": False} if opened is open_zarr else {}
    file = opened(path, mask_and_scale=False, decode_times=False, cache=False, **plain)
    frames = _variable(path, file)
    require_raw(frames.dtype, f"{path}: the variable {frames.name}", means=True)
    names = _labels(frames, "series") if "series" in frames.dims else (path.stem,)
    if len(set(names)) != len(names):
        raise DataError(f"{path}: two series of {frames.name} have the same name")
    return GriddedFrames(names, _in_order(path, frames, states), path)


def _variable(path: Path, file: xr.Dataset) -> xr.DataArray:
    """The variable with the frames, its dimensions called series, state, y and x."""
    meanings = {dim: ours for ours, theirs in _DIMENSIONS.items() for dim in theirs}
    fitting = [
        name
        for name, array in file.data_vars.items()
        if {meanings.get(str(d)) for d in array.dims} >= {"y", "x"} and array.dtype.kind in "iuf"
    ]
    if "frames" in fitting:
        fitting = ["frames"]
    if len(fitting) != 1:
        raise DataError(
            f"{path}: {'no' if not fitting else 'more than one'} variable holds pictures; give one called frames "
            "with the dimensions series, state, y, x"
        )
    array = file[fitting[0]]
    strange = [str(d) for d in array.dims if str(d) not in meanings]
    ours = [meanings.get(str(d)) for d in array.dims]
    if strange or len(set(ours)) < len(ours):
        raise DataError(
            f"{path}: the dimensions of {array.name} are {named(list(map(str, array.dims)))}: "
            "call them series, state, y, x"
        )
    return array.rename({d: meanings[str(d)] for d in array.dims if meanings[str(d)] != d})


def _labels(array: xr.DataArray, dim: str) -> tuple[str, ...]:
    if dim in array.coords:
        return tuple(str(label) for label in array[dim].values.tolist())
    return tuple(str(i + 1) for i in range(array.sizes[dim]))


def _in_order(path: Path, frames: xr.DataArray, states: Sequence[str]) -> xr.DataArray:
    """The frames with the states in the polarimeter's order, where the file names them."""
    held = frames.sizes.get("state", 1)
    if held != len(states):
        raise DataError(
            f"{path}: {frames.name} has {held} states, but the polarimeter {len(states)}: {named(states, 10)}"
        )
    if len(states) == 1 or "state" not in frames.coords:
        return frames
    order = _order(frames["state"], states)
    if order is None:
        raise DataError(
            f"{path}: its states are {named(_labels(frames, 'state'), 10)}, but those of the polarimeter "
            f"{named(states, 10)}: call them so, or leave the coordinate state out where they stand in this order"
        )
    return frames if order == sorted(order) else frames.isel(state=order)


def _order(labels: xr.DataArray, states: Sequence[str]) -> list[int] | None:
    """Where in a file each state of the polarimeter stands; None where its labels are of others.

    Labels are the states' names, their numbers (of angles in degrees, or in radians where the units say so), or a count
    from 0 or 1.
    """
    texts = list(_labels(labels, "state"))
    if set(texts) == set(states):
        return [texts.index(state) for state in states]
    found, wanted = _numbers(texts), _numbers(states)
    if found is None or len(set(found)) != len(found):
        return None
    if str(labels.attrs.get("units", "")).startswith("rad"):
        found = np.rad2deg(found).tolist()
    if wanted is not None and np.allclose(sorted(found), sorted(wanted), rtol=0.0, atol=_SAME):
        return [int(np.abs(np.subtract(found, one)).argmin()) for one in wanted]
    for first in (0, 1):
        if sorted(found) == list(range(first, first + len(states))):
            return sorted(range(len(found)), key=found.__getitem__)
    return None


def _numbers(texts: Sequence[str]) -> list[float] | None:
    """Labels as numbers; None where one is none."""
    try:
        return [float(text) for text in texts]
    except ValueError:
        return None
