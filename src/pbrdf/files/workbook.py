"""Sheets of workbooks (``.xlsx``, ``.xlsm``, ``.xlsb``, ``.xls``, ``.ods``) as text, read by python-calamine.

Each row of a sheet becomes a line of cells separated by tabs, so that numbers of lines are those of the sheet's rows,
and all that holds for tables of text holds for them. Numbers keep all their digits; dates, times, truth values and
cells in error are texts, so they are no numbers.
"""

from __future__ import annotations

import csv
import datetime
import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError

__all__ = ["is_workbook", "sheet_lines"]

_ZIP = b"PK\x03\x04"
_COMPOUND = bytes.fromhex("d0cf11e0a1b11ae1")
#: The parts of a workbook take no more, unpacked.
_MOST_BYTES = 2**31


def is_workbook(raw: bytes) -> bool:
    """Whether a file that begins so is a workbook, whatever its name."""
    return raw.startswith((_ZIP, _COMPOUND))


def sheet_lines(path: Path, raw: bytes, sheet: str | None) -> tuple[str, bytes]:
    """A sheet as text.

    Parameters
    ----------
    path
        The file, for messages.
    raw
        Its content.
    sheet
        Its name; by default the only sheet with numbers.

    Returns
    -------
    name
        Of the sheet.
    text
        UTF-8, a line a row, cells separated by tabs.

    Raises
    ------
    DataError
        If it cannot be read, there is no such sheet, none with numbers, or several and none is named.
    """
    _require_size(path, raw)
    workbook = _opened(path, raw)
    names = list(workbook.sheet_names)
    if sheet is not None:
        if sheet not in names:
            raise DataError(
                f"{path}: there is no sheet {sheet!r}; the sheets are {', '.join(map(repr, names))}"
            )
        return sheet, _text(_cells(path, workbook, sheet))
    found = [(name, cells) for name in names if _numbers(cells := _cells(path, workbook, name))]
    if not found:
        raise DataError(f"{path}: no sheet holds numbers")
    if len(found) > 1:
        raise DataError(
            f"{path}: the sheets {', '.join(repr(name) for name, _ in found)} all hold numbers; name one with "
            "sheet=… (--sheet), or keep only one of them in the file"
        )
    name, cells = found[0]
    return name, _text(cells)


def _require_size(path: Path, raw: bytes) -> None:
    """Refuse a workbook that says of itself that it fills the memory."""
    if not raw.startswith(_ZIP):
        return
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            size = sum(part.file_size for part in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise DataError(f"{path}: cannot be read as a workbook: {error}; is it complete?") from error
    if size > _MOST_BYTES:
        raise DataError(
            f"{path}: it unpacks to {size / 2**30:.0f} GiB, more than any workbook; it is not read"
        )


def _opened(path: Path, raw: bytes) -> Any:
    from python_calamine import CalamineWorkbook

    return _guarded(path, CalamineWorkbook.from_filelike, io.BytesIO(raw))


def _cells(path: Path, workbook: Any, sheet: str) -> list[list[Any]]:
    found = _guarded(path, workbook.get_sheet_by_name, sheet)
    return _guarded(path, lambda: found.to_python(skip_empty_area=False))


def _guarded(path: Path, call: Any, *values: Any) -> Any:
    """What a function of calamine gives; what it fails with, panics of its own language included, as DataError."""
    try:
        return call(*values)
    except (KeyboardInterrupt, SystemExit, MemoryError):
        raise
    except BaseException as error:
        raise DataError(f"{path}: cannot be read as a workbook: {error or type(error).__name__}") from None


def _numbers(cells: Sequence[Sequence[Any]]) -> bool:
    """Whether there is a number in two cells of a row: a table, not a page of text."""
    return any(sum(type(cell) in (int, float) for cell in row) > 1 for row in cells)


def _text(cells: Sequence[Sequence[Any]]) -> bytes:
    rows = [[_written(cell) for cell in row] for row in cells]
    used = [column for column in range(max(map(len, rows), default=0)) if any(row[column] for row in rows)]
    first, last = (used[0], used[-1] + 1) if used else (0, 0)
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t", lineterminator="\n")
    for row in rows:
        # An empty row is an empty line, not a quoted empty cell.
        writer.writerow(row[first:last]) if any(row) else text.write("\n")
    return text.getvalue().encode()


def _written(cell: Any) -> str:
    if isinstance(cell, bool):
        return str(cell).upper()
    if isinstance(cell, float):
        return str(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    return " ".join(str(cell).split())
