"""Reading and writing by file name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from pbrdf.data.formats.cornell import read_cornell
from pbrdf.data.formats.csv_table import header_names, read_csv, write_csv
from pbrdf.data.formats.merl import read_merl
from pbrdf.data.formats.netcdf import read_netcdf, write_netcdf
from pbrdf.data.formats.pbsdf import read_pbsdf
from pbrdf.data.formats.scatmech import has_scatmech_columns, read_scatmech
from pbrdf.data.formats.zarr_folder import read_zarr, write_zarr
from pbrdf.errors import DataError
from pbrdf.files.text import read_lines

__all__ = ["FORMATS", "read", "write"]

#: Readers by format name.
FORMATS: dict[str, Callable[..., xr.Dataset]] = {
    "csv": read_csv,
    "netcdf": read_netcdf,
    "zarr": read_zarr,
    "scatmech": read_scatmech,
    "cornell": read_cornell,
    "pbsdf": read_pbsdf,
    "merl": read_merl,
}
_EXTENSIONS = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".nc": "netcdf",
    ".nc4": "netcdf",
    ".zarr": "zarr",
    ".brdf": "cornell",
    ".pbsdf": "pbsdf",
    ".binary": "merl",
}
_WRITERS: dict[str, Callable[[xr.Dataset, Path], None]] = {
    ".csv": write_csv,
    ".nc": write_netcdf,
    ".zarr": write_zarr,
}


def read(
    path: str | Path, *, column: Mapping[str, str] | None = None, format: str | None = None, **options: Any
) -> xr.Dataset:
    """Read measured or simulated data from a file.

    Parameters
    ----------
    path
        The file; for Zarr the folder.
    column
        For CSV: the file's column names by the names used here, see :func:`pbrdf.data.formats.csv_table.read_csv`.
    format
        ``"csv"``, ``"netcdf"``, ``"zarr"``, ``"scatmech"``, ``"cornell"``, ``"pbsdf"`` or ``"merl"``; None finds it out
        from the extension and, for text tables, the column names.
    **options
        Options of the format's reader: for ``"csv"`` those of :func:`pbrdf.data.formats.csv_table.read_csv`
        (`where`, `skip_invalid`, `quantity`, `azimuth`, `stokes`, `illumination`, `cosine_weighted`,
        `angles`); for ``"scatmech"``, ``"cornell"`` and ``"pbsdf"`` `wavelength` in nm, one or several; for
        ``"pbsdf"`` and ``"merl"`` `every`, see :func:`pbrdf.data.formats.pbsdf.read_pbsdf`.

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
    if path.is_dir() and (format or _EXTENSIONS.get(path.suffix.lower())) != "zarr":
        raise DataError(f"{path}: this is a folder; name a file in it")
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
    """Write a data set as ``.csv``, ``.nc`` or ``.zarr``, by the extension; reading it gives back the same bits.

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
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise DataError(
            f"{path}: the extension {path.suffix!r} cannot be written; use {' or '.join(_WRITERS)}"
        )
    writer(ds, path)
