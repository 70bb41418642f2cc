"""Stokes pictures of ``pbrdf reduce`` with the geometry of their pixels as data of a parameter map.

The data are those of :mod:`pbrdf.data.schema` with the dimensions ``y`` and ``x`` beside ``geometry``, which counts the
series. Light is taken for natural: the axes of polarised light would be others at every pixel.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.alignment import require_same_labels
from pbrdf.data.formats.csv_table.columns import COVARIANCES
from pbrdf.data.schema import (
    COVARIANCE,
    DIMENSION,
    NATURAL_LIGHT,
    STOKES_AXES,
    std_name,
    variable_units,
)
from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.geometry import PixelGeometry, pixel_coordinates
from pbrdf.instruments.reduction.surface_axes import to_surface_axes
from pbrdf.optics.stokes import STOKES

__all__ = ["map_block", "map_dataset"]

_ANGLES = ("theta_i", "theta_r", "phi")
#: Attributes of the pictures that the map keeps.
_KEPT = ("instrument", "polarimeter", "states", "accuracy_linear", "accuracy_circular", "stability", "title")


def map_dataset(
    stokes: xr.Dataset, geometry: PixelGeometry | xr.Dataset, *, scale: float | None = None
) -> xr.Dataset:
    """What :func:`pbrdf.fit_map` reads, from whole Stokes pictures and the geometry of their pixels.

    Parameters
    ----------
    stokes
        As ``pbrdf reduce`` writes it: ``I``, ``Q``, ``U``, perhaps ``V``, their covariance ``cov_II`` …, and ``flags``
        over (``series``, ``y``, ``x``), in the camera's axes. Where Dask holds it, nothing is computed now; else it is
        read as a whole: larger pictures are opened with chunks, or cut into blocks for :func:`map_block`.
    geometry
        A geometry, which is located in the pictures first, or what its ``pixels`` gives, for all of them.
    scale
        Digital numbers for a BRDF times cosθ_i of 1/sr, if it is known, under the lamp's irradiance in the middle of
        the sample: then the values are BRDFs, 1/sr.

    Returns
    -------
    xarray.Dataset
        See :func:`map_block`.

    Raises
    ------
    DataError
        If pictures and geometry do not fit each other.
    """
    _require_pictures(stokes)
    if isinstance(geometry, PixelGeometry):
        geometry = geometry.located(stokes)
    if any(variable.chunks is not None for variable in stokes.variables.values()):
        return _lazy(stokes, geometry, scale)
    return map_block(stokes, geometry, scale=scale)


def map_block(
    stokes: xr.Dataset, geometry: PixelGeometry | xr.Dataset, *, scale: float | None = None
) -> xr.Dataset:
    """The same for a part of the pictures.

    Parameters
    ----------
    stokes
        Rows and columns of the pictures, with the coordinates ``y`` and ``x`` that say which.
    geometry
        Located in the whole pictures, or of just these pixels.
    scale
        As for :func:`map_dataset`.

    Returns
    -------
    xarray.Dataset
        ``I``, ``Q``, ``U``, ``V`` as far as they were determined, their standard errors and ``covariance`` in the axes
        (p, s) of each pixel's surface, divided by the exposure and by the irradiance of a near lamp, over
        (``geometry``, ``y``, ``x``): digital numbers, or BRDFs if `scale` is known. NaN where a pixel is flagged, off
        the sample or dark; the angles there, which then decide nothing, are 0. ``theta_i``, ``theta_r`` and ``phi`` are
        over ``geometry`` alone where all pixels share them. The errors are those of the detector's noise.

    Raises
    ------
    DataError
        As :func:`map_dataset`.
    """
    _require_pictures(stokes)
    if isinstance(geometry, PixelGeometry):
        geometry = geometry.pixels(*pixel_coordinates(stokes))
    if scale is not None and not 0.0 < scale < math.inf:
        raise DataError(f"the scale is {scale:g}: it must be more than 0")
    if "series" not in stokes.dims:
        stokes = stokes.expand_dims("series")
    stokes = stokes.transpose("series", "y", "x", ...)
    shape = tuple(stokes.sizes[dim] for dim in ("series", "y", "x"))
    _require_sizes(geometry, stokes)
    angles = {name: _spread(geometry, name) for name in (*_ANGLES, "rotation", "mask")}
    mask = np.broadcast_to(angles.pop("mask"), shape).astype(bool)
    if "flags" in stokes:
        mask = mask & (stokes["flags"].values == 0)
    rotation = np.broadcast_to(np.nan_to_num(angles.pop("rotation")), shape)
    values, covariance = _turned(stokes, rotation, mask)
    factor = _factor(stokes, geometry, angles["theta_i"], scale, shape)
    values /= factor[..., None]
    covariance /= factor[..., None, None] ** 2
    quantity = "brdf" if scale is not None else str(stokes.attrs.get("quantity", "dn"))
    dims = (DIMENSION, "y", "x")
    data: dict[str, Any] = {}
    units = {"units": variable_units("I", quantity)}
    known = [k for k, name in enumerate(STOKES) if name in stokes]
    for k in known:
        data[STOKES[k]] = (dims, values[..., k], units)
    errors = [k for k in known if f"cov_{STOKES[k] * 2}" in stokes]
    for k in errors:
        # an error of nothing is not known
        variance = covariance[..., k, k]
        data[std_name(STOKES[k])] = (dims, np.sqrt(np.where(variance > 0.0, variance, np.nan)), units)
    if errors:
        data[COVARIANCE] = (
            (*dims, *STOKES_AXES[2:]),
            covariance,
            {"units": variable_units(COVARIANCE, quantity)},
        )
    coords = _coordinates(stokes, geometry, angles, bool(errors))
    return xr.Dataset(data, coords, _attributes(stokes, geometry, quantity))


def _require_pictures(stokes: xr.Dataset) -> None:
    missing = [name for name in ("y", "x") if name not in stokes.dims]
    if missing or "I" not in stokes:
        raise DataError(
            "Stokes pictures have I, Q, U over series, y and x, as `pbrdf reduce` writes them into stokes.nc; "
            f"these have {', '.join(map(str, stokes.data_vars)) or 'nothing'} over {', '.join(map(str, stokes.dims))}"
        )


def _spread(geometry: xr.Dataset, name: str) -> np.ndarray:
    """A variable of the geometry, shape (series or 1, rows or 1, columns or 1)."""
    if name not in geometry:
        raise DataError(f"the geometry of the pixels has no {name}")
    array = geometry[name]
    for dim in (DIMENSION, "y", "x"):
        if dim not in array.dims:
            array = array.expand_dims(dim)
    return array.transpose(DIMENSION, "y", "x").values


def _turned(stokes: xr.Dataset, rotation: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stokes vectors (..., 4) and covariances (..., 4, 4) in (p, s); NaN where nothing was measured."""
    good = mask & np.isfinite(stokes["I"].values)
    values = np.full((*mask.shape, 4), np.nan)
    covariance = np.full((*mask.shape, 4, 4), np.nan)
    taken = np.full((int(good.sum()), 4), np.nan)
    spread = np.full((len(taken), 4, 4), np.nan)
    for k, name in enumerate(STOKES):
        if name in stokes:
            taken[:, k] = stokes[name].values[good]
    for (i, j), name in COVARIANCES.items():
        if name in stokes:
            spread[:, i, j] = spread[:, j, i] = stokes[name].values[good]
    values[good], covariance[good] = to_surface_axes(taken, spread, -rotation[good])
    return values, covariance


def _factor(
    stokes: xr.Dataset, geometry: xr.Dataset, theta_i: np.ndarray, scale: float | None, shape: tuple[int, ...]
) -> np.ndarray:
    """What values are divided by, shape (series, rows, columns)."""
    factor = np.ones(shape)
    if "exposure" in stokes.coords:
        factor *= np.broadcast_to(stokes["exposure"].values, shape[:1])[:, None, None]
    if "irradiance" in geometry:
        factor *= _spread(geometry, "irradiance")
    if scale is not None:
        factor *= scale * np.cos(theta_i)
    return factor


def _coordinates(
    stokes: xr.Dataset, geometry: xr.Dataset, angles: dict[str, np.ndarray], covariance: bool
) -> dict[str, Any]:
    count = stokes.sizes["series"]
    coords: dict[str, Any] = {}
    for name, values in angles.items():
        filled = np.nan_to_num(values)
        if not {"y", "x"} & {*geometry[name].dims}:
            coords[name] = (DIMENSION, np.broadcast_to(filled[:, 0, 0], count).copy(), {"units": "rad"})
        else:
            full = np.broadcast_to(filled, (count, stokes.sizes["y"], stokes.sizes["x"]))
            coords[name] = ((DIMENSION, "y", "x"), full, {"units": "rad"})
    coords["group"] = (DIMENSION, np.zeros(count, dtype=np.int64))
    if "series" in stokes.coords:
        coords["series"] = (DIMENSION, stokes["series"].values)
    if "wavelength" in stokes.coords:
        wavelength = np.broadcast_to(stokes["wavelength"].values.astype(float), count)
        coords["wavelength"] = (DIMENSION, wavelength.copy(), {"units": "nm"})
    for name in ("y", "x"):
        if name in stokes.coords:
            coords[name] = (name, stokes[name].values, stokes[name].attrs)
    if covariance:
        coords |= {axis: list(STOKES) for axis in STOKES_AXES[2:]}
    return coords


def _attributes(stokes: xr.Dataset, geometry: xr.Dataset, quantity: str) -> dict[str, Any]:
    kept = {name: stokes.attrs[name] for name in _KEPT if name in stokes.attrs}
    return {
        "stokes_convention": "p-s",
        "quantity": quantity,
        "illumination": list(NATURAL_LIGHT),
        "simulated": int(stokes.attrs.get("simulated", 0)),
        **({} if quantity == "brdf" else {"scale": "arbitrary"}),
        **kept,
        "pixel_geometry": json.dumps(geometry.attrs, ensure_ascii=False, default=float),
    }


def _lazy(stokes: xr.Dataset, geometry: PixelGeometry | xr.Dataset, scale: float | None) -> xr.Dataset:
    """As :func:`map_block`, block by block when it is asked for."""
    import dask.array

    if "series" not in stokes.dims:
        stokes = stokes.expand_dims("series")
    stokes = stokes.chunk({"series": -1}).unify_chunks()
    chunks = {name: stokes.chunks.get(name, (stokes.sizes[name],)) for name in ("y", "x")}
    # what comes out, from a pixel without numbers
    corner = stokes.isel(y=slice(0, 1), x=slice(0, 1))
    empty = corner.copy(data={name: np.zeros(v.shape, v.dtype) for name, v in corner.data_vars.items()})
    if isinstance(geometry, xr.Dataset):
        _require_sizes(geometry, stokes)
        there = {name: chunks[name] for name in chunks if name in geometry.dims}
        sample = map_block(empty, geometry.isel({name: slice(0, 1) for name in there}), scale=scale)
        args, options = (
            [geometry.chunk({**there, **({DIMENSION: -1} if DIMENSION in geometry.dims else {})})],
            {},
        )
    else:
        sample = map_block(empty, geometry, scale=scale)
        args, options = [], {"geometry": geometry}
    pixels = {name: v for name, v in sample.variables.items() if {"y", "x"} <= set(v.dims)}
    template = xr.Dataset(
        {
            name: (
                v.dims,
                dask.array.zeros(
                    [stokes.sizes[d] if d in chunks else v.sizes[d] for d in v.dims],
                    chunks=tuple(chunks[d] if d in chunks else v.sizes[d] for d in v.dims),
                    dtype=v.dtype,
                ),
                v.attrs,
            )
            for name, v in pixels.items()
        },
        {name: stokes[name] for name in ("y", "x") if name in stokes.coords},
        sample.attrs,
    )
    lazy = xr.map_blocks(
        _pixels_alone, stokes, args=args, kwargs={**options, "scale": scale}, template=template
    )
    angles = [name for name in _ANGLES if name in pixels]
    shared = {name: v for name, v in sample.coords.items() if not {"y", "x"} & set(v.dims)}
    return lazy.set_coords(angles).assign_coords(shared)


def _pixels_alone(
    stokes: xr.Dataset, geometry: PixelGeometry | xr.Dataset, scale: float | None
) -> xr.Dataset:
    """A block without what is the same in all of them."""
    found = map_block(stokes, geometry, scale=scale).reset_coords(_ANGLES)
    return found.drop_vars([name for name, v in found.variables.items() if not {"y", "x"} & set(v.dims)])


def _require_sizes(geometry: xr.Dataset, stokes: xr.Dataset) -> None:
    """Check that a geometry is that of these pictures, pixel by pixel."""
    for dim, own in ((DIMENSION, "series"), ("y", "y"), ("x", "x")):
        size, there = geometry.sizes.get(dim, 1), stokes.sizes[own]
        named = any(dim in variable.dims and name != dim for name, variable in geometry.variables.items())
        if named and size != there and not (dim == DIMENSION and size == 1):
            raise DataError(f"the geometry has {size} in {own}, the pictures have {there}")
    require_same_labels(geometry, "the geometry", stokes, "the pictures", ("y", "x"))
