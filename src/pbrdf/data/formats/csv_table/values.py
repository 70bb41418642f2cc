"""Columns of a CSV file as the variables of a data set, in the project's units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrdf.data import conventions
from pbrdf.data.build import group_labels
from pbrdf.data.formats.csv_table.columns import ANGLE_COLUMNS, Column
from pbrdf.data.formats.csv_table.header import Header
from pbrdf.data.formats.csv_table.ratios import ratios_of_column
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table

__all__ = ["column_values"]

_MISSING = frozenset(("", "nan", "na"))


def column_values(table: Table, column: Column, header: Header) -> NDArray[Any]:
    """One column as labels or numbers.

    Parameters
    ----------
    table
        The file's text.
    column
        Which column, or which constant.
    header
        The file's conventions.

    Returns
    -------
    ndarray
        A value for each row: angles in radians, φ = 0 forward, wavelengths in nm, everything else as it stands.

    Raises
    ------
    DataError
        If a cell is not a number, a label is missing, or the unit in the column's name is not one of its kind.
    """
    if column.variable == "group":
        return _labels(table, column)
    if column.index is None:
        try:
            values = np.full(len(table), float(column.constant))
        except ValueError:
            raise DataError(
                f"{table.path}: the constant {'=' + column.constant!r} for {column.variable} is not a number"
            ) from None
    else:
        values = np.array(table.numbers(column.index, _MISSING))
    if column.variable in ANGLE_COLUMNS:
        return _angle(table, column, header, values)
    if column.variable == "wavelength":
        _require_unit(table, column, ("nm", "um"))
        return values * 1000 if column.unit == "um" else values
    name = "" if column.index is None else table.names[column.index]
    return ratios_of_column(values, column.variable, name, column.unit)


def _labels(table: Table, column: Column) -> NDArray[Any]:
    if column.index is None:
        return np.full(len(table), group_labels(column.constant))
    cells = table.cells(column.index)
    if "" in cells:
        raise DataError(f"{table.place(cells.index(''), column.index)}: there is no group label")
    return group_labels(cells)


def _angle(table: Table, column: Column, header: Header, values: NDArray[np.float64]) -> NDArray[np.float64]:
    _require_unit(table, column, ("deg", "rad"))
    degrees = header.degrees if column.unit is None else column.unit == "deg"
    if column.variable == "phi" and not header.forward_at_zero:
        # In the file's own unit, so that 180° becomes exactly 0.
        values = conventions.azimuth_forward_pi_to_zero(values, 180.0 if degrees else np.pi)
    return np.deg2rad(values) if degrees else values


def _require_unit(table: Table, column: Column, units: tuple[str, ...]) -> None:
    if column.unit is not None and column.unit not in units:
        name = table.names[column.index or 0]
        raise DataError(
            f"{table.path}: the unit of the column {name!r} is not understood; use {' or '.join(units)}"
        )
