"""Rows of the CSV tables that say something of each series of frames: its angles, or the light it shows."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from pbrdf.errors import DataError

__all__ = ["series_rows"]

_DELIMITERS = ",;\t"


def series_rows(path: Path, lines: Sequence[str]) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """Column names, and the number of the line and the cells of each row, without white space around them.

    Parameters
    ----------
    path
        To be named in errors.
    lines
        Of the file; empty ones and those that start with ``#`` are passed over. Cells are separated by commas,
        semicolons or tabs, whichever the line of column names has most of.

    Raises
    ------
    DataError
        If there is no row; and, where the rows are taken one after the other, if one is longer or shorter than the line
        of names.
    """
    body = [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")
    ]
    if len(body) < 2:
        raise DataError(f"{path}: there are no rows; give a line of column names and one row a series")
    delimiter = max(_DELIMITERS, key=body[0][1].count)
    table = list(csv.reader((line for _, line in body), delimiter=delimiter, skipinitialspace=True))
    names = [name.strip() for name in table[0]]

    def rows() -> Iterator[tuple[int, list[str]]]:
        for (number, _), cells in zip(body[1:], table[1:], strict=True):
            if len(cells) != len(names):
                raise DataError(f"{path}: line {number}: {len(cells)} cells under {len(names)} column names")
            yield number, [cell.strip() for cell in cells]

    return names, rows()
