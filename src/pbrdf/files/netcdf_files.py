"""netCDF-4 files by h5netcdf: read under guard, written whole.

Reading goes through :mod:`pbrdf.files.hdf5_guard`. Where the disk is full, the HDF5 library may end the whole program
as it closes the file. So a file is made in memory and then written as any other, and one that is too large for that is
written through :class:`PatientFile`.
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
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        for name, dataset in groups.items():
            dataset.dump_to_store(H5NetCDFStore(file, group=None if name == "/" else name))
    with path.open("wb") as target:
        target.write(content.getbuffer())


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
