"""Where in a text the table stands: what separates its columns, the line of names, the first row.

Decided by the rows: the separator and the number of cells under which most numbers are found. The line of names is the
line of text above them with as many cells; a row of units may lie between. Where no such line is, the last comment
with as many names counts (``numpy.savetxt`` writes so). What stands above the names are remarks, as instruments and
spreadsheets write them. Only the beginning is looked at.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pbrdf.errors import DataError
from pbrdf.files.numbers import to_number

__all__ = [
    "BLANKS",
    "SEPARATORS",
    "Layout",
    "OpenQuotationError",
    "comment_of",
    "find_layout",
    "kept_comment",
    "split_records",
    "words",
]

#: Stands for one or several spaces or tabs.
BLANKS = " "
SEPARATORS = (",", ";", "\t", "|", BLANKS)

#: What a spreadsheet writes for a cell in error begins with the mark of a comment, too.
_COMMENT = re.compile(r"\s*(?!#(?:N/A|[A-Z]+(?:/0)?[!?]))(?:#|%|//|!|;)+(.*)", re.DOTALL)
_BLANKS = re.compile(r"[ \t\v\f\n]+")
#: Part of a line drawn under names.
_RULE = re.compile(r"[-=_*+:]{3,}")
_QUOTED = re.compile(r'"[^"]*"')
_NO_NAMES = "there is no line of column names"
_FIRST, _SCANNED = 30, 500
_LOOKED_AT = 20
_MISSING = frozenset(("", "nan", "na", "n/a", "-", "--", "none", "null"))
#: Units, in lower case without blanks, that are no names of columns, and those that may be.
_UNIT = re.compile(
    r"deg\.?|degrees?|[°º]|m?rad|radians?|nm|[uµμ]m|(1?/|per|)(m?sr|steradian)(\^?\{?-1\}?|⁻¹)?|%|percent|a\.u\.|"
    r"arb\.u(nits)?\.?|unitless|dimensionless|"
    r"w[/·*].*sr.*|w/(m2|m\^2|m²)|[uµμm][wvs]|[\[(<].*[\])>]"
)
_PERHAPS_UNIT = re.compile(r"none|[cm]?m|s|au|arb\.?|arbitrary|counts?|cts|adu|dn|[vwkc]|°c|k?hz|cps")
_TITLED = re.compile(r"\s*(?:columns?|fields?|names?|headers?|column names)\s*[:=]\s*", re.IGNORECASE)


class OpenQuotationError(Exception):
    """A quotation mark that nothing closes; `line` is the number of the line on which its row begins."""

    def __init__(self, line: int) -> None:
        super().__init__(line)
        self.line = line


@dataclass(frozen=True)
class Record:
    """A line of cells, or several lines where a quoted cell has line breaks.

    Attributes
    ----------
    line, following
        Index of its line, and of the line after it, from 0.
    cells
        Without white space around them.
    """

    line: int
    following: int
    cells: list[str]


@dataclass(frozen=True)
class Layout:
    """How a table is laid out.

    Attributes
    ----------
    separator
        A comma, a semicolon, a tab, a vertical bar, or :data:`BLANKS`.
    names
        Of the columns.
    names_line
        Its number in the file, from 1.
    body
        Index of the first line of the rows, from 0.
    units
        What a row of units says of each column; None where there is none.
    in_comment
        Whether the names stand in a comment.
    remarks
        Lines before the rows that belong to no table, with their numbers.
    """

    separator: str
    names: list[str]
    names_line: int
    body: int
    units: list[str] | None = None
    in_comment: bool = False
    remarks: list[tuple[int, str]] = field(default_factory=list)


def comment_of(line: str, separator: str) -> str | None:
    """What a line says after the mark of a comment, None if it is none.

    Marks are ``#``, ``%``, ``//``, ``!`` and, where it does not separate, ``;``.
    """
    found = _COMMENT.match(line)
    if found is None or (separator == ";" and line.lstrip().startswith(";")):
        return None
    return found[1].strip()


def kept_comment(line: str, separator: str) -> str | None:
    """A comment as if its mark were ``#``, None if a line is none."""
    said = comment_of(line, separator)
    return said if said is None else line.strip() if line.lstrip().startswith("#") else f"# {said}"


def split_records(lines: Sequence[str], separator: str, first: int = 0) -> Iterator[Record]:
    """Rows of cells in lines, without those that are comments or have nothing in any cell.

    Parameters
    ----------
    lines
        Of text.
    separator
        One of :data:`SEPARATORS`.
    first
        Number of the first line: what the records count from.

    Raises
    ------
    OpenQuotationError
        If a cell does not end.
    """
    blank = separator == BLANKS
    # Comments become empty lines, which keeps the numbers of the lines right.
    text = ("\n" if comment_of(line, separator) is not None else line + "\n" for line in lines)
    if blank:
        text = (" ".join(words(line)) + "\n" for line in text)
    reader = csv.reader(text, delimiter=separator, skipinitialspace=True)
    begin = first
    while True:
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error:  # longer than cells may be
            raise OpenQuotationError(begin) from None
        after = first + reader.line_num
        if after - first == len(lines) and after - begin > 1:
            whole = "".join(lines[begin - first :])
            if whole.count('"') % 2:
                raise OpenQuotationError(begin)
        cells = [cell.strip() for cell in cells]
        if any(cells):
            yield Record(begin, after, cells)
        begin = after


def words(line: str) -> list[str]:
    """What stands between the blanks of a line."""
    return [word for word in _BLANKS.split(line) if word]


def find_layout(path: Path, lines: Sequence[str], separators: Sequence[str] = SEPARATORS) -> Layout:
    """The layout of a table.

    Parameters
    ----------
    path
        The file, for messages.
    lines
        Its first lines.
    separators
        Those that come into question.

    Raises
    ------
    DataError
        If there is no line of column names.
    """
    for many in (_FIRST, _SCANNED):
        found = [candidate for separator in separators for candidate in _candidates(lines, separator, many)]
        most = max((candidate.score for candidate in found), default=0)
        named = [c for c in found if c.layout is not None and 2 * c.score >= most]
        layout = max(named, key=lambda c: c.score).layout if named else None
        # A plain table shows itself early; remarks before the names may be long.
        if layout is not None and (many == _SCANNED or not layout.remarks):
            return layout
    if found and (layout := _separated_otherwise(lines, max(found, key=lambda c: c.score))) is not None:
        return layout
    first = next((line for line in lines if line.strip() and comment_of(line, "") is None), None)
    if first is None:
        raise DataError(f"{path}: {_NO_NAMES}")
    explicit = [separator for separator in separators if separator != BLANKS]
    separator = max(explicit, key=_QUOTED.sub("", first).count)
    records = _records(lines, separator)
    if not records:
        raise DataError(f"{path}: {_NO_NAMES}")
    names = records[0]
    if not found:
        if separator == "," and len(names.cells) == 1:
            # Words alone: columns separated by blanks only if all lines have as many.
            words = _records(lines, BLANKS)
            if len(words) > 1 and len({len(record.cells) for record in words}) == 1:
                separator, names = BLANKS, words[0]
        return Layout(separator, names.cells, names.line + 1, names.following)
    if "n" not in _kinds(names.cells, separator) and len(names.cells) > 1:
        return Layout(separator, names.cells, names.line + 1, names.following)
    best = max(found, key=lambda c: c.score)
    raise DataError(
        f"{path}: line {best.first + 1}: numbers stand here, but no line above them has {_many(best.width)} of "
        "columns; write the names there, separated as the numbers are, or in a comment: '# theta_i, theta_r, phi, I'"
    )


def _many(count: int) -> str:
    return "the name" if count == 1 else f"the {count} names"


def _records(lines: Sequence[str], separator: str, many: int = _SCANNED) -> list[Record]:
    found = []
    try:
        for record in split_records(lines, separator):
            found.append(record)
            if len(found) == many:
                break
    except OpenQuotationError:
        pass
    return found


def _kinds(cells: Sequence[str], separator: str) -> str:
    """A letter for each cell: n a number, m nothing measured, t text."""
    return "".join(_kind(cell, separator) for cell in cells)


def _kind(cell: str, separator: str) -> str:
    if cell.lower() in _MISSING:
        return "m"
    return "t" if to_number(cell, separator != ",") is None else "n"


def _are_units(cells: Sequence[str]) -> bool:
    """Whether cells are a row of units: most of those that say anything, and no number but 1."""
    said = [cell.lower().replace(" ", "") for cell in cells if cell not in ("", "-", "--", "1")]
    sure = sum(_UNIT.fullmatch(cell) is not None for cell in said)
    perhaps = sum(_PERHAPS_UNIT.fullmatch(cell) is not None for cell in said)
    return (
        sure > 0 and len(said) <= 2 * (sure + perhaps) and all(to_number(cell, True) is None for cell in said)
    )


@dataclass(frozen=True)
class _Candidate:
    """Rows of numbers with one separator and width: how many numbers, where the first is, and their header if any."""

    separator: str
    score: int
    width: int
    first: int
    layout: Layout | None


def _candidates(lines: Sequence[str], separator: str, many: int) -> Iterator[_Candidate]:
    records = [
        record
        for record in _records(lines, separator, many)
        if not all(_RULE.fullmatch(cell) for cell in record.cells if cell)
    ]
    kinds = [_kinds(record.cells, separator) for record in records]
    scores: Counter[int] = Counter()
    for record, kind in zip(records, kinds, strict=True):
        scores[len(record.cells)] += kind.count("n")
    for width, score in scores.most_common(3):
        if score:
            first, layout = _with_header(lines, separator, records, kinds, width)
            yield _Candidate(separator, score, width, records[first].line, layout)


def _with_header(
    lines: Sequence[str], separator: str, records: list[Record], kinds: list[str], width: int
) -> tuple[int, Layout | None]:
    """Index of the first record of numbers of this width, and the layout with the names above it, if there are any."""
    numeric = [i for i, kind in enumerate(kinds) if len(kind) == width and "n" in kind]
    columns = {j for i in numeric[-_LOOKED_AT:] for j, kind in enumerate(kinds[i]) if kind == "n"}

    def strange(i: int) -> int:
        """How many texts a record has where numbers belong."""
        return sum(kinds[i][j] == "t" for j in columns if j < len(kinds[i]))

    rows = [i for i in numeric if not strange(i) and not _are_units(records[i].cells)]
    if not rows:
        return numeric[0], None
    trailing = width > 1 and all(not records[i].cells[-1] for i in numeric)
    # R numbers the rows, and has no name for that.
    numbered = separator == BLANKS and all(records[i].cells[0] == str(k) for k, i in enumerate(rows, 1))
    data = rows[0]
    while data and len(kinds[data - 1]) == width and not strange(data - 1):
        data -= 1
    # Lines of text directly above the rows, with as many cells.
    stack: dict[int, list[str]] = {}
    for i in range(data - 1, -1, -1):
        cells = _as_names(lines, records[i], separator, width, trailing)
        if cells is None and numbered and len(records[i].cells) == width - 1:
            cells = ["", *records[i].cells]
        if cells is None:
            break
        stack[i] = cells
    above = sorted(stack)
    units = [i for i in above if _are_units(records[i].cells)]
    full = [
        i for i in above
        if i not in units and "n" not in kinds[i] and sum(map(bool, stack[i])) >= max(1, len(stack[i]) - 1)
    ]  # fmt: skip
    before_units = [i for i in full if units and i < units[-1]]
    if width == 1:
        chosen = full[:1]
    else:
        chosen = before_units[-1:] or full[-1:]
    if not chosen:
        # Names that are numbers, as of wavelengths, beside others that are not.
        chosen = [i for i in above if i not in units and strange(i) > 1][-1:]
    if not chosen:
        layout = _named_by_comment(lines, separator, records, data, width - trailing, columns)
        if layout is not None or not units:
            return data, layout
        chosen = units[:1]
    names = chosen[0]
    if width == 1 and re.search("[,;\t|]", _QUOTED.sub("", lines[records[names].line])):
        return data, None  # these separate the names, and decimals of the numbers
    body = names + 1
    row_of_units = next((i for i in units if i > names), None)
    said = _units_between(lines, separator, records[names].following, records[data].line, len(stack[names]))
    if row_of_units is not None:
        said = _padded(records[row_of_units].cells, len(stack[names]))
        body = row_of_units + 1
        while body < data and "n" not in kinds[body]:
            body += 1
    passed = [i for i in range(body) if i not in (names, row_of_units)]
    return data, Layout(
        separator,
        [" ".join(name.split()) for name in stack[names]],
        records[names].line + 1,
        records[body].line,
        said,
        remarks=[(records[i].line + 1, _remark(lines, records[i], separator)) for i in passed],
    )


def _separated_otherwise(lines: Sequence[str], rows: _Candidate) -> Layout | None:
    """The layout where the names stand directly above the rows, separated by something else."""
    above = [
        i for i in range(rows.first) if lines[i].strip() and comment_of(lines[i], rows.separator) is None
    ]
    if not above or rows.width == 1:
        return None
    for choice in SEPARATORS:
        cells = None if choice == rows.separator else _comment_cells(lines[above[-1]], choice, rows.width)
        if cells is not None and all(cells) and set(_kinds(cells, choice)) == {"t"}:
            remarks = [(i + 1, lines[i].strip()) for i in above[:-1]]
            return Layout(rows.separator, cells, above[-1] + 1, rows.first, remarks=remarks)
    return None


def _as_names(
    lines: Sequence[str], record: Record, separator: str, width: int, trailing: bool
) -> list[str] | None:
    """Cells of a line as names of so many columns; None if it has another number of cells."""
    for cells in _splittings(lines[record.line], record.cells, separator):
        if len(cells) == width:
            return cells[:-1] if trailing and not cells[-1] else cells
        if len(cells) == width - trailing:
            return cells
        # A name too many: a separator at the end, or LabVIEW's comments, of which the rows have none.
        if len(cells) == width + 1 and cells[-1].lower() in ("", "comment"):
            return cells[:-1]
    return None


def _splittings(line: str, cells: list[str], separator: str) -> Iterator[list[str]]:
    """Cells of a line; with blanks as separators also as names that have blanks within them."""
    if separator != BLANKS:
        yield cells
    else:
        yield [cell.rstrip(",;") for cell in cells]
        yield re.findall(r"\S+(?:\s+[\[(][^\])]*[\])])?", line)
        yield re.split(r"\s{2,}|\t", line.strip())


def _named_by_comment(
    lines: Sequence[str],
    separator: str,
    records: list[Record],
    data: int,
    width: int,
    columns: set[int],
) -> Layout | None:
    """The layout where a comment above the rows has the names."""
    begin = records[data].line
    units = None
    if data and _are_units(records[data - 1].cells):
        data -= 1
        units = _padded(records[data].cells, width)
    comments = [(i, text) for i in range(begin) if (text := comment_of(lines[i], separator)) is not None]
    explicit = [s for s in (separator, *SEPARATORS) if s != BLANKS]
    for choices in (explicit, [BLANKS]) if width > 1 else ([","],):
        for i, text in reversed(comments):
            for choice in choices:
                cells = _comment_cells(text, choice, width)
                if cells is None:
                    continue
                if _are_units(cells):
                    units = cells
                    break
                kinds = _kinds(cells, choice)
                texts = sum(kinds[j] == "t" for j in columns if j < width)
                if ("n" in kinds and texts < 2) or not texts or not all(cells):
                    continue
                remarks = [(r.line + 1, _remark(lines, r, separator)) for r in records[:data]]
                return Layout(separator, cells, i + 1, begin, units, True, remarks)
    return None


def _comment_cells(text: str, separator: str, width: int) -> list[str] | None:
    titled = _TITLED.match(text)
    text = text[titled.end() :] if titled else text
    # ``key: value`` states something, whatever the value has commas of.
    if not titled and re.match(r"[\w.\- ]+:(?!//)", text):
        return None
    try:
        cells = next((r.cells for r in split_records([text], separator)), [])
    except OpenQuotationError:
        return None
    for found in _splittings(text, cells, separator):
        if len(found) == width + 1 and not found[-1]:
            found = found[:-1]
        if len(found) == width:
            return found
    return None


def _units_between(
    lines: Sequence[str], separator: str, begin: int, end: int, width: int
) -> list[str] | None:
    """Units in a comment between the names and the rows."""
    for line in lines[begin:end]:
        text = comment_of(line, separator)
        cells = None if text is None else _comment_cells(text, separator, width)
        if cells is not None and _are_units(cells):
            return cells
    return None


def _padded(cells: list[str], width: int) -> list[str]:
    return (cells + [""] * width)[:width]


def _remark(lines: Sequence[str], record: Record, separator: str) -> str:
    """A line that is not of the table; ``key,value`` as ``key: value``."""
    said = [cell for cell in record.cells if cell]
    if separator == BLANKS or not record.cells[0]:
        return lines[record.line].strip()
    if len(said) == 2 and ":" not in said[0]:
        return f"{said[0]}: {said[1]}"
    return f"{separator} ".join(said)
