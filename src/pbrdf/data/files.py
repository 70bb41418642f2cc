"""Reading and writing by file name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from pbrdf.data.cornell import read_cornell
from pbrdf.data.csv_table import header_names, read_csv, write_csv
from pbrdf.data.netcdf import read_netcdf, write_netcdf
from pbrdf.data.scatmech import has_scatmech_columns, read_scatmech
from pbrdf.data.storage import read_lines
from pbrdf.errors import DataError

__all__ = ["FORMATS", "read", "write"]

#: Readers by format name.
FORMATS: dict[str, Callable[..., xr.Dataset]] = {
    "csv": read_csv,
    "netcdf": read_netcdf,
    "scatmech": read_scatmech,
    "cornell": read_cornell,
}
_EXTENSIONS = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".nc": "netcdf",
    ".nc4": "netcdf",
    ".brdf": "cornell",
}
_WRITERS: dict[str, Callable[[xr.Dataset, Path], None]] = {".csv": write_csv, ".nc": write_netcdf}


def read(
    path: str | Path, *, column: Mapping[str, str] | None = None, format: str | None = None, **options: Any
) -> xr.Dataset:
    """Read measured or simulated data from a file.

    Parameters
    ----------
    path
        The file.
    column
        For CSV: the file's column names by the names used here, see :func:`pbrdf.data.csv_table.read_csv`.
    format
        ``"csv"``, ``"netcdf"``, ``"scatmech"`` or ``"cornell"``; None finds it out from the extension and,
        for text tables, the column names.
    **options
        Options of the format's reader: for ``"csv"`` those of :func:`pbrdf.data.csv_table.read_csv`
        (`where`, `skip_invalid`, `quantity`, `azimuth`, `stokes`, `illumination`, `cosine_weighted`,
        `angles`); for ``"scatmech"`` and ``"cornell"`` `wavelength` in nm, one or several.

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
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    name = format if format is not None else _detect(path)
    if name not in FORMATS:
        raise DataError(f"{path}: the format {name!r} is not known; use one of {', '.join(FORMATS)}")
    if column is not None:
        options["column"] = column
    reader = FORMATS[name]
    known = [p.name for p in inspect.signature(reader).parameters.values() if p.kind is p.KEYWORD_ONLY]
    for option in options:
        if option not in known:
            choices = f"its options are {', '.join(known)}" if known else "it has no options"
            raise DataError(f"{path}: the format {name} has no option {option!r}; {choices}")
    return reader(path, **options)


def _detect(path: Path) -> str:
    name = _EXTENSIONS.get(path.suffix.lower())
    if name is None:
        raise DataError(
            f"{path}: the extension {path.suffix!r} is not known; state the format, one of "
            f"{', '.join(FORMATS)}"
        )
    if name == "csv" and has_scatmech_columns(header_names(read_lines(path))):
        return "scatmech"
    return name


def write(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as ``.csv`` or ``.nc``, by the extension; reading it gives back the same bits.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The file; replaced, when the new one is complete, if it exists.

    Raises
    ------
    DataError
        If `ds` does not follow the schema, the extension is not known, or the file cannot be written.
    """
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise DataError(
            f"{path}: the extension {path.suffix!r} cannot be written; use {' or '.join(_WRITERS)}"
        )
    writer(ds, path)
