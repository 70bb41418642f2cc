"""CSV tables as data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import xarray as xr

from pbrdf.data.formats.csv_table.assembly import to_dataset
from pbrdf.data.formats.csv_table.columns import resolve_columns
from pbrdf.data.formats.csv_table.header import Header, statements
from pbrdf.data.formats.csv_table.values import column_values
from pbrdf.data.formats.csv_table.writing import write_csv
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.validation import check, validate
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table, read_table

__all__ = ["READER", "read_csv"]

#: Characters of a column's name; more are a damaged line.
_LONGEST_NAME = 1000


def read_csv(
    path: str | Path,
    *,
    column: Mapping[str, str] | None = None,
    where: Mapping[str, str] | None = None,
    skip_invalid: bool = False,
    quantity: str | None = None,
    azimuth: str | None = None,
    stokes: str | None = None,
    illumination: str | Sequence[float] | None = None,
    cosine_weighted: bool | str | None = None,
    angles: str | None = None,
) -> xr.Dataset:
    """Read a CSV table; :mod:`pbrdf.data.formats.csv_table` describes the format.

    Parameters
    ----------
    path
        The file.
    column
        The file's names for the columns, by the name used here: ``{"I": "f_r_per_sr"}``. A unit in the
        file's name counts. A value that begins with ``=`` is a constant for all rows, in the unit of the
        header's ``angles``, or in nm: ``{"phi": "=0", "wavelength": "=550"}``.
    where
        Take only the rows that have this text in these columns, by the file's names:
        ``{"material": "white"}``.
    skip_invalid
        Leave out rows with angles or values that the schema does not allow, and rows where nothing was
        measured. How many is recorded in the attribute ``skipped_rows``.
    quantity, azimuth, stokes, illumination, cosine_weighted, angles
        As the header keys of the same names, for files that do not state them, or state them wrongly.

    Returns
    -------
    xarray.Dataset
        A valid data set in the project's conventions, radians.

    Raises
    ------
    DataError
        Names the file, the line (from 1) and the column.
    """
    path = Path(path)
    table = read_table(path)
    table.require_rows()
    if len(longest := max(table.names, key=len)) > _LONGEST_NAME:
        raise DataError(f"{path}: line {table.names_line}: {longest[:40]!r}… is no name of a column")
    options = {
        "quantity": quantity,
        "azimuth": azimuth,
        "stokes": stokes,
        "illumination": illumination,
        "cosine_weighted": cosine_weighted,
        "angles": angles,
    }
    given = {key: value for key, value in options.items() if value is not None}
    header = Header.parse(path, statements(table) | given)
    columns, ignored = resolve_columns(path, table.names, column or {})
    if where:
        table = _selected(table, where)

    values = {source.variable: column_values(table, source, header) for source in columns}
    names = {c.variable: table.names[c.index] for c in columns if c.index is not None}
    ds = to_dataset(table, header, columns, values, ignored)
    lines = table.lines
    if skip_invalid:
        ds, lines = _without_invalid(ds, lines)
    validate(ds, origin=str(path), lines=lines, columns=names)
    return ds


def _selected(table: Table, where: Mapping[str, str]) -> Table:
    keep = list(range(len(table)))
    for name, text in where.items():
        if name not in table.names:
            raise DataError(
                f"{table.path}: there is no column {name!r} to select by; the columns are "
                f"{', '.join(table.names)}"
            )
        index = table.names.index(name)
        present = sorted({row[index] for row in table.rows})
        keep = [row for row in keep if table.rows[row][index] == str(text)]
        if not keep:
            some = ", ".join(map(repr, present[:10])) + (" …" if len(present) > 10 else "")
            raise DataError(f"{table.path}: no row has {text!r} in the column {name!r}; there are {some}")
    return table.taken(keep)


def _without_invalid(ds: xr.Dataset, lines: list[int]) -> tuple[xr.Dataset, list[int]]:
    bad: set[int] = set()
    for issue in check(ds):
        # The only issue that concerns rows but no variable is that nothing was measured there.
        if issue.severity == "error" or not issue.variable:
            bad.update(issue.rows)
    keep = [row for row in range(ds.sizes["geometry"]) if row not in bad]
    kept = ds.isel(geometry=keep)
    if bad:
        kept.attrs["skipped_rows"] = len(bad)
    return kept, [lines[row] for row in keep]


READER = Reader(
    "csv", read_csv, extensions=(".csv", ".tsv", ".txt", ".dat"), write=write_csv, written=(".csv",)
)
