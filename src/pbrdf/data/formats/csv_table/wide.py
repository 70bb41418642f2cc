"""Tables with one column a wavelength, as long ones: a row for each geometry and wavelength.

Such columns are called ``390nm``, ``R_550``, ``brdf_0.55um`` or, beside the angles, just ``400``, ``410`` …
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace

from pbrdf.data.formats.csv_table.names import CHANNELS, LONGEST, MISSING, parse_name
from pbrdf.data.formats.csv_table.units import plain_text
from pbrdf.errors import DataError
from pbrdf.files.cells import Texts
from pbrdf.files.delimited import Table

__all__ = ["long_table"]

_NUMBER = r"(?P<number>\d{1,5}(?:\.\d+)?)"
_WITH_UNIT = re.compile(
    rf"(?P<before>.*?)[\s_.@(\[]*{_NUMBER}\s*_?(?P<unit>nm|um|micron)[)\]]?(?P<after>.*)", re.IGNORECASE
)
_BARE = re.compile(
    rf"(?P<before>[A-Za-z_ ]*?)[\s_@(\[]*{_NUMBER}[)\]]?(?P<after>(?:[\s_](?:std|unc|err|sd))?)"
)
#: Bare numbers that are wavelengths in nm.
_SHORTEST, _LONGEST = 150.0, 25000.0
#: What such columns hold where their names say no more than the wavelength.
_VALUE = "I"


def long_table(table: Table, mapping: Mapping[str, str]) -> tuple[Table, dict[str, str]]:
    """A table with a column ``wavelength_nm``, if this one has columns for wavelengths.

    Parameters
    ----------
    table
        The file.
    mapping
        The columns that the user names: they keep their names.

    Returns
    -------
    table
        The table itself if it has no such columns, else one with a row for each wavelength of each row.
    widths
        By the name of each new column the columns that it was made of, in words.

    Raises
    ------
    DataError
        If a cell of such a column is not a number, or the kinds of columns have different wavelengths.
    """
    found: dict[str, dict[float, int]] = defaultdict(dict)
    if any(parse_name(name).variable == "wavelength" for name in table.names):
        return table, {}
    for index, name in enumerate(table.names):
        if name in mapping.values():
            continue
        spelt = _wavelength(name)
        if spelt is None:
            continue
        kind, wavelength = spelt
        if wavelength in found[kind]:
            raise DataError(
                f"{table.path}: the columns {table.names[found[kind][wavelength]]!r} and {name!r} are "
                f"both {wavelength:g} nm"
            )
        found[kind][wavelength] = index
    columns = {kind: places for kind, places in found.items() if len(places) > 1}
    if not columns:
        return table, {}
    wavelengths = sorted(next(iter(columns.values())))
    for kind, places in columns.items():
        if sorted(places) != wavelengths:
            odd = sorted(set(places) ^ set(wavelengths))[0]
            raise DataError(
                f"{table.path}: the columns of wavelengths do not go together: {kind!r} and "
                f"{next(iter(columns))!r} differ "
                f"at {odd:g} nm"
            )
    for places in columns.values():
        for index in places.values():
            table.numbers(index, MISSING)  # names the cell of the file that is no number
    moved = {index for places in columns.values() for index in places.values()}
    kept = [index for index in range(len(table.names)) if index not in moved]
    names = [*(table.names[index] for index in kept), "wavelength_nm", *columns]
    rows, lines = [], []
    for line, cells in zip(table.lines, table.rows, strict=True):
        common = [cells[index] for index in kept]
        for wavelength in wavelengths:
            rows.append(
                [*common, repr(wavelength), *(cells[places[wavelength]] for places in columns.values())]
            )
            lines.append(line)
    units = None
    if table.units is not None:
        first = [table.units[places[wavelengths[0]]] for places in columns.values()]
        units = [*(table.units[index] for index in kept), "", *first]
    widths = {"wavelength_nm": ""}
    for kind, places in columns.items():
        ends = [table.names[places[wavelength]] for wavelength in (wavelengths[0], wavelengths[-1])]
        widths[kind] = f"{' … '.join(ends)} ({len(places)} columns)"
    return replace(
        table, names=names, body=Texts(rows, table.decimal_comma), lines=lines, units=units
    ), widths


def _wavelength(name: str) -> tuple[str, float] | None:
    """What a column for a wavelength holds, as a name, and the wavelength in nm; None for another column."""
    if len(name) > LONGEST:
        return None
    text = plain_text(name)
    match = _WITH_UNIT.fullmatch(text)
    if match:
        factor = 1.0 if match["unit"].lower() == "nm" else 1000.0
    else:
        match, factor = _BARE.fullmatch(text), 1.0
        if match is None:
            return None
    wavelength = round(float(match["number"]) * factor, 6)
    before = match["before"].strip(" _-@([:,")
    after = match["after"].strip(" _-:,")
    if after.count("(") < after.count(")") or after.count("[") < after.count("]"):
        after = after.rstrip(")]")
    if not (_SHORTEST <= wavelength <= _LONGEST):
        return None
    if re.fullmatch(r"(?i)(wavelength|wl|wvl|lambda)?", before):
        before = ""
    kind = "_".join(part for part in (before, after) if part) or _VALUE
    # u(450 nm) and u(BRDF 450 nm) are uncertainties of what is called 450 nm and BRDF 450 nm
    if around := re.fullmatch(r"(\w[\w ]*?)\s*[(\[]([^)\]]*)", text[: match.start("number")]):
        owner = around[2].strip(" _-@,") or _VALUE
        wrapped = f"{around[1]}({owner})" + (f"_{after}" if after else "")
        if parse_name(wrapped).uncertainty and (
            around[2].strip() or parse_name(around[1]).variable not in ("I", "Q")
        ):
            kind = wrapped
    if parse_name(kind).key == "" and parse_name(kind).uncertainty:
        kind = f"{_VALUE}_{kind}"
    return (kind, wavelength) if parse_name(kind).variable in CHANNELS else None
