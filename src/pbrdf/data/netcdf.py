"""netCDF files.

The variables, coordinates and attributes of :mod:`pbrdf.data.schema`, in netCDF-4 through h5netcdf. Angles
are stored in degrees with ``units = "degree"``, or in radians with ``units = "rad"`` where a value has no
exact counterpart in degrees, so that reading gives back the same bits. Attributes that netCDF cannot hold
(lists of text, of one element or of mixed types) are stored as JSON text.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.build import group_labels
from pbrdf.data.schema import (
    ANGLES,
    COORDINATES,
    VARIABLES,
    std_name,
    variable_units,
)
from pbrdf.data.storage import (
    atomic_target,
    exact_degrees,
    plain_attributes,
)
from pbrdf.data.validate import validate
from pbrdf.errors import DataError

__all__ = ["read_netcdf", "write_netcdf"]

_ENGINE: Final = "h5netcdf"
_ANGLE_UNITS = {"degree": True, "degrees": True, "deg": True, "rad": False, "radian": False, "radians": False}
_NANOMETRES = {
    "nm": 1.0,
    "nanometer": 1.0,
    "nanometre": 1.0,
    "um": 1e3,
    "µm": 1e3,
    "micrometer": 1e3,
    "micrometre": 1e3,
}
_JSON = "json:"


def read_netcdf(path: str | Path) -> xr.Dataset:
    """Read a data set from a netCDF file.

    Angles and wavelengths are converted by their attribute ``units``; without one they are taken in radians
    and nm. Variables that the schema does not know are left out and listed in the attribute
    ``ignored_variables``.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    xarray.Dataset
        A valid data set, loaded into memory.

    Raises
    ------
    DataError
        If it is not a netCDF file or does not follow the schema.
    """
    path = Path(path)
    try:
        with xr.open_dataset(path, engine=_ENGINE, decode_times=False) as file:
            stored = file.load()
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as netCDF: {error}") from error

    known = {*COORDINATES, *VARIABLES, *map(std_name, VARIABLES), "stokes_out", "stokes_in"}
    attrs = {name: _from_stored(value) for name, value in plain_attributes(stored.attrs).items()}
    ignored = sorted(str(name) for name in stored.variables if name not in known)
    if ignored:
        attrs["ignored_variables"] = ignored
    coords: dict[str, Any] = {}
    data: dict[str, Any] = {}
    for name in sorted(known & set(map(str, stored.variables))):
        array = stored[name]
        target = coords if name in stored.coords or name in COORDINATES else data
        if name == "group":
            target[name] = (array.dims, group_labels(array.values))
        elif name in ("stokes_out", "stokes_in"):
            target[name] = (array.dims, array.values.astype(np.str_))
        else:
            units = {"units": variable_units(name, attrs.get("quantity", ""))}
            target[name] = (array.dims, _from_file_units(path, name, array), units)
    ds = xr.Dataset(data, coords, attrs)
    validate(ds, origin=str(path))
    return ds


def _from_file_units(path: Path, name: str, array: xr.DataArray) -> NDArray[Any]:
    values = array.values
    if name not in ANGLES and name != "wavelength":
        return values
    table: Mapping[str, float] = _ANGLE_UNITS if name in ANGLES else _NANOMETRES
    units = array.attrs.get("units", "rad" if name in ANGLES else "nm")
    if units not in table:
        raise DataError(f"{path}: the units {units!r} of {name} are not understood; use {', '.join(table)}")
    if name in ANGLES:
        return np.deg2rad(values) if table[units] else values
    return values * table[units]


def write_netcdf(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as a netCDF-4 file that :func:`read_netcdf` reads back bit for bit.

    The file appears under its name only when it is complete.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The file; replaced if it exists.

    Raises
    ------
    DataError
        If `ds` does not follow the schema or the file cannot be written.
    """
    path = Path(path)
    validate(ds)
    stored = ds.copy()
    for name in ANGLES:
        if name in ds.variables:
            degrees = exact_degrees(ds[name].values)
            if degrees is not None:
                stored[name] = (ds[name].dims, degrees, {**ds[name].attrs, "units": "degree"})
    stored.attrs = {name: _to_stored(value) for name, value in plain_attributes(ds.attrs).items()}
    with atomic_target(path) as target:
        stored.to_netcdf(target, engine=_ENGINE, format="NETCDF4")


def _to_stored(value: Any) -> Any:
    """What netCDF can hold: numbers, plain text, and lists of two or more numbers of one type."""
    if isinstance(value, str) and (value.startswith(_JSON) or "\0" in value):
        return _JSON + json.dumps(value)
    if isinstance(value, list) and (len(value) < 2 or {*map(type, value)} not in ({int}, {float})):
        return _JSON + json.dumps(value, ensure_ascii=False)
    return value


def _from_stored(value: Any) -> Any:
    return (
        json.loads(value.removeprefix(_JSON)) if isinstance(value, str) and value.startswith(_JSON) else value
    )
