"""Zarr folders: the data set of :mod:`pbrdf.data.schema` as :mod:`pbrdf.data.formats.stored` says.

The third version of the format is written, text as its data type ``string``; the second is read as well.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import warnings
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import xarray as xr

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.stored import from_stored, to_stored
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_folder
from pbrdf.files.zarr_chunks import require_complete

__all__ = [
    "READER",
    "create_zarr",
    "is_zarr",
    "list_arrays",
    "open_zarr",
    "read_zarr",
    "require_zarr",
    "write_zarr",
]

#: A folder with one of these in it is a group of Zarr arrays.
_MARKS = (".zgroup", ".zmetadata", "zarr.json")
#: The first version of zarr whose files appear under their names when they are complete.
_OLDEST = (3, 1, 3)


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
    if not is_zarr(path):
        raise DataError(f"{path}: this is not a Zarr folder: it holds no {' or '.join(_MARKS)}")
    require_complete(path, loaded=loaded)
    try:
        opened = xr.open_dataset(path, engine="zarr", consolidated=False, **options)
        # NumPy turns its own type of text of any length into no other by itself
        plain = opened.assign(_as_objects(opened, "T"))
        plain.set_close(opened.close)
        return plain
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
    if path.exists() and not is_zarr(path):
        raise DataError(f"{path}: there is something else of that name, which is left alone; choose another")
    stored = to_stored(ds)
    with atomic_folder(path) as target:
        create_zarr(stored, target)
        list_arrays(target)


def create_zarr(ds: xr.Dataset, path: Path, **options: Any) -> None:
    """Write whatever data set as a new group of the third version of the format, with all its chunks.

    Parameters
    ----------
    ds
        What is written.
    path
        The folder.
    **options
        Of :meth:`xarray.Dataset.to_zarr`.

    Raises
    ------
    OSError
        If it cannot be written, or there is something of that name that is not an empty folder.
    """
    # text of fixed length has no type in the specification
    ds = ds.assign(_as_objects(ds, "U"))
    # a chunk that is left out because it is all fill value could not be told from one that was lost
    ds.to_zarr(path, mode="w-", zarr_format=3, consolidated=False, write_empty_chunks=True, **options)


def _as_objects(ds: xr.Dataset, kind: str) -> dict[Hashable, xr.Variable]:
    """The variables of a kind of text, loaded, of whichever length."""
    return {
        name: variable.astype(object)
        for name, variable in ds.variables.items()
        if variable.dtype.kind == kind
    }


def list_arrays(path: Path) -> None:
    """List a group's arrays in its ``zarr.json``, so that one that is lost is missed."""
    import zarr

    with warnings.catch_warnings():
        # the list is not in the specification, which lets readers pass over it
        warnings.filterwarnings("ignore", message="Consolidated metadata")
        zarr.consolidate_metadata(path, zarr_format=3)


def is_zarr(path: Path) -> bool:
    """Whether a folder is a Zarr group, of whichever version."""
    return any((path / mark).is_file() for mark in _MARKS)


def require_zarr(path: Path) -> None:
    """Check that zarr is installed; raises DataError, which names the file and says how to install it."""
    if importlib.util.find_spec("zarr") is None:
        raise DataError(f"{path}: .zarr needs the package zarr: pip install zarr, or use .nc instead")
    version = importlib.metadata.version("zarr")
    if tuple(map(int, re.findall(r"\d+", version)[:3])) < _OLDEST:
        oldest = ".".join(map(str, _OLDEST))
        raise DataError(f"{path}: .zarr needs zarr {oldest} or newer, not {version}: pip install -U zarr")


READER = Reader("zarr", read_zarr, extensions=(".zarr",), sniff=is_zarr, write=write_zarr, folder=True)
