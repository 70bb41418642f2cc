"""MATLAB files of polarised BRDF tables over half and difference angles, as KAIST publishes them.

The files of S.-H. Baek et al. (:mod:`pbrdf.data.formats.pbsdf` has the same tables for Mitsuba) hold the variables
``theta_h``, ``theta_d``, ``phi_d``, ``wvls`` and ``pbrdf_T_f``, the Mueller matrices with the shape (φ_d, θ_d, θ_h,
wavelength, 4, 4), in the order of axes that Kyunnilee/pBRDF-visualization, enomotokenji/pbrdf-rendering and the
``M`` of the ``.pbsdf`` files agree on; so are frames and signs. Angles are in radians, or in degrees where they are
larger than radians can be; wavelengths in nm. NaN cells were not measured. Both kinds of file are read: up to version 7
(:mod:`pbrdf.data.formats.mat5`), and version 7.3, which is HDF5 with the axes in reverse.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.mat5 import mat5_arrays
from pbrdf.data.formats.pbsdf import PolarizedTable, dataset_from_table
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_matlab"]

_AXES = ("phi_d", "theta_d", "theta_h", "wvls")
_TABLES = ("pbrdf_T_f", "pbrdf_T")
#: How much a compressed variable can grow: deflate stops at about 1032.
_LARGEST_RATIO = 1100


def read_matlab(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, every: int | None = None
) -> xr.Dataset:
    """Read a polarised BRDF table from a ``.mat`` file.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.
    every
        Take one node in this many along each of θ_h, θ_d and φ_d; 1 takes all. None takes as many as leave no
        more than :data:`pbrdf.data.formats.thinning.MOST_CELLS` cells at each wavelength.

    Returns
    -------
    xarray.Dataset
        As :func:`pbrdf.data.formats.pbsdf.read_pbsdf` gives it.

    Raises
    ------
    DataError
        If the file cannot be read, or holds no such table; names the variables that it holds.
    """
    path = Path(path)
    shapes = _shapes(path)
    name = next((table for table in _TABLES if table in shapes), None)
    missing = [axis for axis in _AXES if axis not in shapes]
    if name is None or missing:
        lacking = missing[0] if missing else " or ".join(_TABLES)
        raise DataError(
            f"{path}: there is no variable {lacking}; a table of Mueller matrices has {', '.join(_AXES)} and "
            f"{_TABLES[0]}, but this file holds {', '.join(shapes) or 'nothing'}. Save other data as CSV"
        )
    counts = tuple(math.prod(shapes[axis]) for axis in _AXES)
    if shapes[name] != (*counts, 4, 4):
        raise DataError(
            f"{path}: the variable {name} has the shape {shapes[name]}, but its axes {', '.join(_AXES)} ask for "
            f"{(*counts, 4, 4)}"
        )
    if math.prod(shapes[name]) > _LARGEST_RATIO * path.stat().st_size:
        raise DataError(
            f"{path}: {name} cannot have the shape {shapes[name]} in a file of this size: it is damaged"
        )
    values = _variables(path, [*_AXES, name])
    axes = {axis: values[axis].ravel().astype(np.float64) for axis in _AXES}
    if max(axes["theta_h"].max(), axes["theta_d"].max()) > np.pi / 2 + 0.01:
        axes |= {axis: np.deg2rad(axes[axis]) for axis in _AXES[:3]}
    _require_nodes(path, axes)
    table = PolarizedTable(
        theta_h=axes["theta_h"],
        theta_d=axes["theta_d"],
        phi_d=axes["phi_d"],
        wavelength=axes["wvls"],
        matrices=values[name],
    )
    return dataset_from_table(table, path, wavelength=wavelength, every=every)


def _require_nodes(path: Path, axes: dict[str, NDArray[np.float64]]) -> None:
    for name, values in axes.items():
        if not np.isfinite(values).all() or (np.diff(values) <= 0).any():
            raise DataError(f"{path}: the values of {name} do not ascend")
        low, high = {"phi_d": (-2 * np.pi, 2 * np.pi), "wvls": (1.0, 1e6)}.get(name, (0.0, np.pi / 2))
        if values[0] < low - 1e-6 or values[-1] > high + 1e-6:
            raise DataError(
                f"{path}: {name} reaches from {values[0]:g} to {values[-1]:g}, beyond {low:g} to {high:g} "
                f"({'nm' if name == 'wvls' else 'radians'})"
            )


def _is_hdf5(path: Path) -> bool:
    return first_bytes(path, 12).startswith(b"MATLAB 7.3") or first_bytes(path, 8) == b"\x89HDF\r\n\x1a\n"


def _shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Shape of each array, by name; nothing of it is loaded."""
    if not _is_hdf5(path):
        return {array.name: array.shape for array in mat5_arrays(path)}
    with _opened(path) as file:
        return {k: tuple(reversed(v.shape)) for k, v in file.items() if isinstance(v, h5py.Dataset)}


def _variables(path: Path, names: list[str]) -> dict[str, NDArray[Any]]:
    if not _is_hdf5(path):
        return {array.name: array.load() for array in mat5_arrays(path) if array.name in names}
    with _opened(path) as file:
        values = {name: np.asarray(file[name][()]).T for name in names}
    for name, array in values.items():
        if array.dtype.kind not in "iuf":
            raise DataError(f"{path}: the variable {name} does not hold real numbers")
    return values


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file; what goes wrong with it is a DataError."""
    try:
        with h5py.File(path) as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise DataError(f"{path}: cannot be read as a MATLAB file: {' '.join(str(error).split())}") from error
    except MemoryError as error:
        raise DataError(f"{path}: there is not enough memory for what this file declares") from error


def _begins_as_matlab(path: Path) -> bool:
    return first_bytes(path, 7) == b"MATLAB "


READER = Reader("matlab", read_matlab, extensions=(".mat",), sniff=_begins_as_matlab)
