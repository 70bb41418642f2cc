"""Sheets of workbooks (``.xlsx``, ``.xlsm``, ``.xlsb``, ``.xls``, ``.ods``) as text, read by python-calamine.

Each row of a sheet becomes a line of cells separated by tabs, so that numbers of lines are those of the sheet's rows,
and all that holds for tables of text holds for them. Numbers keep all their digits; dates, times, truth values and
cells in error (``#DIV/0!``) are texts, so they are no numbers. Calamine gives cells in error as empty ones: those of
``.xlsx`` are looked up in the parts of the file (ECMA-376, part 1, 18.3.1.4: ``<c r="B7" t="e"><v>#DIV/0!</v></c>``).
"""

from __future__ import annotations

import csv
import datetime
import io
import re
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from pbrdf.errors import DataError
from pbrdf.files.numbers import to_number
from pbrdf.files.plain_numbers import count_from_text

__all__ = ["is_workbook", "sheet_texts"]

_ZIP = b"PK\x03\x04"
_COMPOUND = bytes.fromhex("d0cf11e0a1b11ae1")
#: The parts of a workbook take no more, unpacked; its sheets have no more cells, empty ones within included.
_MOST_BYTES = 2**31
_MOST_CELLS = 2 * 10**8
_ERROR = re.compile(rb'<c\b[^>]*?\bt="e"[^>]*>.*?</c>', re.DOTALL)
_PLACE = re.compile(rb'\br="([A-Z]{1,3})([0-9]{1,7})"')
_VALUE = re.compile(rb"<v>([^<]*)</v>")
_WIDE = re.compile(rb'<c\b[^>]*?\br="[A-Z]{3}[0-9]')
_REPEATED = re.compile(rb'number-(?:rows|columns)-repeated="[0-9]{3}')
#: The parts that calamine parses.
_PARSED = re.compile(r"content\.xml|xl/(?:workbook|sharedStrings|styles|worksheets/[^/]+)\.xml")
_ROW = re.compile(rb'<row\b[^>]*?\br="([0-9]{1,7})"')


def is_workbook(raw: bytes) -> bool:
    """Whether a file that begins so is a workbook, whatever its name."""
    return raw.startswith((_ZIP, _COMPOUND))


def sheet_texts(path: Path, raw: bytes, sheet: str | None) -> dict[str, bytes]:
    """Sheets as text, by name.

    Parameters
    ----------
    path
        The file, for messages.
    raw
        Its content.
    sheet
        The only one wanted; by default all that have numbers.

    Returns
    -------
    dict
        UTF-8, a line a row, cells separated by tabs; at least one.

    Raises
    ------
    DataError
        If it cannot be read, there is no such sheet, or none with numbers.
    """
    archive = _archive(path, raw) if raw.startswith(_ZIP) else None
    workbook = _guarded(path, _opened, raw)
    names = list(workbook.sheet_names)

    def cells(name: str) -> list[list[Any]]:
        found: list[list[Any]] = _guarded(
            path, lambda: workbook.get_sheet_by_name(name).to_python(skip_empty_area=False)
        )
        if archive is not None:
            _mark_errors(found, archive, name)
        return found

    if sheet is not None:
        if sheet not in names:
            raise DataError(
                f"{path}: there is no sheet {sheet!r}; the sheets are {', '.join(map(repr, names))}"
            )
        return {sheet: _text(cells(sheet))}
    found = [(name, there) for name in names if _numbers(there := cells(name))]
    if not found:
        raise DataError(f"{path}: no sheet holds numbers")
    return {name: _text(there) for name, there in found}


def _archive(path: Path, raw: bytes) -> zipfile.ZipFile:
    """The parts of a workbook, refused where it says of itself that it fills the memory."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(raw))
        size = sum(part.file_size for part in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise DataError(f"{path}: cannot be read as a workbook: {error}; is it complete?") from error
    if size > _MOST_BYTES:
        raise DataError(
            f"{path}: it unpacks to {size / 2**30:.0f} GiB, more than any workbook; it is not read"
        )
    for part in archive.namelist():
        if not _PARSED.fullmatch(part):
            continue
        xml = _part(archive, part)
        _require_well_formed(path, part, xml)
        if part == "content.xml" and _REPEATED.search(xml):
            _require_small(path, *_open_document_extent(xml))
        if part.startswith("xl/worksheets/"):
            at = xml.rfind(b"<row")
            last = _ROW.match(xml, at) if at >= 0 else None
            columns = 26**3 if _WIDE.search(xml) else 26 + 26**2
            if last is not None and int(last[1]) * columns > _MOST_CELLS and b"<v>" in xml[at:]:
                _require_extent(path, xml)
    return archive


def _require_extent(path: Path, xml: bytes) -> None:
    """Refuse a sheet with a cell so far away that those before it fill the memory."""
    places = [_position(place) for place in _PLACE.finditer(xml)]
    rows, columns = (max((place[axis] for place in places), default=0) + 1 for axis in (0, 1))
    _require_small(path, rows, columns)


def _require_small(path: Path, rows: int, columns: int) -> None:
    if rows * columns > _MOST_CELLS:
        raise DataError(
            f"{path}: a sheet reaches to row {rows} and column {columns}, mostly empty; delete what stands far away"
        )


def _require_well_formed(path: Path, part: str, xml: bytes) -> None:
    """Refuse a part that is no XML: over some of these calamine does not come to an end."""
    try:
        expat.ParserCreate().Parse(xml, True)
    except expat.ExpatError as error:
        raise DataError(
            f"{path}: cannot be read as a workbook: its part {part} is damaged ({error}); is it complete?"
        ) from None


def _open_document_extent(xml: bytes) -> tuple[int, int]:
    """Rows and columns up to the last cell that is not empty, of the sheet of an ``.ods`` that needs the most cells.

    Source: OpenDocument 1.3, part 3, 19.675 and 19.679: cells and rows may say how often they are repeated.
    """
    sizes = [(0, 0)]
    rows = used_rows = columns = used_columns = widest = 0

    def repeated(attributes: dict[str, str], what: str) -> int:
        try:
            return count_from_text(attributes.get(f"table:number-{what}-repeated", "1"))
        except ValueError:
            return 1

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal rows, used_rows, columns, used_columns, widest
        if tag == "table:table":
            rows = used_rows = widest = 0
        elif tag == "table:table-row":
            columns = used_columns = 0
            rows += repeated(attributes, "rows")
        elif tag in ("table:table-cell", "table:covered-table-cell"):
            columns += repeated(attributes, "columns")
            if any(name.startswith("office:") or name == "table:formula" for name in attributes):
                used_columns = columns

    def end(tag: str) -> None:
        nonlocal used_rows, widest
        if tag == "table:table-row" and used_columns:
            used_rows, widest = rows, max(widest, used_columns)
        elif tag == "table:table":
            sizes.append((used_rows, widest))

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(xml, True)
    return max(sizes, key=lambda size: size[0] * size[1])


def _part(archive: zipfile.ZipFile, name: str) -> bytes:
    """A part of a workbook, nothing if it cannot be read: calamine then says so."""
    try:
        return archive.read(name)
    except (
        KeyError,
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        ValueError,
        NotImplementedError,
        RuntimeError,
        EOFError,
    ):
        return b""


def _position(place: re.Match[bytes]) -> tuple[int, int]:
    """Row and column, from 0, of a place like B7."""
    column = 0
    for letter in place[1]:
        column = 26 * column + letter - 64
    return int(place[2]) - 1, column - 1


def _mark_errors(cells: list[list[Any]], archive: zipfile.ZipFile, sheet: str) -> None:
    """Put the texts of cells in error where calamine leaves them empty."""
    for error in _ERROR.finditer(_part(archive, _part_of(archive, sheet))):
        place, value = _PLACE.search(error[0]), _VALUE.search(error[0])
        if place is not None:
            row, column = _position(place)
            if row < len(cells) and column < len(cells[row]) and cells[row][column] == "":
                cells[row][column] = value[1].decode(errors="replace") if value else "#ERROR!"


def _part_of(archive: zipfile.ZipFile, sheet: str) -> str:
    """Name of the part that a sheet of an ``.xlsx`` is in, empty if that is not found."""
    try:
        listed = ElementTree.fromstring(_part(archive, "xl/workbook.xml"))
        related = ElementTree.fromstring(_part(archive, "xl/_rels/workbook.xml.rels"))
    except ElementTree.ParseError:
        return ""
    for element in listed.iter():
        if element.tag.endswith("}sheet") and element.get("name") == sheet:
            known = next((value for key, value in element.attrib.items() if key.endswith("}id")), None)
            for relation in related:
                if relation.get("Id") == known:
                    target = relation.get("Target", "")
                    return target[1:] if target.startswith("/") else f"xl/{target}"
    return ""


def _opened(raw: bytes) -> Any:
    from python_calamine import CalamineWorkbook

    return CalamineWorkbook.from_filelike(io.BytesIO(raw))


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
    return any(
        sum(to_number(_written(cell), True) is not None for cell in row if cell != "") > 1 for row in cells
    )


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
