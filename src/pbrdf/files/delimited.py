"""Tables of delimited columns: CSV and its relatives, as instruments, spreadsheets and people write them.

A line of column names, and one row a line under it. Columns are separated by commas, semicolons or tabs, whichever the
names are; with the last two, decimal commas are read as well as points. Cells may be quoted, and then hold separators
and line breaks. Lines that begin with ``#`` are comments; empty lines, and rows of nothing but empty cells, count for
nothing. White space around a cell does not belong to it.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.matlab import is_matlab, matlab_lines
from pbrdf.files.text import first_bytes, lines_of, read_lines

__all__ = ["Row", "Table", "column_names", "read_table", "write_table"]

_SEPARATORS = (",", ";", "\t")
_QUOTED = re.compile(r'"[^"]*"')
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
#: The line of column names of a table of any use begins within so many bytes.
_HEAD = 2**20


@dataclass(frozen=True)
class Table:
    """The text of a table, each cell with its place in the file.

    Attributes
    ----------
    path
        The file, for messages.
    names
        Of the columns, as the file spells them; one may come twice.
    rows
        Cells of each row, as many as there are names.
    lines
        Of the file, from 1, on which each row begins.
    comments
        Lines that begin with ``#``, with their numbers.
    names_line
        Number of the line of column names.
    decimal_comma
        Whether numbers may have decimal commas: the separator is none.
    units
        What a row of units under the names says of each column, ``""`` where nothing; None where there is no such row.
    """

    path: Path
    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    comments: list[tuple[int, str]]
    names_line: int
    decimal_comma: bool
    units: list[str] | None = None

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Row]:
        return (Row(self, index) for index in range(len(self)))

    def column(self, name: str) -> int:
        """Where a column stands, from 0.

        Raises
        ------
        DataError
            If there is none of that name, or more than one.
        """
        if name not in self.names:
            raise DataError(
                f"{self.path}: there is no column {name!r}; the columns are {', '.join(self.names)}"
            )
        if self.names.count(name) > 1:
            raise DataError(f"{self.path}: two columns are called {name!r}; rename one")
        return self.names.index(name)

    def place(self, row: int, column: int) -> str:
        """The file, the line and the column of a cell, as messages begin."""
        return f"{self.path}: line {self.lines[row]}, column {self.names[column]!r}"

    def text(self, row: int, column: int) -> str:
        """What a cell holds; raises DataError, which names the place, if that is nothing."""
        cell = self.rows[row][column]
        if not cell:
            raise DataError(f"{self.place(row, column)}: the cell is empty")
        return cell

    def number(self, row: int, column: int, missing: Collection[str] = ()) -> float:
        """The number in a cell.

        Parameters
        ----------
        row, column
            Counted from 0.
        missing
            Texts, in lower case, that mean NaN; ``""`` is an empty cell.

        Raises
        ------
        DataError
            If it is no number; names line and column.
        """
        cell = self.rows[row][column]
        try:
            return float(cell)
        except ValueError:
            pass
        if cell.lower() in missing:
            return math.nan
        if self.decimal_comma and _DECIMAL_COMMA.fullmatch(cell):
            return float(cell.replace(",", "."))
        raise DataError(f"{self.place(row, column)}: {cell!r} is not a number")

    def numbers(self, column: int, missing: Collection[str] = ()) -> NDArray[np.float64]:
        """The numbers of a column, as :meth:`number` reads them; shape (N,)."""
        return np.array([self.number(row, column, missing) for row in range(len(self))], dtype=np.float64)

    def require_rows(self) -> None:
        """Raises DataError if there are only column names."""
        if not self.rows:
            raise DataError(f"{self.path}: there are no rows under the column names")

    def taken(self, rows: Sequence[int]) -> Table:
        """The table of these rows alone."""
        return replace(self, rows=[self.rows[row] for row in rows], lines=[self.lines[row] for row in rows])


@dataclass(frozen=True)
class Row:
    """A row of a table, whose cells are asked for by the names of their columns.

    The methods raise DataError as those of :class:`Table` do.
    """

    table: Table
    index: int

    @property
    def line(self) -> str:
        """The file and the line, as messages begin."""
        return f"{self.table.path}: line {self.table.lines[self.index]}"

    def place(self, name: str) -> str:
        """The file, the line and the column of a cell, as messages begin."""
        return self.table.place(self.index, self.table.column(name))

    def get(self, name: str) -> str:
        """What a cell holds, ``""`` where it is empty or there is no such column."""
        return self.table.rows[self.index][self.table.column(name)] if name in self.table.names else ""

    def text(self, name: str) -> str:
        """What a cell holds, which must not be nothing."""
        return self.table.text(self.index, self.table.column(name))

    def number(self, name: str) -> float:
        """The number in a cell."""
        return self.table.number(self.index, self.table.column(name))


def read_table(path: Path) -> Table:
    """Read a table; it may be one without rows.

    Raises
    ------
    DataError
        If the file cannot be read, has no line of column names, or a row has not as many cells as there are names.
    """
    lines = matlab_lines(path) if is_matlab(path) else read_lines(path)
    comments = [(number, line.strip()) for number, line in enumerate(lines, 1) if _is_comment(line)]
    start = _start(lines)
    if start is None:
        raise DataError(f"{path}: there is no line of column names")
    separator = _separator(lines[start])
    # Comments become empty lines, which keeps the numbers of the lines right.
    body = ("" if _is_comment(line) else line + "\n" for line in lines[start:])
    reader = csv.reader(body, delimiter=separator, skipinitialspace=True)
    names: list[str] = []
    names_line, following = 0, start + 1
    rows, numbers = [], []
    try:
        for cells in reader:
            number, following = following, start + 1 + reader.line_num
            if not any(cell.strip() for cell in cells):
                continue
            if not names:
                names, names_line = [cell.strip() for cell in cells], number
                continue
            if len(cells) != len(names):
                hint = ""
                if separator == "," and len(cells) > len(names):
                    hint = "; if its numbers have decimal commas, separate the columns by semicolons"
                raise DataError(
                    f"{path}: line {number}: {len(cells)} cells under {len(names)} column names{hint}"
                )
            rows.append([cell.strip() for cell in cells])
            numbers.append(number)
    except csv.Error as error:
        raise DataError(f"{path}: line {following}: {error}; is a quotation mark left open?") from error
    if not names:
        raise DataError(f"{path}: there is no line of column names")
    return Table(path, names, rows, numbers, comments, names_line, decimal_comma=separator != ",")


def column_names(path: Path) -> list[str]:
    """Column names of a table, to recognise its format by; none if the file is no table or cannot be read."""
    lines = lines_of(first_bytes(path, _HEAD).decode("utf-8-sig", errors="replace"))
    start = _start(lines)
    if start is None:
        return []
    try:
        cells = next(csv.reader([lines[start]], delimiter=_separator(lines[start]), skipinitialspace=True))
    except csv.Error:
        return []
    return [cell.strip() for cell in cells]


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _start(lines: Sequence[str]) -> int | None:
    """Index of the first line that is neither empty nor a comment."""
    return next((i for i, line in enumerate(lines) if line.strip() and not _is_comment(line)), None)


def _separator(line: str) -> str:
    """The separator of which the line of column names has most, outside quotation marks."""
    return max(_SEPARATORS, key=_QUOTED.sub("", line).count)


def write_table(
    path: Path,
    names: Iterable[str],
    rows: Iterable[Iterable[object]],
    statements: Mapping[str, str] | None = None,
) -> None:
    """Write a table separated by commas; it replaces `path` when complete.

    Parameters
    ----------
    path
        The file.
    names
        Of the columns.
    rows
        Cells of each row.
    statements
        Lines ``# key: value`` before the names.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    with atomic_file(path) as target, target.open("x", encoding="utf-8", newline="") as file:
        for key, value in (statements or {}).items():
            file.write(f"# {key}: {value}\n")
        plain = csv.writer(file, lineterminator="\n")
        quoted = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
        for cells in map(list, (names, *rows)):
            # A row that began with # would be read as a comment.
            (quoted if cells and _is_comment(str(cells[0])) else plain).writerow(cells)
