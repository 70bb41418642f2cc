"""Units that stand elsewhere than in a column's name: in a row under the names, in comment lines, in an option.

Understood in comments are a list for all columns, ``# units: deg, deg, deg, 1/sr``; a line for one, ``# theta_i: deg``,
``# unit of BRDF: 1/msr`` or ``# wavelength unit: um``; and sentences, ``# all angles are in radians``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from pbrdf.data.formats.csv_table.names import LONGEST, Name, parse_name
from pbrdf.data.formats.csv_table.units import parse_unit
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table

__all__ = ["comment_units", "option_units", "units_of_columns"]

_ANGLES = re.compile(r"(?:all )?angles?")
_LIST = re.compile(r"units?(?: of (?:the )?columns)?\s*[:=]\s*(.+)")
_ONE = (
    re.compile(r"units? (?:of|for) (?:the )?(?P<name>.+?)\s*[:=]\s*(?P<unit>.+)"),
    re.compile(r"units? (?:of|for) (?:the )?(?P<name>.+?) (?:is|are) (?P<unit>.+)"),
    re.compile(r"(?P<name>.+?)[ _]units?\s*[:=]\s*(?P<unit>.+)"),
    re.compile(r"(?P<name>.+?)\s+(?:(?:is|are|given|stated|measured|expressed) )*in (?P<unit>[^,;]+?)\.?"),
    re.compile(r"(?P<name>.+?)\s*[:=]\s*(?:in )?(?P<unit>.+)"),
)


def comment_units(table: Table) -> tuple[dict[int, str], str | None, frozenset[str]]:
    """What the comment lines before the names say of units.

    Returns
    -------
    columns
        Texts of units by position of the column.
    angles
        The text of a unit that all angles have; None if nothing says so.
    keys
        Keys of the lines ``# key: unit`` that were understood as units, and are thus no attributes.

    Raises
    ------
    DataError
        If a list of units has not as many as there are columns.
    """
    units: dict[int, str] = {}
    angles: str | None = None
    keys: set[str] = set()
    names = [parse_name(name) for name in table.names]
    for line, comment in table.comments:
        if line >= table.statements_end or len(comment) > LONGEST * len(names):
            continue
        text = comment.lstrip("#").strip()
        listed = _LIST.fullmatch(text) or _LIST.fullmatch(text.lower())
        if listed and (parts := [part.strip() for part in re.split(r"[,;\t]", listed[1])])[1:]:
            if not any(map(parse_unit, parts)):
                continue
            if len(parts) != len(table.names):
                raise DataError(
                    f"{table.path}: line {line}: {len(parts)} units for {len(table.names)} columns; give one for "
                    "each, - where there is none"
                )
            units |= {index: part for index, part in enumerate(parts) if part not in ("", "-")}
            keys.add(text.split(":")[0].strip())
            continue
        if len(text) > LONGEST:
            continue
        for pattern in _ONE:
            match = re.fullmatch(pattern, text) or re.fullmatch(pattern, text.lower())
            if match is None or (parse_unit(match["unit"]) is None):
                continue
            if _ANGLES.fullmatch(match["name"].strip().lower()):
                angles = match["unit"]
            elif found := _named(match["name"], names):
                units |= dict.fromkeys(found, match["unit"])
            else:
                continue
            if parse_unit(match["unit"]) and match["unit"].strip() not in ("1", "0"):
                keys.add(re.split("[:=]", text)[0].strip())
            break
    return units, angles, frozenset(keys)


def _named(text: str, names: Sequence[Name]) -> list[int]:
    """Positions of the columns that a comment speaks of, by their names or what they mean."""
    text = text.strip()
    exact = [i for i, name in enumerate(names) if name.text.strip().lower() == text.lower()]
    if exact:
        return exact
    wanted = parse_name(re.sub(r"(?i)^(?:the|all)\s+", "", text))
    if wanted.variable is None or wanted.uncertainty:
        return []
    return [i for i, name in enumerate(names) if name.variable == wanted.variable and not name.uncertainty]


def option_units(
    table: Table, names: Sequence[Name], stated: Mapping[str, str], mapping: Mapping[str, str]
) -> dict[int | str, str]:
    """Units that the user states, by position of the column, or by variable where a constant stands for it.

    Raises
    ------
    DataError
        If a unit is not understood, or there is no such column.
    """
    found: dict[int | str, str] = {}
    for key, text in stated.items():
        if parse_unit(str(text)) is None:
            raise DataError(
                f"{table.path}: unit={{{key!r}: {text!r}}}: the unit {text!r} is not understood; use deg, rad, mrad, "
                "nm, um, %, 1, 1/sr, 1/msr …"
            )
        mapped = mapping.get(key)
        if mapped is not None:
            found[key if mapped.startswith("=") else table.column(mapped)] = str(text)
            continue
        where = [i for i, name in enumerate(table.names) if name == key]
        where = where or [i for i, n in enumerate(names) if _called(n) == key]
        if not where:
            raise DataError(
                f"{table.path}: unit={{{key!r}: …}}: there is no such column; the columns are {', '.join(table.names)}"
            )
        found |= dict.fromkeys(where, str(text))
    return found


def _called(name: Name) -> str | None:
    if name.variable is None or not name.uncertainty:
        return name.variable
    return f"{name.variable}_std"


def units_of_columns(
    table: Table, names: Sequence[Name], stated: Mapping[int | str, str], comments: Mapping[int, str]
) -> list[str | None]:
    """The text of each column's unit: by option, else by its name, the row of units, the comments.

    Raises
    ------
    DataError
        If two of them contradict each other.
    """
    result: list[str | None] = []
    for index, name in enumerate(names):
        if index in stated:
            result.append(stated[index])
            continue
        row = table.units[index] if table.units is not None else ""
        said = [text for text in (name.unit, row, comments.get(index)) if text]
        if len({parse_unit(text) or text for text in said}) > 1:
            raise DataError(
                f"{table.path}: the column {name.text!r} has two units, {' and '.join(said)}; state one with "
                f"unit={{{name.text!r}: …}}"
            )
        result.append(said[0] if said else None)
    return result
