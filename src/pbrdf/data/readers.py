"""Reading and writing by file name: the formats that are known, and how others join them.

A format is a :class:`pbrdf.data.formats.declaration.Reader`. There are those of this package, those that installed
packages declare in the entry-point group ``pbrdf.readers``, and those that :func:`register_reader` adds. Modules of
formats are loaded when a file is read or written; their names alone, as a help text needs them, load nothing.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.data.formats.declaration import Reader
from pbrdf.errors import DataError, PbrdfError, PluginWarning

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "GROUP",
    "format_names",
    "format_of",
    "read",
    "register_reader",
    "write",
    "written_extensions",
]

#: Entry points of this group are readers: the name is that of the format, the object a ``Reader``.
GROUP = "pbrdf.readers"

#: The modules of the formats of this package, each with its declaration, ``READER``.
_OWN = {
    "csv": "pbrdf.data.formats.csv_table.reading",
    "netcdf": "pbrdf.data.formats.netcdf",
    "zarr": "pbrdf.data.formats.zarr_folder",
    "scatmech": "pbrdf.data.formats.scatmech",
    "cornell": "pbrdf.data.formats.cornell",
    "zemax": "pbrdf.data.formats.zemax",
    "rgl": "pbrdf.data.formats.rgl",
    "pbsdf": "pbrdf.data.formats.pbsdf",
    "spectraray": "pbrdf.data.formats.spectraray",
    # by name alone, for it stands a floor above, where readings are reduced
    "readings": "pbrdf.instruments.reduction.reading_tables",
    "merl": "pbrdf.data.formats.merl",
    "fred": "pbrdf.data.formats.fred",
    "speos": "pbrdf.data.formats.speos",
    "openmaterial": "pbrdf.data.formats.openmaterial",
    "matlab": "pbrdf.data.formats.matlab",
    "lighttools": "pbrdf.data.formats.lighttools",
    "woollam": "pbrdf.data.formats.woollam",
    "alta": "pbrdf.data.formats.alta",
    "astm": "pbrdf.data.formats.astm",
}
_registered: dict[str, Reader] = {}


def register_reader(reader: Reader) -> None:
    """Make a format known to :func:`read`, :func:`write` and the command line for as long as the program runs.

    Parameters
    ----------
    reader
        Its declaration. It goes before the readers of installed packages, and before one that was registered under the
        same name.

    Raises
    ------
    DataError
        If a format of this package has its name.
    """
    if reader.name in _OWN:
        raise DataError(f"reader {reader.name!r}: a format of pbrdf itself has this name; choose another")
    _registered[reader.name] = reader


def format_names() -> list[str]:
    """Names of all formats."""
    installed = (entry.name for entry in importlib.metadata.entry_points(group=GROUP))
    return list(dict.fromkeys((*_OWN, *_registered, *installed)))


def format_of(path: str | Path) -> str | None:
    """Name of the format that a file, or a folder, has by its content or its extension; None if it has none."""
    path = Path(path)
    return next(
        (reader.name for reader in _readers() if _sniffs(reader, path)),
        next((reader.name for reader in _readers() if path.suffix.lower() in reader.extensions), None),
    )


def written_extensions() -> list[str]:
    """Extensions of the files that :func:`write` writes."""
    return list(dict.fromkeys(extension for reader in _readers() for extension in reader.written))


def read(
    path: str | Path, *, column: Mapping[str, str] | None = None, format: str | None = None, **options: Any
) -> xr.Dataset:
    """Read measured or simulated data from a file.

    Parameters
    ----------
    path
        The file; for Zarr the folder.
    column
        For CSV: the file's column names by the names used here, see
        :func:`pbrdf.data.formats.csv_table.reading.read_csv`.
    format
        One of :func:`format_names`: ``"csv"``, ``"netcdf"``, ``"zarr"``, ``"pbsdf"``, ``"zemax"`` …, or one that was
        added (:func:`register_reader`); None finds it out from the extension and the content.
    **options
        Options of the format's reader: for ``"csv"`` those of :func:`pbrdf.data.formats.csv_table.reading.read_csv`
        (`where`, `skip_invalid`, `quantity`, `azimuth`, `stokes`, `illumination`, `cosine_weighted`,
        `angles`, `unit`, `coverage`, `scale`, `ignore`, `sheet`); for formats with wavelengths of their own
        `wavelength` in nm, one or several; for those of tables over a grid of angles `every`, see
        :func:`pbrdf.data.formats.pbsdf.read_pbsdf`.

    Returns
    -------
    xarray.Dataset
        A valid data set, described in :mod:`pbrdf.data.schema`.

    Raises
    ------
    DataError
        If the file, its format or an option is not understood; names line and column where there is one.
    """
    path = Path(path)
    if not path.exists():
        raise DataError(f"{path}: there is no such file")
    reader = _of_content(path) if format is None else _of_name(path, format)
    if path.is_dir() and not reader.folder:
        raise DataError(f"{path}: this is a folder; name a file in it")
    if column is not None:
        options["column"] = column
    for option in options:
        if option not in reader.options:
            choices = (
                f"its options are {', '.join(reader.options)}" if reader.options else "it has no options"
            )
            raise DataError(f"{path}: the format {reader.name} has no option {option!r}; {choices}")
    return reader.read(path, **options) if reader.name in _OWN else _read_checked(reader, path, options)


def write(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as ``.csv``, ``.nc``, ``.zarr`` or in a format that was added, by the extension.

    Reading it gives back the same bits.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The file (for Zarr the folder); replaced, when the new one is complete, if it exists.

    Raises
    ------
    DataError
        If `ds` does not follow the schema, the extension is not known, or the file cannot be written.
    """
    path = Path(path)
    extension = path.suffix.lower()
    for reader in _readers():
        if reader.write is not None and extension in reader.written:
            if reader.name in _OWN:
                reader.write(ds, path)
            else:
                _write_checked(reader.name, reader.write, ds, path)
            return
    raise DataError(
        f"{path}: the extension {path.suffix!r} cannot be written; use {' or '.join(written_extensions())}"
    )


def _own(name: str) -> Reader:
    found: Reader = importlib.import_module(_OWN[name]).READER
    return found


def _readers() -> Iterator[Reader]:
    """All readers, in the order in which they are asked."""
    yield from reversed(_registered.values())
    yield from map(_own, _OWN)
    yield from (reader for name, reader in _installed()[0].items() if name not in _registered)


def _of_name(path: Path, name: str) -> Reader:
    if name in _registered:
        return _registered[name]
    if name in _OWN:
        return _own(name)
    installed, broken = _installed()
    if name in installed:
        return installed[name]
    if name in broken:
        raise DataError(f"{path}: {broken[name]}")
    raise DataError(f"{path}: the format {name!r} is not known; use one of {', '.join(format_names())}")


def _of_content(path: Path) -> Reader:
    """The reader of a file.

    That of its extension which knows its content; else one of this package that knows it; else one of its extension
    that does not look at the content; else any that knows it; else one of its extension, which then says what is
    wrong.
    """
    readers = list(_readers())
    named = [reader for reader in readers if path.suffix.lower() in reader.extensions]
    plain = [reader for reader in named if reader.sniff is None]
    asked = [*named, *(reader for reader in readers if not plain or reader.name in _OWN)]
    known = next((reader for reader in asked if _sniffs(reader, path)), None)
    found = [*([] if known is None else [known]), *plain, *named]
    if not found and path.is_file() and _has_angles(path):
        found = [_own("csv")]
    if path.is_dir():
        found = [reader for reader in found if reader.folder]
        if not found:
            raise DataError(f"{path}: this is a folder; name a file in it")
    if not found:
        also = "".join(f"; {sentence}" for sentence in _installed()[1].values())
        raise DataError(
            f"{path}: the extension {path.suffix!r} is not known; state the format, one of "
            f"{', '.join(format_names())}{also}"
        )
    return found[0]


def _has_angles(path: Path) -> bool:
    """Whether a file of an extension that no format has is a table with columns of zenith angles."""
    from pbrdf.files.delimited import column_names

    return any(re.search("theta|zenith|inciden|aoi", name.lower()) for name in column_names(path))


def _sniffs(reader: Reader, path: Path) -> bool:
    """Whether a reader knows the content of a path; one that fails at it does not, whoever wrote it."""
    if reader.sniff is None or reader.folder != path.is_dir():
        return False
    try:
        return bool(reader.sniff(path))
    except Exception as error:
        warnings.warn(
            f"{path}: the reader {reader.name!r} fails to recognise it: {_told(error)}",
            PluginWarning,
            stacklevel=5,
        )
        return False


def _read_checked(reader: Reader, path: Path, options: Mapping[str, Any]) -> xr.Dataset:
    """What a reader of others gives, checked: neither its mistakes nor its data get any further."""
    import xarray as xr

    from pbrdf.data.schema import with_group
    from pbrdf.data.validation import validate

    try:
        ds = reader.read(path, **options)
    except PbrdfError:
        raise
    except Exception as error:
        raise DataError(f"{path}: the reader {reader.name!r} fails at it: {_told(error)}") from error
    if not isinstance(ds, xr.Dataset):
        raise DataError(f"{path}: the reader {reader.name!r} gives {type(ds).__name__}, not a data set")
    validate(ds, origin=str(path))
    return with_group(ds)


def _write_checked(
    name: str, function: Callable[[xr.Dataset, Path], None], ds: xr.Dataset, path: Path
) -> None:
    """Let a writer of others write what is valid."""
    from pbrdf.data.schema import with_group
    from pbrdf.data.validation import validate

    validate(ds)
    try:
        function(with_group(ds), path)
    except PbrdfError:
        raise
    except Exception as error:
        raise DataError(f"{path}: the writer {name!r} fails at it: {_told(error)}") from error


@functools.cache
def _installed() -> tuple[dict[str, Reader], dict[str, str]]:
    """Readers of installed packages by name, and by name what is wrong with those that cannot be used."""
    readers: dict[str, Reader] = {}
    broken: dict[str, str] = {}
    for entry in importlib.metadata.entry_points(group=GROUP):
        try:
            reader = entry.load()
            if not isinstance(reader, Reader):
                raise TypeError(f"{entry.value} is a {type(reader).__name__}, not a Reader")
            if reader.name != entry.name:
                raise ValueError(f"{entry.value} is the reader {reader.name!r}")
            if reader.name in (*_OWN, *readers):
                raise ValueError("a format of pbrdf or of another package has this name")
        except Exception as error:
            package = f" of the package {entry.dist.name}" if entry.dist is not None else ""
            broken[entry.name] = (
                f"the reader {entry.name!r}{package} cannot be loaded ({_told(error)}); repair or remove that package"
            )
            warnings.warn(broken[entry.name], PluginWarning, stacklevel=5)
        else:
            readers[reader.name] = reader
    return readers, broken


def _told(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
