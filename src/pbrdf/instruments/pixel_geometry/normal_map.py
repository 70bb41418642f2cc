"""Normals, or the angles themselves, given for every pixel: arrays, or files of which blocks are read.

Files are NPY arrays, or netCDF files and Zarr folders with variables of these names:

* normals: NPY of the shape (rows, columns, 3); ``normal`` over (y, x, component), the components x, y, z in this order
  or labelled. Vectors away from the surface in the camera's axes (x right, y up, z to the camera), of any length; NaN
  or (0, 0, 0) is off the sample.
* angles: NPY of the shape (rows, columns, 4) in degrees; ``theta_i``, ``theta_r``, ``phi``, ``rotation`` over (y, x) or
  (geometry, y, x), with the attribute ``units``, rad or degree, and perhaps ``irradiance`` and ``mask``: what
  :meth:`.PixelGeometry.of` gives, stored. NaN is off the sample.

Coordinates y and x, where a file has them, must be those of the pictures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.alignment import few, require_same_labels
from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.data.schema import DIMENSION
from pbrdf.errors import DataError
from pbrdf.files.netcdf_files import open_netcdf
from pbrdf.instruments.pixel_geometry.geometry import (
    CurvedSample,
    PixelGeometry,
    Surface,
    require_series,
    stacked,
)

__all__ = ["AngleMaps", "NormalMap"]

_ANGLES = ("theta_i", "theta_r", "phi", "rotation")
_COMPONENTS = ("x", "y", "z")


@dataclass(frozen=True, kw_only=True)
class NormalMap(CurvedSample):
    """A sample whose normals are known.

    Lamps that are near are not possible: normals do not tell where a pixel's point is.

    Attributes
    ----------
    normals
        An array, or the path of a file; see the module's text.
    """

    normals: np.ndarray | str | Path = field(repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(math.isfinite(lamp.distance) for lamp in self.lamps):
            raise DataError("normals do not tell where the points of the sample are: a lamp cannot be near")

    def located(self, stokes: xr.Dataset) -> NormalMap:
        opened = self._open()
        shape = opened.shape
        _require_pictures(shape[:2], stokes, "normals")
        if isinstance(opened, xr.DataArray):
            require_same_labels(opened, "the normals", stokes, "the pictures", ("y", "x"))
        if len(shape) != 3 or shape[2] != 3:
            raise DataError(f"normals have the shape (rows, columns, 3), not {shape}")
        return replace(self, camera=self._sized(stokes))

    def _open(self) -> Any:
        if isinstance(self.normals, np.ndarray):
            return self.normals
        path = Path(self.normals)
        return _open_npy(path) if path.suffix.lower() == ".npy" else _normals(path)

    def described(self) -> dict[str, Any]:
        return {"kind": "normals", **_named(self.normals)}

    def surface(self, x: np.ndarray, y: np.ndarray) -> Surface:
        vector = _cut(self._open(), x, y)
        length = np.linalg.norm(vector, axis=-1)
        seen = length > 0.0
        normal = np.where(seen[..., None], vector, [0.0, 0.0, 1.0]) / np.where(seen, length, 1.0)[..., None]
        return Surface(normal, self.camera.view(x, y), np.zeros(3), seen)


@dataclass(frozen=True)
class AngleMaps(PixelGeometry):
    """Angles that are known for every pixel.

    Attributes
    ----------
    maps
        ``theta_i``, ``theta_r``, ``phi``, ``rotation`` as a data set, or the path of a file; see the module's text.
    """

    maps: xr.Dataset | str | Path = field(repr=False)

    def located(self, stokes: xr.Dataset) -> AngleMaps:
        maps = self._open()
        missing = [name for name in _ANGLES if name not in maps]
        if missing:
            raise DataError(f"maps of angles are {', '.join(_ANGLES)}: there is no {missing[0]}")
        for name in _ANGLES:
            if not {"y", "x"} <= {*maps[name].dims} <= {DIMENSION, "y", "x"}:
                raise DataError(
                    f"{name} is over {maps[name].dims}: give maps over y and x, or geometry, y and x"
                )
            if maps[name].attrs.get("units") not in ("rad", "degree"):
                raise DataError(
                    f"{name} does not say whether it is in rad or degree: give the attribute units"
                )
        _require_pictures((maps.sizes["y"], maps.sizes["x"]), stokes, "maps of angles")
        require_series(maps.sizes.get(DIMENSION, 1), stokes, "maps of each angle")
        require_same_labels(maps, "the maps of angles", stokes, "the pictures", ("y", "x"))
        return self

    def _open(self) -> xr.Dataset:
        if isinstance(self.maps, xr.Dataset):
            return self.maps
        path = Path(self.maps)
        if path.suffix.lower() != ".npy":
            return _open_grid(path)
        array = _open_npy(path)
        if array.ndim != 3 or array.shape[2] != 4:
            raise DataError(f"{path}: maps of angles have the shape (rows, columns, 4), not {array.shape}")
        units = {"units": "degree"}
        return xr.Dataset({name: (("y", "x"), array[..., k], units) for k, name in enumerate(_ANGLES)})

    def pixels(self, x: np.ndarray, y: np.ndarray) -> xr.Dataset:
        maps = self._open()
        x, y = np.asarray(x), np.asarray(y)
        # the pixels by number: blocks of what lies in a file
        part = maps.isel(y=slice(y[0], y[-1] + 1), x=slice(x[0], x[-1] + 1)).isel(y=y - y[0], x=x - x[0])
        found: dict[str, list[np.ndarray]] = {}
        for i in range(part.sizes.get(DIMENSION, 1)):
            one = part.isel({DIMENSION: i}) if DIMENSION in part.dims else part
            angles = {name: one[name].transpose("y", "x").values.astype(float) for name in _ANGLES}
            angles = {
                name: np.deg2rad(a) if part[name].attrs["units"] == "degree" else a
                for name, a in angles.items()
            }
            mask = np.isfinite(np.stack(list(angles.values()))).all(axis=0)
            if "mask" in one:
                mask &= one["mask"].transpose("y", "x").values.astype(bool)
            for name in ("theta_i", "theta_r"):
                mask &= (angles[name] >= 0.0) & (angles[name] < 0.5 * np.pi)
            for name, values in angles.items():
                found.setdefault(name, []).append(np.where(mask, values, np.nan))
            if "irradiance" in one:
                values = one["irradiance"].transpose("y", "x").values
                found.setdefault("irradiance", []).append(np.where(mask, values, np.nan))
            found.setdefault("mask", []).append(mask)
        return stacked(found, x, y, {"kind": "angles", **_named(self.maps)})


def _named(source: Any) -> dict[str, str]:
    """The file's name, without where it lies."""
    return {"file": Path(source).name} if isinstance(source, str | Path) else {}


def _open_npy(path: Path) -> np.ndarray:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise DataError(f"{path}: cannot be read as an NPY array: {error}") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise DataError(f"{path}: it holds no array of numbers")
    return array


def _open_grid(path: Path) -> xr.Dataset:
    if path.suffix.lower() not in (".nc", ".zarr"):
        raise DataError(f"{path}: normals and angles are read from .npy, .nc and .zarr")
    if not path.exists():
        raise DataError(f"{path}: there is no such file")
    return (open_zarr if path.suffix.lower() == ".zarr" else open_netcdf)(path, decode_times=False)


def _normals(path: Path) -> xr.DataArray:
    """The variable of normals, its components in order; no numbers are read."""
    grid = _open_grid(path)
    if "normal" not in grid:
        raise DataError(
            f"{path}: there is no variable 'normal'; it has {', '.join(map(str, grid.data_vars))}"
        )
    array = grid["normal"]
    if {"y", "x"} <= {*array.dims}:
        array = array.transpose("y", "x", ...)
    axis = array.dims[-1]
    if axis not in array.coords or array[axis].dtype.kind not in "OUST":
        return array
    labels = array[axis].values.astype(str).tolist()
    if sorted(labels) != list(_COMPONENTS):
        raise DataError(f"{path}: the components of normal are {few(labels)}: they must be x, y, z")
    return array.isel({axis: [labels.index(name) for name in _COMPONENTS]})


def _cut(array: Any, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values at the pixels with these centres, shape (rows, columns, …); of a file only a block is read."""
    columns, rows = np.floor(x[0]).astype(int), np.floor(y[:, 0]).astype(int)
    block = array[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    values = np.asarray(block.values if isinstance(block, xr.DataArray) else block, dtype=float)
    return values[np.ix_(rows - rows.min(), columns - columns.min())]


def _require_pictures(shape: tuple[int, ...], stokes: xr.Dataset, what: str) -> None:
    there = (stokes.sizes["y"], stokes.sizes["x"])
    if tuple(shape) != there:
        raise DataError(
            f"the {what} have {' × '.join(map(str, shape))} rows and columns, the pictures {there[0]} × {there[1]}"
        )
