"""netCDF-4 files by h5netcdf: the data set of :mod:`pbrdf.data.schema` as :mod:`pbrdf.data.formats.stored` says."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.stored import from_stored, to_stored
from pbrdf.files.atomic import atomic_file
from pbrdf.files.netcdf_files import SIGNATURE, load_netcdf, write_netcdf_file
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_netcdf", "write_netcdf"]


def read_netcdf(path: str | Path) -> xr.Dataset:
    """Read a data set from a netCDF file; :func:`pbrdf.data.formats.stored.from_stored` says how it is understood.

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
    (stored,) = load_netcdf(path, decode_times=False)
    return from_stored(stored, path)


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
    stored = to_stored(ds)
    with atomic_file(Path(path)) as target:
        write_netcdf_file(target, {"/": stored})


def _begins_as_hdf5(path: Path) -> bool:
    return first_bytes(path, len(SIGNATURE)) == SIGNATURE


READER = Reader(
    "netcdf",
    read_netcdf,
    extensions=(".nc", ".nc4"),
    sniff=_begins_as_hdf5,
    write=write_netcdf,
    written=(".nc",),
)
