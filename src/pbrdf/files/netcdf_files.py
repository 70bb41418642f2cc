"""netCDF-4 files: read by h5netcdf under guard, written whole by h5py.

Reading goes through :mod:`pbrdf.files.hdf5_guard`. Where the disk is full, the HDF5 library may end the whole program
as it closes the file. So a file is made in memory and then written as any other, and one that is too large for that is
written through :class:`PatientFile`.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.hdf5_guard import Look
from pbrdf.version import __version__

if TYPE_CHECKING:
    import h5py
    import xarray as xr

__all__ = ["SIGNATURE", "PatientFile", "load_netcdf", "open_netcdf", "write_netcdf_file"]

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
    look = _begun(path, ("/",), "netCDF", loaded=False)
    import xarray as xr

    look.require_sound()
    try:
        return xr.open_dataset(path, engine="h5netcdf", **options)
    except Exception as error:  # the library raises anything over a damaged file
        raise _unreadable(path, "netCDF", error) from error


def _begun(path: Path, groups: Sequence[str], kind: str, *, loaded: bool = True) -> Look:
    try:
        with path.open("rb"):
            pass
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    return Look(path, groups, loaded=loaded, kind=kind)


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
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w", track_order=True) as file:
        file.attrs["_NCProperties"] = np.bytes_(
            f"version=2,pbrdf={__version__},hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}"
        )
        numbers = itertools.count()
        for name, dataset in groups.items():
            _write_group(file if name == "/" else file.create_group(name, track_order=True), dataset, numbers)
    with path.open("wb") as target:
        target.write(content.getbuffer())


def _write_group(group: h5py.Group, dataset: xr.Dataset, numbers: Iterator[int]) -> None:
    """Write a data set's variables, dimensions and attributes as netCDF-4 lays them out in HDF5.

    The dimensions take their `numbers`, which differ throughout the file.

    Straight through h5py: :meth:`xarray.Dataset.to_netcdf` looks up every dimension anew for every variable, which for
    the many small variables of a fit takes four times as long.
    """
    import h5py
    from xarray import conventions

    variables, attributes = conventions.encode_dataset_coordinates(dataset)
    variables, attributes = conventions.cf_encoder(variables, attributes)
    written = {}
    # those that give a dimension its values come first: they are what the others are laid along
    for name, variable in sorted(variables.items(), key=lambda item: item[1].dims != (item[0],)):
        values, named = variable.values, dict(variable.attrs)
        text = values.dtype.kind in "UO"
        kind = h5py.string_dtype() if text else values.dtype
        fill = named.get("_FillValue")
        if name in dataset.sizes and variable.dims != (name,):
            stored_as = f"_nc4_non_coord_{name}"
        else:
            stored_as = str(name)
        written[name] = group.create_dataset(
            stored_as,
            data=values.astype(object) if text else values,
            dtype=kind,
            fillvalue=None if text else fill,
            track_order=True,
        )
        if fill is not None and not text:
            named["_FillValue"] = np.asarray(fill, values.dtype)
        _set_attributes(written[name], named)
    scales = {}
    for name, size in dataset.sizes.items():
        scale = written.get(name) if name in variables and variables[name].dims == (name,) else None
        if scale is None:
            scale = group.create_dataset(str(name), shape=(size,), dtype=">f4")
            scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10}")
        else:
            scale.make_scale(str(name))
        scale.attrs["_Netcdf4Dimid"] = np.int32(next(numbers))
        scales[name] = scale
    for name, variable in variables.items():
        for axis, along in enumerate(variable.dims):
            if along != name:
                written[name].dims[axis].attach_scale(scales[along])
    _set_attributes(group, attributes)


def _set_attributes(place: h5py.Group | h5py.Dataset, attributes: Mapping[Any, Any]) -> None:
    for name, value in attributes.items():
        array = np.asarray(value)
        # a number is an array of one in netCDF
        place.attrs[str(name)] = value if array.dtype.kind in "SUO" else np.atleast_1d(array)


class PatientFile(io.RawIOBase):
    """A file that is there, for the HDF5 library to write to, in which no write fails as far as that can see.

    Attributes
    ----------
    error
        What went wrong first, None as long as nothing did; what comes later is dropped.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b", buffering=0)
        self.error: OSError | None = None

    def require_written(self) -> None:
        """Raises OSError if something went wrong."""
        if self.error is not None:
            raise self.error

    def write(self, content: Any, /) -> int:
        """Write all of it."""
        rest = memoryview(content).cast("B")
        length = len(rest)
        try:
            while self.error is None and len(rest):
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
        return length

    def truncate(self, size: int | None = None, /) -> int:
        """Make the file as long as this."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any, /) -> int | None:
        return self._file.readinto(buffer)

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        self._file.close()
        super().close()
