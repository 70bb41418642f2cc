"""Tables of measurements whose materials are known, as the command line takes them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.cli.reading import Reading
from pbrdf.cli.specimens import open_compared, open_parameters
from pbrdf.errors import DataError, PbrdfError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.labelled import Labelled
    from pbrdf.identification.library import Library

__all__ = ["read_labelled", "read_pixel_labels"]

#: Columns of a table.
_COLUMNS = ("file", "material")


def read_labelled(
    option: str, table: Path, library: Library, reading: Reading, *, strangers: bool
) -> list[Labelled]:
    """Materials and data of a table of labels; files are looked for beside it.

    Parameters
    ----------
    option
        Which names the table, for messages.
    table, library, reading
        The table, what its names are of, and how its files are read.
    strangers
        Whether names that the library has not got are let through.

    Raises
    ------
    PbrdfError
        If the table or a file of it cannot be read; the line is named.
    """
    from pbrdf.files.text import read_bytes, utf8

    rows = csv.DictReader(utf8(table, read_bytes(table)).decode().splitlines(), skipinitialspace=True)
    columns = [str(column).strip() for column in rows.fieldnames or ()]
    if not set(_COLUMNS) <= set(columns):
        raise DataError(f"{option} {table}: its columns must be file,material; they are {', '.join(columns)}")
    rows.fieldnames = columns
    labelled: list[Labelled] = []
    for row in rows:
        source, material = ((row[column] or "").strip() for column in _COLUMNS)
        at = f"{option} {table}: line {rows.line_num}"
        if not source or not material:
            raise DataError(f"{at}: file or material is missing")
        if material not in library.names and not strangers:
            raise DataError(
                f"{at}: the library has no material {material!r}; it has {', '.join(library.names)}"
            )
        beside = table.parent / source
        place = str(beside) if beside.exists() else source
        try:
            fitted = open_parameters(place, reading)
            if fitted is not None:
                labelled.append((material, fitted))
            else:
                measured = open_compared(place, reading)
                labelled.append((material, measured.fit or measured.dataset))
        except PbrdfError as error:
            raise DataError(f"{at}: {error}") from error
    if not labelled:
        raise DataError(f"{option} {table}: there is no row below the names of the columns")
    return labelled


def read_pixel_labels(option: str, path: Path, pixels: xr.Dataset) -> xr.DataArray:
    """Labels of the pixels of a map.

    Raises
    ------
    PbrdfError
        If the file cannot be read, or is not of this map.
    """
    from pbrdf.identification.labelled_pixels import image_of, read_material_labels

    try:
        return read_material_labels(path, image_of(pixels))
    except DataError as error:
        raise DataError(f"{option} {error}") from error
