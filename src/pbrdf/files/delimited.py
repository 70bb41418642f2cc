"""Tables of delimited columns: CSV and its relatives, as instruments, spreadsheets and people write them.

A line of column names, and one row a line under it. Columns are separated by commas, semicolons, tabs, vertical bars or
blanks (one or several), whichever shows the numbers; with all but commas, decimal commas are read as well as points.
:mod:`pbrdf.files.layout` says how the names are found: a line of text above the numbers, or the last comment with as
many names; remarks may stand before it, a row of units under it. Cells may be quoted, and then hold separators and line
breaks. Lines that begin with ``#`` (or ``%``, ``//``, ``!``, ``;``) are comments; empty lines, and rows of nothing but
empty cells, count for nothing. White space around a cell does not belong to it, empty cells at the end of a row beyond
the names neither. :mod:`pbrdf.files.text` says which encodings are understood, :mod:`pbrdf.files.numbers` what a number
is. The sheet of a workbook (``.xlsx``, ``.xls``, ``.ods``, …) is a table, too: :mod:`pbrdf.files.workbook`.
"""

from __future__ import annotations

import contextlib
import csv
import functools
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.cells import Body, Cells, RaggedRowError, read_body
from pbrdf.files.layout import (
    SEPARATORS,
    Layout,
    OpenQuotationError,
    comment_of,
    find_layout,
    kept_comment,
    split_records,
)
from pbrdf.files.matlab import is_matlab, matlab_lines
from pbrdf.files.numbers import to_number
from pbrdf.files.text import first_bytes, read_bytes, utf8
from pbrdf.files.workbook import is_workbook, sheet_texts

__all__ = ["TABLE_EXTENSIONS", "Row", "Table", "column_names", "read_table", "table_text", "write_table"]

#: Of files that tables are read from, those of workbooks last.
TABLE_EXTENSIONS = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".xlsm", ".xlsb", ".xls", ".ods", ".mat")
#: The line of column names of a table of any use begins within so many bytes.
_HEAD = 2**20
_SHOWN = 60
#: Remarks below a table are not longer.
_FOOTER = 2000
_THOUSANDS = re.compile(
    r"[-+]?[0-9]{1,3}(?:(?:,[0-9]{3})+(?:\.[0-9]*)?|(?:\.[0-9]{3})+,[0-9]*"
    r"|(?:[ '\u00a0\u202f][0-9]{3})+(?:[.,][0-9]*)?)"
)


@dataclass(frozen=True, eq=False)
class Table:
    """The text of a table, each cell with its place in the file.

    Attributes
    ----------
    path
        The file, for messages.
    names
        Of the columns, as the file spells them; one may come twice.
    body
        Cells of each row, as many as there are names.
    lines
        Of the file or the sheet, from 1, on which each row begins.
    comments
        Lines that begin with ``#`` (or another mark of comments, then as if with ``#``), and remarks before the names,
        with their numbers; ``key,value`` as ``# key: value``.
    names_line
        Number of the line of column names.
    decimal_comma
        Whether numbers may have decimal commas: the separator is none.
    units
        What a row of units under the names says of each column, ``""`` where nothing; None where there is no such row.
    statements_end
        Number of the line before which comments state something of the whole table.
    sheet
        Of a workbook; empty for a text.
    warnings
        Sentences on what the user should know: lines that were passed over, a file that seems cut off.
    """

    path: Path
    names: list[str]
    body: Cells
    lines: list[int]
    comments: list[tuple[int, str]]
    names_line: int
    decimal_comma: bool
    units: list[str] | None = None
    statements_end: int = 0
    sheet: str = ""
    warnings: list[str] = field(default_factory=list)

    @property
    def names_in_comment(self) -> bool:
        """Whether the names stand in a comment."""
        return self.statements_end > self.names_line

    def __len__(self) -> int:
        return len(self.body)

    def __iter__(self) -> Iterator[Row]:
        return (Row(self, index) for index in range(len(self)))

    @property
    def rows(self) -> list[list[str]]:
        """Cells of each row."""
        return self.body.rows()

    @property
    def origin(self) -> str:
        """The file, and the sheet where there are sheets, as messages begin."""
        return _origin(self.path, self.sheet)

    def column(self, name: str) -> int:
        """Where a column stands, from 0.

        Raises
        ------
        DataError
            If there is none of that name, or more than one.
        """
        if name not in self.names:
            raise DataError(
                f"{self.origin}: there is no column {name!r}; the columns are {', '.join(self.names)}"
            )
        if self.names.count(name) > 1:
            raise DataError(f"{self.origin}: two columns are called {name!r}; rename one")
        return self.names.index(name)

    def line(self, row: int) -> str:
        """The file and the line of a row, as messages begin."""
        return f"{self.origin}: line {self.lines[row]}"

    def place(self, row: int, column: int) -> str:
        """The file, the line and the column of a cell, as messages begin."""
        return f"{self.line(row)}, column {self.names[column]!r}"

    def cell(self, row: int, column: int) -> str:
        """What a cell holds, ``""`` where it is empty."""
        return self.body.text(row, column)

    def cells(self, column: int) -> list[str]:
        """What the cells of a column hold; quicker than row by row."""
        return self.body.texts(column)

    def text(self, row: int, column: int) -> str:
        """What a cell holds; raises DataError, which names the place, if that is nothing."""
        cell = self.cell(row, column)
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
        cell = self.cell(row, column)
        number = to_number(cell, self.decimal_comma)
        if number is not None:
            return number
        if cell.lower() in missing:
            return math.nan
        hint = "; leave out the marks of thousands" if _THOUSANDS.fullmatch(cell[:_SHOWN]) else ""
        raise DataError(f"{self.place(row, column)}: {_shown(cell)} is not a number{hint}")

    def numbers(self, column: int, missing: Collection[str] = ()) -> NDArray[np.float64]:
        """The numbers of a column, as :meth:`number` reads them; shape (N,).

        Raises
        ------
        DataError
            As :meth:`number`, and if commas mark thousands in one cell and points decimals in another.
        """
        values, odd, empty = self.body.floats(column)
        for row in np.sort(odd if "" in missing else np.concatenate([odd, empty])).tolist():
            values[row] = self.number(row, column, missing)
        if self.body.mixed:
            self._refuse_thousands(column)
        return values

    def _refuse_thousands(self, column: int) -> None:
        """``1,234`` beside ``2.5`` is not 1.234."""
        cells = self.cells(column)
        if any("." in cell for cell in cells) and any("," in cell for cell in cells):
            for row, cell in enumerate(cells):
                if _THOUSANDS.fullmatch(cell):
                    raise DataError(
                        f"{self.place(row, column)}: {cell!r}: decimals or thousands? Other cells of the column have "
                        "decimal points; write all with points, without marks of thousands"
                    )

    def require_rows(self) -> None:
        """Raises DataError if there are only column names."""
        if not len(self):
            raise DataError(f"{self.origin}: there are no rows under the column names")

    def taken(self, rows: Sequence[int]) -> Table:
        """The table of these rows alone."""
        return replace(self, body=self.body.taken(rows), lines=[self.lines[row] for row in rows])


def _origin(path: Path, sheet: str) -> str:
    return f"{path}: sheet {sheet!r}" if sheet else str(path)


def _shown(cell: str) -> str:
    """A cell in a message: a long one cut."""
    return repr(cell) if len(cell) <= _SHOWN else f"{cell[:_SHOWN]!r}…"


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
        return self.table.line(self.index)

    def place(self, name: str) -> str:
        """The file, the line and the column of a cell, as messages begin."""
        return self.table.place(self.index, self.table.column(name))

    def get(self, name: str) -> str:
        """What a cell holds, ``""`` where it is empty or there is no such column."""
        return self.table.cell(self.index, self.table.column(name)) if name in self.table.names else ""

    def text(self, name: str) -> str:
        """What a cell holds, which must not be nothing."""
        return self.table.text(self.index, self.table.column(name))

    def number(self, name: str) -> float:
        """The number in a cell."""
        return self.table.number(self.index, self.table.column(name))


def read_table(path: Path, sheet: str | None = None) -> Table:
    """Read a table; it may be one without rows.

    Parameters
    ----------
    path
        The file, of any extension.
    sheet
        Of a workbook, by its name; by default the only one that holds a table.

    Raises
    ------
    DataError
        If the file cannot be read, has no line of column names, or a row has not as many cells as there are names.
    """
    raw = read_bytes(path)
    if is_workbook(raw):
        texts = sheet_texts(path, raw, sheet)
        name = next(iter(texts)) if len(texts) == 1 else _only_table(path, texts)
        return _table(path, texts[name], ("\t",), name)
    if sheet is not None:
        raise DataError(f"{path}: this is a text, which has no sheets; leave out sheet={sheet!r}")
    if is_matlab(path):
        return _table(path, "\n".join([*matlab_lines(path), ""]).encode(), ("\t",))
    return _table(path, utf8(path, raw), SEPARATORS)


def _only_table(path: Path, texts: Mapping[str, bytes]) -> str:
    """The only sheet that has names above numbers."""
    found = []
    for name, text in texts.items():
        with contextlib.suppress(DataError):
            find_layout(path, _head_lines(text), ("\t",))
            found.append(name)
    if len(found) == 1:
        return found[0]
    raise DataError(
        f"{path}: the sheets {', '.join(map(repr, found or texts))} all hold numbers; name one with "
        "sheet=… (--sheet), or keep only one of them in the file"
    )


def _table(path: Path, text: bytes, separators: Sequence[str], sheet: str = "") -> Table:
    """The table that a text in UTF-8 is."""
    origin = _origin(path, sheet)
    text = _plain_blanks(text)
    lines = _head_lines(text)
    if lines and lines[0].lstrip().startswith(("<?xml", "<html", "<!DOCTYPE", "<table")):
        raise DataError(f"{origin}: line 1: this is XML or HTML; save it as CSV or as a workbook")
    layout = find_layout(Path(origin), lines, separators)
    begin = 0
    for _ in range(layout.body):
        begin = text.find(b"\n", begin) + 1 or len(text)
    try:
        body, footer = _rows(text, begin, layout)
    except RaggedRowError as ragged:
        width, hint = len(layout.names), ""
        if layout.separator == "," and ragged.count > width:
            hint = "; if its numbers have decimal commas, separate the columns by semicolons"
        elif ragged.count < width and ragged.line == text.count(b"\n") + 1 > layout.body + 1:
            hint = "; the file ends there without a line end: it seems cut off"
        raise DataError(
            f"{origin}: line {ragged.line}: {ragged.count} cells under {width} column names{hint}"
        ) from None
    except OpenQuotationError as error:
        raise DataError(
            f"{origin}: line {error.line}: a cell that begins there does not end; is a quotation mark left open?"
        ) from None
    comments = [
        (number, said)
        for number, line in enumerate(lines[: layout.body], 1)
        if (said := kept_comment(line, layout.separator)) is not None
    ]
    remarks = [(number, f"# {said}") for number, said in layout.remarks]
    table = Table(
        path,
        layout.names,
        body.cells,
        body.lines,
        sorted([*comments, *remarks, *body.comments]),
        layout.names_line,
        decimal_comma=layout.separator != ",",
        units=layout.units,
        statements_end=layout.body + 1 if layout.in_comment else layout.names_line,
        sheet=sheet,
    )
    table.warnings.extend(_passed_over(layout.remarks))
    table.warnings.extend(_passed_over(footer))
    if not sheet and not text.endswith(b"\n"):
        table.warnings.extend(_cut_off(table))
    return table


def _rows(text: bytes, begin: int, layout: Layout) -> tuple[Body, list[tuple[int, str]]]:
    """The rows of a table, and remarks below them: lines of words to the end of the file, whole ones."""
    width, first = len(layout.names), layout.body + 1
    try:
        return read_body(text, begin, layout.separator, width, first), []
    except RaggedRowError as ragged:
        end = begin
        for _ in range(ragged.line - first):
            end = text.find(b"\n", end) + 1
        rest = text[end:]
        if end == begin or len(rest) > _FOOTER:
            raise
        lines = rest.decode().split("\n")
        decimal_comma = layout.separator != ","
        words = [record.cells for record in split_records(lines, layout.separator)]
        if any(
            len(cells) >= width or any(_is_number(cell, decimal_comma) for cell in cells) for cells in words
        ):
            raise
        body = read_body(text[:end], begin, layout.separator, width, first)
        # Words that begin a row, where nothing ends it, may be a row cut off.
        if not rest.endswith(b"\n") and not _is_number(body.cells.text(0, 0), decimal_comma):
            raise
        return body, [
            (number, line.strip()) for number, line in enumerate(lines, ragged.line) if line.strip()
        ]


def _is_number(cell: str, decimal_comma: bool) -> bool:
    return to_number(cell, decimal_comma) is not None


def _plain_blanks(text: bytes) -> bytes:
    """A text with plain spaces for those that do not break or are narrow."""
    if not text.isascii():
        for space in "\u00a0\u2007\u2009\u202f":
            text = text.replace(space.encode(), b" ")
    return text


def _head_lines(text: bytes) -> list[str]:
    """Lines of the beginning of a text, all of them whole."""
    head = text[:_HEAD]
    if len(text) > _HEAD:
        head = head[: head.rfind(b"\n") + 1] or head
    return head.decode(errors="replace").split("\n")


def _passed_over(remarks: Sequence[tuple[int, str]]) -> Iterator[str]:
    said = [(line, text) for line, text in remarks if not re.fullmatch(r"sep=.?", text, re.IGNORECASE)]
    if said:
        lines = f"lines {said[0][0]} to {said[-1][0]}" if len(said) > 1 else f"line {said[0][0]}"
        first = said[0][1] if len(said[0][1]) <= _SHOWN else said[0][1][:_SHOWN] + "…"
        taken = "were taken as remarks" if len(said) > 1 else "was taken as a remark"
        yield f"{lines} of the file ({first!r}{' …' if len(said) > 1 else ''}) {taken}, not as data"


def _cut_off(table: Table) -> Iterator[str]:
    """Whether the last number has fewer digits than all others of its column, where no line end follows it."""
    column = len(table.names) - 1
    others = range(max(0, len(table) - 1000), len(table) - 1)
    if len(others) < 2:
        return
    last = table.cell(len(table) - 1, column)
    lengths = [len(table.cell(row, column)) for row in others]
    shortest = min(lengths)
    missing = shortest - len(last)
    if shortest > 3 and (missing > 1 or (missing == 1 and shortest == max(lengths))):
        yield (
            f"line {table.lines[-1]}: the last number, {last!r}, has fewer digits than any other of the column "
            f"{table.names[column]!r}, and no line end follows: the file seems cut off"
        )


def column_names(path: Path) -> list[str]:
    """Column names of a table, to recognise its format by; none if the file is no table or cannot be read."""
    return list(_names_in(first_bytes(path, _HEAD)))


@functools.lru_cache(maxsize=2)
def _names_in(head: bytes) -> tuple[str, ...]:
    """Kept for a while: one reader after the other asks for those of the same file."""
    if not head or is_workbook(head):
        return ()
    try:
        return tuple(find_layout(Path(), _head_lines(_plain_blanks(utf8(Path(), head)))).names)
    except DataError:
        return ()


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
        _write_rows(file, names, rows, statements or {})


def table_text(
    names: Iterable[str], rows: Iterable[Iterable[object]], statements: Mapping[str, str] | None = None
) -> str:
    """What :func:`write_table` writes."""
    file = io.StringIO(newline="")
    _write_rows(file, names, rows, statements or {})
    return file.getvalue()


def _write_rows(
    file: IO[str], names: Iterable[str], rows: Iterable[Iterable[object]], statements: Mapping[str, str]
) -> None:
    for key, value in statements.items():
        file.write(f"# {key}: {value}\n")
    plain = csv.writer(file, lineterminator="\n")
    quoted = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
    for cells in map(list, (names, *rows)):
        # A row that began with the mark of a comment would be read as one.
        (quoted if cells and comment_of(str(cells[0]), ",") is not None else plain).writerow(cells)
