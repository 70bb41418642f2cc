"""CSV tables as data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.formats.csv_table.assembly import to_dataset
from pbrdf.data.formats.csv_table.columns import Resolved, resolve_columns
from pbrdf.data.formats.csv_table.header import Header, statements
from pbrdf.data.formats.csv_table.hints import comment_units
from pbrdf.data.formats.csv_table.names import AZIMUTHS, parse_name
from pbrdf.data.formats.csv_table.values import Values, values_of
from pbrdf.data.formats.csv_table.wide import long_table
from pbrdf.data.formats.csv_table.writing import write_csv
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.origin import Origin, of_rows, origin_of, remember
from pbrdf.data.validation import check, validate
from pbrdf.errors import DataError
from pbrdf.files.delimited import TABLE_EXTENSIONS, Table, read_table

__all__ = ["READER", "read_csv", "read_rows", "selected"]


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
    unit: Mapping[str, str] | None = None,
    coverage: float | str | None = None,
    scale: str | None = None,
    ignore: Sequence[str] = (),
    sheet: str | None = None,
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
    quantity, azimuth, stokes, illumination, cosine_weighted, angles, coverage, scale
        As the header keys of the same names, for files that do not state them, or state them wrongly.
    unit
        Units of columns, by the name used here or by the file's: ``{"I": "%", "theta_i": "mrad"}``. They count before
        what the file says.
    ignore
        Names of columns to leave out without a word.
    sheet
        Of a workbook (``.xlsx``, ``.xls``, ``.ods``), where several hold numbers.

    Returns
    -------
    xarray.Dataset
        A valid data set in the project's conventions, radians.

    Raises
    ------
    DataError
        Names the file, the line (from 1) and the column.
    """
    ds, _ = read_rows(
        read_table(Path(path), sheet),
        column=column,
        where=where,
        skip_invalid=skip_invalid,
        quantity=quantity,
        azimuth=azimuth,
        stokes=stokes,
        illumination=illumination,
        cosine_weighted=cosine_weighted,
        angles=angles,
        unit=unit,
        coverage=coverage,
        scale=scale,
        ignore=ignore,
    )
    return ds


def read_rows(
    table: Table,
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
    unit: Mapping[str, str] | None = None,
    coverage: float | str | None = None,
    scale: str | None = None,
    ignore: Sequence[str] = (),
) -> tuple[xr.Dataset, list[int]]:
    """The rows of a table that is read already, with the options of :func:`read_csv`.

    Returns
    -------
    xarray.Dataset
        As :func:`read_csv` returns it.
    list of int
        The line of the file that each of its rows came from.
    """
    path = table.path
    table.require_rows()
    options = {
        "quantity": quantity,
        "azimuth": azimuth,
        "stokes": stokes,
        "illumination": illumination,
        "cosine_weighted": cosine_weighted,
        "angles": angles,
        "coverage": coverage,
        "scale": scale,
    }
    given = {key: value for key, value in options.items() if value is not None}
    _, _, of_units = comment_units(table)
    stated = {key: value for key, value in statements(table).items() if key not in of_units}
    header = Header.parse(path, stated | given)
    if where:
        table = selected(table, where)
    table, widened = long_table(table, column or {})
    resolved = resolve_columns(table, header, column or {}, unit, ignore)
    read = values_of(table, resolved.columns, header, None if angles else resolved.angles)
    ignored = [table.names[index] for index in resolved.unused]
    ds = to_dataset(table, header, resolved.columns, read, ignored, resolved.assumptions)
    if table.warnings:
        ds.attrs["assumptions"] = [*ds.attrs.get("assumptions", ()), *table.warnings]
    remember(ds, _origin(table, resolved, read, widened, ignore))
    if skip_invalid:
        ds = _without_invalid(ds)
    try:
        validate(ds, origin=table.origin)
    except DataError as error:
        usable = _without_invalid(ds)
        if not 0 < usable.sizes["geometry"] < ds.sizes["geometry"] or any(
            issue.severity == "error" for issue in check(usable)
        ):
            raise
        raise DataError(f"{error}; leave such rows out with skip_invalid=True") from None
    origin = origin_of(ds)
    assert origin is not None
    return ds, list(origin.lines)


def _origin(
    table: Table, resolved: Resolved, read: Values, widened: Mapping[str, str], ignore: Sequence[str]
) -> Origin:
    taken = {c.index: c.variable for c in resolved.columns if c.index is not None}
    meanings = []
    for index, name in enumerate(table.names):
        variable = taken.get(index)
        meaning = read.meanings.get(variable, variable) if variable else ""
        if widened.get(name):
            meaning += ", each at its wavelength"
        if widened.get(name, name):
            meanings.append((widened.get(name, name), meaning))
    unused = {
        table.names[index]: tuple(table.cells(index))
        for index in resolved.unused
        if table.names[index] not in ignore and parse_name(table.names[index]).uncertainty is None
    }
    names = {variable: table.names[index] for index, variable in taken.items() if variable not in AZIMUTHS}
    return Origin(
        tuple(table.lines), names, tuple(meanings), (*resolved.remarks, *read.remarks), unused, tuple(ignore)
    )


def selected(table: Table, where: Mapping[str, str]) -> Table:
    """The rows that have these texts in these columns; raises DataError if there is no such column or row."""
    keep = list(range(len(table)))
    for name, text in where.items():
        if name not in table.names:
            raise DataError(
                f"{table.path}: there is no column {name!r} to select by; the columns are "
                f"{', '.join(table.names)}"
            )
        index = table.names.index(name)
        cells = table.cells(index)
        present = sorted(set(cells))
        keep = [row for row in keep if cells[row] == str(text)]
        if not keep:
            some = ", ".join(map(repr, present[:10])) + (" …" if len(present) > 10 else "")
            raise DataError(f"{table.path}: no row has {text!r} in the column {name!r}; there are {some}")
    return table.taken(keep)


def _without_invalid(ds: xr.Dataset) -> xr.Dataset:
    bad: set[int] = set()
    for issue in check(ds):
        # The only issue that concerns rows but no variable is that nothing was measured there.
        if issue.rows and (issue.severity == "error" or not issue.variable):
            bad.update(issue.rows)
    keep = np.array([row for row in range(ds.sizes["geometry"]) if row not in bad], dtype=np.intp)
    kept = of_rows(ds, keep, ds.isel(geometry=keep))
    if bad:
        kept.attrs["skipped_rows"] = len(bad)
    return kept


READER = Reader("csv", read_csv, extensions=TABLE_EXTENSIONS, write=write_csv, written=(".csv",))
