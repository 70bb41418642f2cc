"""Data sets as netCDF and Zarr hold them.

Angles are stored in degrees with ``units = "degree"``, or in radians with ``units = "rad"`` where a value has no
exact counterpart in degrees, so that reading gives back the same bits. Attributes that netCDF cannot hold (lists
of text, of one element or of mixed types) are stored as JSON text.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.alignment import in_stokes_order
from pbrdf.data.build import group_labels
from pbrdf.data.degrees import exact_degrees
from pbrdf.data.formats.attributes import plain_attributes
from pbrdf.data.schema import (
    ANGLES,
    COORDINATES,
    COVARIANCE,
    DIMENSION,
    STOKES_AXES,
    VARIABLES,
    std_name,
    variable_units,
    with_group,
)
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import json_from_text

__all__ = [
    "NANOMETRES",
    "from_stored",
    "pixels_from_stored",
    "require_no_pictures",
    "require_no_pixels",
    "to_stored",
]

_ANGLE_UNITS = {"degree": True, "degrees": True, "deg": True, "rad": False, "radian": False, "radians": False}
#: What wavelengths are multiplied with to be in nm, by their unit.
NANOMETRES = {
    "nm": 1.0,
    "nanometer": 1.0,
    "nanometre": 1.0,
    "um": 1e3,
    "µm": 1e3,
    "micrometer": 1e3,
    "micrometre": 1e3,
}
_JSON = "json:"
_MASK = "mask"


def from_stored(stored: xr.Dataset, path: Path) -> xr.Dataset:
    """Turn what a file holds into a valid data set.

    Angles and wavelengths are converted by their attribute ``units``; without one they are taken in radians
    and nm. Stokes components are found by their labels, in whichever order they stand. Variables that the schema
    does not know are left out and listed in the attribute ``ignored_variables``.

    Parameters
    ----------
    stored
        Content of the file, loaded into memory.
    path
        The file, for messages.

    Raises
    ------
    DataError
        If a unit is not understood, or the content does not follow the schema; of pictures and maps it says what takes
        them.
    """
    require_no_pixels(stored, path)
    ds = with_group(_understood(_listed(stored), path))
    validate(ds, origin=str(path))
    return ds


def require_no_pixels(stored: xr.Dataset, path: Path) -> None:
    """Raise if a file holds pictures, data of pixels or a map of parameters; the message says what takes them."""
    if "estimate" in stored.variables and "parameter" in stored.dims:
        raise DataError(
            f"{path}: holds a map of fitted parameters, not measurements: pbrdf.open_map opens it, `pbrdf identify` "
            "and pbrdf.identify_map tell the materials of its pixels"
        )
    require_no_pictures(stored, path)
    pixels = [str(d) for d in stored.dims if d not in (DIMENSION, *STOKES_AXES)]
    if DIMENSION in stored.dims and pixels and set(pixels) & _measured_dims(stored):
        raise DataError(
            f"{path}: holds data of pixels, with {', '.join(pixels)} beside {DIMENSION}: `pbrdf map` and pbrdf.fit_map "
            "fit a model to each, `pbrdf identify` and pbrdf.identify_map tell their materials; in Python open it by "
            "xarray.open_dataset"
        )


def require_no_pictures(stored: xr.Dataset, path: Path) -> None:
    """Raise if a file holds Stokes pictures, whose pixels have no angles yet; the message says what gives them any."""
    if "I" in stored.variables and {"y", "x"} <= set(stored.dims) and DIMENSION not in stored.dims:
        raise DataError(
            f"{path}: holds Stokes pictures, whose pixels have no geometry yet: `pbrdf map {path.name} -g flat:…` fits "
            "a model to each, and `pbrdf identify` takes that map; pbrdf.map_dataset makes data of them, for "
            "pbrdf.identify_map and pbrdf.fit_map; `pbrdf reduce --angles … --roi …` writes a data set of a region"
        )


def _listed(stored: xr.Dataset) -> xr.Dataset:
    """Data over a grid, with dimensions for angles (and wavelengths), as a list of them; other content as it is."""
    angles = ("theta_i", "theta_r", "phi")
    axes = [name for name in COORDINATES if name in stored.dims and name in stored.coords]
    if DIMENSION in stored.dims or not set(axes) & set(angles) or not set(angles) <= set(stored.coords):
        return stored
    listed = stored.stack({DIMENSION: axes}, create_index=False).transpose(DIMENSION, ...)
    count = listed.sizes[DIMENSION]
    alone = {
        name: ((DIMENSION,), np.full(count, listed[name].values), listed[name].attrs)
        for name in COORDINATES
        if name in listed.coords and not listed[name].dims
    }
    return listed.assign_coords(alone)


def _measured_dims(stored: xr.Dataset) -> set[str]:
    """Dimensions of what was measured."""
    return {str(d) for name in VARIABLES if name in stored.variables for d in stored[name].dims}


def pixels_from_stored(stored: xr.Dataset, path: Path) -> xr.Dataset:
    """The same for data with dimensions beside ``geometry``; what the schema says of data sets is not checked.

    Coordinates of those dimensions are kept, and ``mask``, which pixels are the sample.

    Parameters
    ----------
    stored
        Content of the file or a part of it, loaded into memory.
    path
        The file, for messages.

    Raises
    ------
    DataError
        If a unit is not understood, or Stokes components have other labels.
    """
    found = _understood(stored, path)
    own = {
        name: c for name, c in stored.coords.items() if set(c.dims) <= {name} and name not in found.variables
    }
    kept = {name: stored[name] for name in (_MASK,) if name in stored.data_vars}
    return found.assign_coords(own).assign(kept)


def _understood(stored: xr.Dataset, path: Path) -> xr.Dataset:
    """What the schema knows of a file's content, in its units, the Stokes components in order."""
    try:
        stored = in_stokes_order(stored)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    known = {*COORDINATES, *VARIABLES, *map(std_name, VARIABLES), COVARIANCE, *STOKES_AXES}
    attrs = {}
    for name, value in plain_attributes(stored.attrs).items():
        try:
            attrs[name] = _attribute_from_stored(value)
        except ValueError as error:
            raise DataError(f"{path}: the attribute {name} is not JSON, {error}") from error
    ignored = sorted(str(name) for name in stored.variables if name not in known)
    if ignored:
        attrs["ignored_variables"] = ignored
    coords: dict[str, Any] = {}
    data: dict[str, Any] = {}
    for name in sorted(known & set(map(str, stored.variables))):
        array = stored[name]
        target = coords if name in stored.coords or name in COORDINATES else data
        try:
            if name == "group":
                target[name] = (array.dims, group_labels(array.values))
            elif name in STOKES_AXES:
                target[name] = (array.dims, array.values.astype(np.str_))
            else:
                units = {"units": variable_units(name, str(attrs.get("quantity", "")))}
                target[name] = (array.dims, _from_file_units(path, name, array), units)
        except DataError:
            raise
        except (TypeError, ValueError) as error:
            raise DataError(f"{path}: {name} cannot be used as it is stored: {error}") from error
    return xr.Dataset(data, coords, attrs)


def _from_file_units(path: Path, name: str, array: xr.DataArray) -> NDArray[Any]:
    values = array.values
    if name not in ANGLES and name != "wavelength":
        return values
    table: Mapping[str, float] = _ANGLE_UNITS if name in ANGLES else NANOMETRES
    units = array.attrs.get("units", "rad" if name in ANGLES else "nm")
    if not isinstance(units, str) or units not in table:
        raise DataError(f"{path}: the units {units!r} of {name} are not understood; use {', '.join(table)}")
    if name in ANGLES:
        return np.deg2rad(values) if table[units] else values
    return values * table[units]


def to_stored(ds: xr.Dataset) -> xr.Dataset:
    """Turn a data set into what :func:`from_stored` turns back bit for bit.

    Raises
    ------
    DataError
        If `ds` does not follow the schema.
    """
    validate(ds)
    stored = with_group(ds).copy()
    for name in ANGLES:
        if name in ds.variables:
            degrees = exact_degrees(ds[name].values)
            if degrees is not None:
                stored[name] = (ds[name].dims, degrees, {**ds[name].attrs, "units": "degree"})
    stored.attrs = {name: _attribute_to_stored(value) for name, value in plain_attributes(ds.attrs).items()}
    return stored


def _attribute_to_stored(value: Any) -> Any:
    """What netCDF can hold: numbers, plain text, and lists of two or more numbers of one type."""
    if isinstance(value, str) and (value.startswith(_JSON) or "\0" in value):
        return _JSON + json.dumps(value)
    if isinstance(value, list) and (len(value) < 2 or {*map(type, value)} not in ({int}, {float})):
        return _JSON + json.dumps(value, ensure_ascii=False)
    return value


def _attribute_from_stored(value: Any) -> Any:
    return (
        json_from_text(value.removeprefix(_JSON))
        if isinstance(value, str) and value.startswith(_JSON)
        else value
    )
