"""MATLAB files of polarised BRDF tables over half and difference angles, as KAIST publishes them.

The files of S.-H. Baek et al. (:mod:`pbrdf.data.formats.pbsdf` has the same tables for Mitsuba) hold the variables
``theta_h``, ``theta_d``, ``phi_d``, ``wvls`` and ``pbrdf_T_f``, the Mueller matrices with the shape (φ_d, θ_d, θ_h,
wavelength, 4, 4), in the order of axes that Kyunnilee/pBRDF-visualization, enomotokenji/pbrdf-rendering and the
``M`` of the ``.pbsdf`` files agree on; so are frames and signs. Angles are in radians, or in degrees where they are
larger than radians can be; wavelengths in nm. NaN cells were not measured. Both kinds of file are read: up to version 7
(:mod:`pbrdf.files.mat5`), and version 7.3. Other MATLAB files are tables (:mod:`pbrdf.files.matlab`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.pbsdf import PolarizedTable, dataset_from_table
from pbrdf.errors import DataError
from pbrdf.files.matlab import is_matlab, matlab_arrays

__all__ = ["READER", "read_matlab"]

_AXES = ("phi_d", "theta_d", "theta_h", "wvls")
_TABLES = ("pbrdf_T_f", "pbrdf_T")


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
    arrays = {array.name: array for array in matlab_arrays(path)}
    shapes = {name: array.shape for name, array in arrays.items()}
    name = next((table for table in _TABLES if table in shapes), None)
    missing = [axis for axis in _AXES if axis not in shapes]
    if name is None or missing:
        lacking = missing[0] if missing else " or ".join(_TABLES)
        raise DataError(
            f"{path}: there is no variable {lacking}; a table of Mueller matrices has {', '.join(_AXES)} and "
            f"{_TABLES[0]}, but this file holds {', '.join(shapes) or 'nothing'}"
        )
    counts = tuple(math.prod(shapes[axis]) for axis in _AXES)
    if shapes[name] != (*counts, 4, 4):
        raise DataError(
            f"{path}: the variable {name} has the shape {shapes[name]}, but its axes {', '.join(_AXES)} ask for "
            f"{(*counts, 4, 4)}"
        )
    values: dict[str, NDArray[Any]] = {key: arrays[key].load() for key in (*_AXES, name)}
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


def _holds_a_table(path: Path) -> bool:
    if not is_matlab(path):
        return False
    try:
        return any(array.name in _TABLES for array in matlab_arrays(path))
    except DataError:
        return True  # it is ours to say what is wrong


READER = Reader("matlab", read_matlab, extensions=(".mat",), sniff=_holds_a_table)
