"""Text files of other programs as numbers and words, each with the line it stands on.

The files begin with a header of words and counts; the numbers follow. Nothing is allocated by a count that a
header declares: what is there is read, and counted.
"""

from __future__ import annotations

import re
from pathlib import Path

from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes, read_lines

__all__ = ["NumberLines", "begins_with", "parsed_number"]

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
#: How much of a file is looked at to recognise it.
_HEAD = 4096


def begins_with(path: Path, pattern: str, comment: str | tuple[str, ...] = "#") -> bool:
    """Whether the first line that is neither empty nor a comment matches a pattern, whatever its case."""
    head = first_bytes(path, _HEAD).decode("latin-1").removeprefix("ï»¿")
    for line in re.split(r"[\r\n]+", head):
        if line.strip() and not line.lstrip().startswith(comment):
            return re.match(pattern, line.strip(), re.IGNORECASE) is not None
    return False


def parsed_number(text: str) -> float | None:
    """The number that a text spells in ASCII digits, ``nan`` included; None if it spells none."""
    if _NUMBER.fullmatch(text):
        return float(text)
    return float("nan") if text.lower() == "nan" else None


class NumberLines:
    """The lines of a file that are neither empty nor comments, read one after the other.

    Parameters
    ----------
    path
        The file.
    comment
        How a comment begins, in one way or several; None if the file has none.
    keep_empty
        Whether empty lines count, as they do where each line has its meaning by its place.

    Attributes
    ----------
    comments
        Text of the comments, in order.

    Raises
    ------
    DataError
        If the file cannot be read as text.
    """

    def __init__(
        self, path: Path, comment: str | tuple[str, ...] | None = "#", keep_empty: bool = False
    ) -> None:
        self.path = path
        self.comments: list[str] = []
        self._lines: list[tuple[int, str]] = []
        content = read_lines(path)
        for number, line in enumerate(content, start=1):
            text = line.strip()
            if comment is not None and text.startswith(comment):
                self.comments.append(text.lstrip("".join(comment)).strip())
            elif text or keep_empty:
                self._lines.append((number, text))
        self._end = len(content)
        self._next = 0

    @property
    def line(self) -> int:
        """Number of the line that comes next; of the last one at the end."""
        return self._lines[self._next][0] if self._next < len(self._lines) else self._end

    @property
    def read_line(self) -> int:
        """Number of the line that was read last; 1 at the start."""
        return self._lines[self._next - 1][0] if self._next else 1

    def error(self, message: str, line: int | None = None) -> DataError:
        """An error that names the file and a line, else the one that was read last."""
        return DataError(f"{self.path}: line {self.read_line if line is None else line}: {message}")

    def peek(self) -> str | None:
        """The line that comes next; None at the end."""
        return self._lines[self._next][1] if self._next < len(self._lines) else None

    def text(self, what: str) -> str:
        """The next line.

        Raises
        ------
        DataError
            If there is none; says that `what` was expected.
        """
        if self._next >= len(self._lines):
            raise DataError(
                f"{self.path}: line {self._end}: the file ends where {what} is expected: is it truncated?"
            )
        self._next += 1
        return self._lines[self._next - 1][1]

    def number_in(self, text: str, what: str) -> float:
        """The number that a part of the line read last spells.

        Raises
        ------
        DataError
            If it spells none, or not a finite one where `what` is no value.
        """
        value = parsed_number(text)
        if value is None:
            raise self.error(f"{what}: {text!r} is not a number")
        return value

    def count_in(self, text: str, what: str) -> int:
        """The count, from 1, that a part of the line read last spells."""
        value = parsed_number(text)
        if value is None or not value.is_integer() or value < 1:
            raise self.error(f"{what}: a count from 1 is expected, not {text!r}")
        return int(value)

    def numbers(self, count: int, what: str) -> list[float]:
        """So many numbers, which fill one line or several whole ones.

        Raises
        ------
        DataError
            If a line has too many, the file ends, or one is no number.
        """
        found: list[float] = []
        first = self.line
        while len(found) < count:
            cells = self.text(f"{what} ({count} numbers)").split()
            found += [self.number_in(cell, what) for cell in cells]
        if len(found) > count:
            raise self.error(
                f"{what}: {count} numbers are needed, but the line has others: there are {len(found)}",
                first,
            )
        return found
