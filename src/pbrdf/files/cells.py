"""The cells of a table: their texts, and columns of numbers, without a text for each where it is not asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pbrdf.files.layout import BLANKS, kept_comment, split_records, words
from pbrdf.files.numbers import PADDING, parse_cells, to_number

__all__ = ["Body", "Cells", "RaggedRowError", "read_body"]

_WIDEST = 64


class Cells(Protocol):
    """The cells of N rows, as many in each; `mixed` says whether points and decimal commas may stand side by side."""

    @property
    def mixed(self) -> bool: ...

    def __len__(self) -> int: ...

    def text(self, row: int, column: int) -> str:
        """What a cell holds."""

    def texts(self, column: int) -> list[str]:
        """What the cells of a column hold."""

    def floats(self, column: int) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
        """Numbers of a column, NaN where a cell is none; which cells hold another text, and which hold nothing."""

    def rows(self) -> list[list[str]]:
        """All cells."""

    def taken(self, rows: Sequence[int]) -> Cells:
        """The cells of these rows alone."""


@dataclass(frozen=True, eq=False)
class Texts:
    """Cells as texts."""

    cells: list[list[str]]
    decimal_comma: bool

    def __len__(self) -> int:
        return len(self.cells)

    def text(self, row: int, column: int) -> str:
        return self.cells[row][column]

    def texts(self, column: int) -> list[str]:
        return [cells[column] for cells in self.cells]

    @property
    def mixed(self) -> bool:
        return self.decimal_comma

    def floats(self, column: int) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
        texts = self.texts(column)
        found = [to_number(text, self.decimal_comma) for text in texts]
        odd = [row for row, number in enumerate(found) if number is None]
        empty = [row for row in odd if not texts[row]]
        values = np.array([np.nan if number is None else number for number in found], dtype=np.float64)
        return values, np.setdiff1d(odd, empty).astype(np.intp), np.array(empty, dtype=np.intp)

    def rows(self) -> list[list[str]]:
        return self.cells

    def taken(self, rows: Sequence[int]) -> Texts:
        return Texts([self.cells[row] for row in rows], self.decimal_comma)


@dataclass(frozen=True, eq=False)
class Slices:
    """Cells as parts of a text.

    Attributes
    ----------
    buffer
        UTF-8, with :data:`pbrdf.files.numbers.PADDING` bytes at either end.
    special
        Positions of the characters that are no digits.
    before, after
        Which of them stand before and after each cell, shape (N, columns).
    decimal_comma
        Whether numbers may have decimal commas.
    padded
        Whether cells may begin or end with blanks.
    mixed
        Whether there are both points and decimal commas.
    """

    buffer: NDArray[np.uint8]
    special: NDArray[np.intp]
    before: NDArray[np.intp]
    after: NDArray[np.intp]
    decimal_comma: bool
    padded: bool
    mixed: bool

    def __len__(self) -> int:
        return len(self.before)

    def text(self, row: int, column: int) -> str:
        return self._between(self.before[row, column], self.after[row, column])

    def texts(self, column: int) -> list[str]:
        begin = self.special[self.before[:, column]] + 1
        length = self.special[self.after[:, column]] - begin
        widest = int(length.max(initial=0))
        if not widest:
            return [""] * len(self)
        if widest > _WIDEST:
            return [self.text(row, column) for row in range(len(self))]
        places = np.arange(widest)
        # Padding allows to read a little beyond the end.
        characters = self.buffer[np.minimum(begin[:, np.newaxis] + places, len(self.buffer) - 1)]
        characters[places >= length[:, np.newaxis]] = 0
        cells = characters.view(f"S{widest}").ravel().tolist()
        known = {cell: cell.decode().strip() for cell in set(cells)}  # labels come many times
        return [known[cell] for cell in cells]

    def floats(self, column: int) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
        before, after = self.before[:, column], self.after[:, column]
        if self.padded:
            before, after = self._trimmed(before, after)
        values, odd = parse_cells(self.buffer, self.special, before, after, self.decimal_comma)
        begin = self.special[before[odd]] + 1
        length = self.special[after[odd]] - begin
        empty = odd[length <= 0]
        letters = self.buffer[begin[:, np.newaxis] + np.arange(3)] | 0x20
        plain = (length == 3) & (letters == np.frombuffer(b"nan", dtype=np.uint8)).all(axis=1)
        strange = []
        for row in odd[(length > 0) & ~plain].tolist():
            number = to_number(self._between(before[row], after[row]), self.decimal_comma)
            if number is None:
                strange.append(row)
            else:
                values[row] = number
        return values, np.array(strange, dtype=np.intp), empty

    def _between(self, before: int, after: int) -> str:
        return self.buffer[self.special[before] + 1 : self.special[after]].tobytes().decode().strip()

    def _trimmed(
        self, before: NDArray[np.intp], after: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Borders without the blanks at the beginning and the end of each cell."""
        while True:
            inner = before + 1 < after
            leading = inner & _is_blank(self.buffer[self.special[before] + 1])
            if not leading.any():
                break
            before = before + leading
        while True:
            inner = before + 1 < after
            closing = inner & _is_blank(self.buffer[self.special[after] - 1])
            if not closing.any():
                return before, after
            after = after - closing

    def rows(self) -> list[list[str]]:
        return self._rows

    @cached_property
    def _rows(self) -> list[list[str]]:
        columns = [self.texts(column) for column in range(self.before.shape[1])]
        return [list(cells) for cells in zip(*columns, strict=True)]

    def taken(self, rows: Sequence[int]) -> Slices:
        index = np.asarray(rows, dtype=np.intp)
        return replace(self, before=self.before[index], after=self.after[index])


def _is_blank(characters: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether characters are a space, a tab, \\v or \\f."""
    values: NDArray[np.bool_] = (
        (characters == 32) | (characters == 9) | (characters == 11) | (characters == 12)
    )
    return values


def _is_gap(characters: NDArray[np.uint8]) -> NDArray[np.bool_]:
    values: NDArray[np.bool_] = _is_blank(characters) | (characters == 10)
    return values


@dataclass(frozen=True)
class Body:
    """Rows under the names.

    Attributes
    ----------
    cells
        Of the rows.
    lines
        Of the file, from 1, on which each row begins.
    comments
        With their numbers, as if the mark of all were ``#``.
    """

    cells: Cells
    lines: list[int]
    comments: list[tuple[int, str]]


class RaggedRowError(Exception):
    """A row has not as many cells as there are names.

    Attributes
    ----------
    line, count
        The row's line, and how many cells it has.
    """

    def __init__(self, line: int, count: int) -> None:
        super().__init__(line, count)
        self.line, self.count = line, count


def read_body(text: bytes, begin: int, separator: str, width: int, first: int) -> Body:
    """Rows of a table.

    Parameters
    ----------
    text
        UTF-8, lines ended by ``\\n``.
    begin
        Where the rows begin in it.
    separator
        As :class:`pbrdf.files.layout.Layout` has it.
    width
        How many cells a row has; further ones must be empty.
    first
        Number of the first line in the file.

    Raises
    ------
    RaggedRowError
        If a row has another number of cells.
    OpenQuotationError
        If a cell does not end.
    """
    read = _plain if text.find(b'"', begin) < 0 else _quoted
    return read(text, begin, separator, width, first)


def _fit(cells: list[str], width: int, line: int) -> list[str]:
    if len(cells) < width or any(cells[width:]):
        raise RaggedRowError(line, len(cells))
    return cells[:width]


def _quoted(text: bytes, begin: int, separator: str, width: int, first: int) -> Body:
    lines = text[begin:].decode().split("\n")
    found = [
        (i, said)
        for i, line in enumerate(lines, first)
        if (said := kept_comment(line, separator)) is not None
    ]
    rows, numbers = [], []
    for record in split_records(lines, separator, first):
        rows.append(_fit(record.cells, width, record.line))
        numbers.append(record.line)
    return Body(Texts(rows, separator != ","), numbers, found)


def _plain(text: bytes, begin: int, separator: str, width: int, first: int) -> Body:
    size = max(len(text) - begin - text.endswith(b"\n"), 0)
    buffer = np.empty(size + 2 * PADDING + 1, dtype=np.uint8)
    buffer[: PADDING - 1] = buffer[-PADDING:] = ord("0")
    buffer[PADDING : PADDING + size] = np.frombuffer(text, np.uint8, size, begin) if size else 0
    # A line end before the first row, and one after the last.
    buffer[PADDING - 1] = buffer[PADDING + size] = 10
    special = np.flatnonzero((buffer - np.uint8(48)) > 9)
    characters = buffer[special]
    lines = np.flatnonzero(characters == 10)
    if separator == BLANKS:
        before, after = _between_blanks(special, characters)
        firsts = np.searchsorted(before, lines)
    else:
        borders = np.flatnonzero((characters == ord(separator)) | (characters == 10))
        before, after = borders[:-1], borders[1:]
        firsts = np.flatnonzero(characters[borders] == 10)
    begins, counts = firsts[:-1], np.diff(firsts)
    # Position of each line's end, to read single lines by.
    edges = special[lines]

    marks = b"#%/!;" if separator == BLANKS else b"#%/!; \t\v\f\n" + separator.encode()
    if separator == BLANKS:
        at = np.minimum(begins, max(len(before) - 1, 0))
        start = buffer[special[before[at]] + 1] if len(before) else np.zeros(len(counts), dtype=np.uint8)
    else:
        start = buffer[edges[:-1] + 1]
    keep = counts == width
    comments = []
    for line in np.flatnonzero(~keep | np.isin(start, np.frombuffer(marks, dtype=np.uint8))).tolist():
        whole = buffer[edges[line] + 1 : edges[line + 1]].tobytes().decode()
        keep[line] = False
        if not whole.strip():
            continue
        said = kept_comment(whole, separator)
        if said is not None:
            comments.append((first + line, said))
            continue
        cells = words(whole) if separator == BLANKS else [cell.strip() for cell in whole.split(separator)]
        if any(cells):
            _fit(cells, width, first + line)
            keep[line] = True
    if keep.all() and (counts == width).all():
        shape = (len(counts), width)
        before, after = before.reshape(shape), after.reshape(shape)
    else:
        index = begins[keep][:, np.newaxis] + np.arange(width)
        before, after = before[index], after[index]
    numbers = (np.flatnonzero(keep) + first).tolist()
    mixed = separator != "," and text.find(b".", begin) >= 0 and text.find(b",", begin) >= 0
    padded = separator != BLANKS and any(
        text.find(blank, begin) >= 0 for blank in (b" ", b"\t", b"\v", b"\f")
    )
    if padded and len(before):
        # Blanks within texts do no harm.
        padded = bool(
            _is_blank(buffer[special[before] + 1]).any() or _is_blank(buffer[special[after] - 1]).any()
        )
    return Body(Slices(buffer, special, before, after, separator != ",", padded, mixed), numbers, comments)


def _between_blanks(
    special: NDArray[np.intp], characters: NDArray[np.uint8]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which special characters stand before and after each cell between spaces, tabs and line ends."""
    gaps = np.flatnonzero(_is_gap(characters))
    apart = np.diff(special[gaps]) > 1
    return gaps[:-1][apart], gaps[1:][apart]
