"""Zarr folders: the data set of :mod:`pbrdf.data.schema` as :mod:`pbrdf.data.formats.stored` says.

The second version of the format is written, as the third has no agreed type for text; both are read.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import xarray as xr

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.stored import from_stored, to_stored
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_folder
from pbrdf.files.zarr_chunks import require_complete

__all__ = ["READER", "open_zarr", "read_zarr", "require_zarr", "write_zarr"]

#: A folder with one of these in it is a group of Zarr arrays.
_MARKS = (".zgroup", ".zmetadata", "zarr.json")


def read_zarr(path: str | Path) -> xr.Dataset:
    """Read a data set from a Zarr folder; :func:`pbrdf.data.formats.stored.from_stored` says how it is understood.

    Parameters
    ----------
    path
        The folder.

    Returns
    -------
    xarray.Dataset
        A valid data set, loaded into memory.

    Raises
    ------
    DataError
        If zarr is not installed, the folder is not one of Zarr, or it does not follow the schema.
    """
    path = Path(path)
    with open_zarr(path, loaded=True, decode_times=False) as file:
        try:
            stored = file.load()
        except Exception as error:  # decoders raise anything over a damaged chunk
            raise _unreadable(path, error) from error
    return from_stored(stored, path)


def open_zarr(path: Path, *, loaded: bool = False, **options: Any) -> xr.Dataset:
    """A Zarr folder whose numbers are read when they are asked for.

    Parameters
    ----------
    path
        The folder.
    loaded
        Whether all of it is going to be in memory.
    **options
        Of :func:`xarray.open_dataset`.

    Raises
    ------
    DataError
        If zarr is not installed, the folder is not one of Zarr, or an array or a chunk of it is missing or cut off.
    """
    require_zarr(path)
    if not _is_group(path):
        raise DataError(f"{path}: this is not a Zarr folder: it holds no {' or '.join(_MARKS)}")
    require_complete(path, loaded=loaded)
    try:
        return xr.open_dataset(path, engine="zarr", consolidated=False, **options)
    except Exception as error:  # the library raises anything over damaged metadata
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> DataError:
    return DataError(
        f"{path}: cannot be read as Zarr: {' '.join(str(error).split()) or type(error).__name__}"
    )


def write_zarr(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as a Zarr folder that :func:`read_zarr` reads back bit for bit.

    The folder appears under its name only when it is complete.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The folder; replaced if it is one of Zarr.

    Raises
    ------
    DataError
        If zarr is not installed, `ds` does not follow the schema, something else has that name, or the folder
        cannot be written.
    """
    path = Path(path)
    require_zarr(path)
    if path.exists() and not _is_group(path):
        raise DataError(f"{path}: there is something else of that name, which is left alone; choose another")
    stored = to_stored(ds)
    with atomic_folder(path) as target:
        # a chunk that is left out because it is all fill value could not be told from one that was lost
        stored.to_zarr(target, mode="w", zarr_format=2, consolidated=True, write_empty_chunks=True)


def _is_group(path: Path) -> bool:
    return any((path / mark).is_file() for mark in _MARKS)


def require_zarr(path: Path) -> None:
    """Check that zarr is installed; raises DataError, which names the file and says how to install it."""
    if importlib.util.find_spec("zarr") is None:
        raise DataError(f"{path}: .zarr needs the package zarr: pip install zarr, or use .nc instead")


READER = Reader("zarr", read_zarr, extensions=(".zarr",), sniff=_is_group, write=write_zarr, folder=True)
