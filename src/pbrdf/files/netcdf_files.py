"""netCDF-4 files by h5netcdf: read under guard, written whole.

Reading goes through :mod:`pbrdf.files.hdf5_guard`. A file is made in memory and then written as any other: where the
disk is full, the HDF5 library may end the whole program as it closes the file.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.errors import DataError
from pbrdf.files.hdf5_guard import Look

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SIGNATURE", "load_netcdf", "open_netcdf", "write_netcdf_file"]

#: How HDF5 files begin, of which netCDF-4 is a kind.
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def load_netcdf(
    path: Path, groups: Sequence[str] = ("/",), *, kind: str = "netCDF", **options: Any
) -> list[xr.Dataset]:
    """Content of groups of a netCDF file, loaded into memory.

    Parameters
    ----------
    path
        The file.
    groups
        Names of the groups, ``"/"`` for the root.
    kind
        What the file should be, for messages.
    **options
        Of :func:`xarray.open_dataset`.

    Raises
    ------
    DataError
        If the file is not there, not netCDF, damaged, declares more than it holds, or keeps it in another file.
    """
    look = _begun(path, groups, kind)
    import xarray as xr  # meanwhile

    look.require_sound()
    try:
        found = []
        for group in groups:
            with xr.open_dataset(path, engine="h5netcdf", group=group, **options) as file:
                found.append(file.load())
        return found
    except Exception as error:  # the library raises anything over a damaged file
        raise _unreadable(path, kind, error) from error


def open_netcdf(path: Path, **options: Any) -> xr.Dataset:
    """A netCDF file whose numbers are read when they are asked for; otherwise as :func:`load_netcdf`."""
    look = _begun(path, ("/",), "netCDF", values=False)
    import xarray as xr

    look.require_sound()
    try:
        return xr.open_dataset(path, engine="h5netcdf", **options)
    except Exception as error:  # the library raises anything over a damaged file
        raise _unreadable(path, "netCDF", error) from error


def _begun(path: Path, groups: Sequence[str], kind: str, *, values: bool = True) -> Look:
    try:
        with path.open("rb"):
            pass
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    return Look(path, groups, values=values, kind=kind)


def _unreadable(path: Path, kind: str, error: Exception) -> DataError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else error
    return DataError(
        f"{path}: cannot be read as {kind}: {' '.join(str(reason).split()) or type(error).__name__}"
    )


def write_netcdf_file(path: Path, groups: Mapping[str, xr.Dataset]) -> None:
    """Write data sets as groups of a new file, ``"/"`` as its root.

    Raises
    ------
    OSError
        If the file cannot be written; where it is not to replace another before it is complete, `path` is a name that
        :func:`pbrdf.files.atomic.atomic_file` gives.
    """
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        for name, dataset in groups.items():
            dataset.dump_to_store(H5NetCDFStore(file, group=None if name == "/" else name))
    with path.open("wb") as target:
        target.write(content.getbuffer())
