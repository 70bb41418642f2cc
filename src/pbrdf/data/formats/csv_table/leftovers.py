"""Columns that were not understood, and should perhaps not be left out: what each looks like, and the option for it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pbrdf.data.formats.csv_table.names import Name, parse_name
from pbrdf.data.schema import std_name
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table

__all__ = [
    "distinct",
    "remark_on",
    "require_no_lost_azimuth",
    "require_one_illumination",
    "require_one_polarization",
]

_AZIMUTH = re.compile(r"(?<![a-z])phi(?![a-z]{2})|azim")
_SAMPLE = re.compile(
    r"(?<![a-z])(?:sample|material|specimen|coating|paint|target|plate|panel|surface|substrate|batch|lot|coupon|tile|replica|probe)"
)
_SAMPLE_WORDS = frozenset(
    ("name", "id", "label", "part", "piece", "object", "run", "scan", "side", "position", "day")
)
_WAVELENGTH = re.compile(
    r"wavelen|wavenum|photon|frequency|lambda|(?<![a-z])(?:wl|wvl)(?![a-z])|filter|spectral|colou?r(?![a-z])"
)
_BAND = frozenset(("band", "bands", "channel", "filter", "color", "colour", "laser", "led", "rgb"))
_POLARIZATION = re.compile(r"polari[sz]ation|(?<![a-z])pol(?![a-z])|polstate|illumination")
#: Bounds of an interval, and other words for how well values are known.
_BOUND = frozenset(
    [
        "lower",
        "upper",
        "low",
        "high",
        "lcl",
        "ucl",
        "lci",
        "uci",
        "ci",
        "ci95",
        "cl",
        "lowerbound",
        "upperbound",
    ]
)
_BOUND |= {"snr", "rsd", "precision", "accuracy", "tolerance"}
#: Combined and relative uncertainties, written u_c, u_r, u_rel.
_COMBINED = re.compile(r"u[\s_.]*(c|r|rel|c95)")
#: Degrees of polarisation that may be of all of it or of the linear part.
_DEGREE = re.compile(r"p|dop|dp|polari[sz]ation|(degree(of)?|percent)polari[sz]ation|polari[sz]ationdegree")
_SHOWN = 5


def distinct(table: Table, column: int) -> list[str]:
    """The different texts of a column, in the order of the file."""
    return list(dict.fromkeys(table.cells(column)))


def require_no_lost_azimuth(
    table: Table, names: Sequence[Name], unused: Sequence[int], has_azimuth: bool
) -> None:
    """Raise DataError if a column that looks like an azimuth is left over and none is used.

    Without an azimuth the file would be taken as measured in the plane of incidence.
    """
    for index in unused:
        name = names[index]
        if not has_azimuth and not name.uncertainty and _AZIMUTH.search(name.text.lower()):
            raise DataError(
                f"{table.path}: the column {name.text!r} looks like an azimuth; say which one is relative "
                "to the source "
                "with column={'phi': …}, or column={'phi': '=0'} if it does not matter"
            )


def remark_on(table: Table, name: Name, index: int, measured: Sequence[str]) -> str | None:
    """A sentence on a column that is not used; None where nothing needs to be said."""
    text, lowered = name.text, name.text.lower()
    leave = f"leave it out with ignore=[{text!r}]"
    if name.uncertainty:
        return _remark_on_uncertainty(name, measured, leave)
    words = set(re.split(r"[\s_.\-]+", lowered))
    values = distinct(table, index)
    if words & _BOUND or _COMBINED.fullmatch(lowered.strip()):
        return (
            f"the column {text!r} looks like a statement of uncertainty and is not used: make it a standard "
            f"uncertainty in a column I_std (or that of another value), or {leave}"
        )
    if _DEGREE.fullmatch(name.key) and all(re.match(r"[-+.\d]|nan|$", value) for value in values):
        return (
            f"the column {text!r} looks like a degree of polarisation and is not used; if it is that of linear "
            f"polarisation, use it with column={{'dolp': {text!r}}}, or {leave}"
        )
    if len(values) < 2:
        return None
    shown = ", ".join(values[:_SHOWN]) + (" …" if len(values) > _SHOWN else "")
    one = f"take one with where={{{text!r}: {values[0]!r}}}"
    if _POLARIZATION.search(lowered):
        return f"the column {text!r} holds states of polarisation ({shown}), so their rows are mixed; {one}, or {leave}"
    if _WAVELENGTH.search(lowered) or words & _BAND:
        return (
            f"the column {text!r} looks like a wavelength ({shown}) and is not used; use it with "
            f"column={{'wavelength': {text!r}}}, {one}, or {leave}"
        )
    if _AZIMUTH.search(lowered):
        return (
            f"the column {text!r} looks like an azimuth and is not used; use it with "
            f"column={{'phi': {text!r}}}, or {leave}"
        )
    if _SAMPLE.search(lowered) or words & _SAMPLE_WORDS:
        return (
            f"the column {text!r} holds {len(values)} values ({shown}) and is not used, so their rows are "
            f"mixed; {one}, "
            f"keep them apart with column={{'group': {text!r}}}, or {leave}"
        )
    return None


def _remark_on_uncertainty(name: Name, measured: Sequence[str], leave: str) -> str | None:
    owner = name.variable
    if owner in ("theta_i", "theta_r", "phi", "wavelength", "group"):
        return None  # no data set holds uncertainties of directions
    key = "…_std"
    if owner is not None and owner in measured:
        key = std_name(owner)
    elif len(measured) == 1:
        key = std_name(measured[0])
    return (
        f"the column {name.text!r} looks like an uncertainty and is not used; use it with "
        f"column={{{key!r}: {name.text!r}}}, or {leave}"
    )


#: Illumination by light polarised along s or p, Q = I_p − I_s.
_STATES = {"s": "1,-1,0,0", "p": "1,1,0,0", "te": "1,-1,0,0", "tm": "1,1,0,0"}
_NATURAL_WORDS = "u n none unpol unpolarized unpolarised natural random 0"
_NATURAL = frozenset(_NATURAL_WORDS.split())


def require_one_illumination(
    table: Table, names: Sequence[Name], unused: Sequence[int], measured: Sequence[str]
) -> None:
    """Raise DataError, with the ways to read each, if the only values are those in s- and in p-polarised light."""
    if measured:
        return
    found = []
    for index in unused:
        match = re.fullmatch(r"(.+?)[\s_.\-]*(s|p|te|tm)", names[index].key)
        if match and parse_name(match[1]).variable == "I":
            found.append((names[index].text, _STATES[match[2]]))
    if found:
        ways = ", or ".join(f"column={{'I': {text!r}}} with illumination='{state}'" for text, state in found)
        raise DataError(
            f"{table.path}: the columns {', '.join(text for text, _ in found)} look like values in light "
            "polarised along "
            f"s or p; a data set holds one illumination: read one at a time, {ways} (Q = I_p - I_s)"
        )


def require_one_polarization(
    table: Table, names: Sequence[Name], unused: Sequence[int], stated: bool
) -> None:
    """Raise DataError if the rows were measured in light of several polarisations, or in one that is not stated.

    Parameters
    ----------
    table, names, unused
        The file, its names, and the positions of the columns that are not used.
    stated
        Whether an illumination is stated.
    """
    for index in unused:
        text, values = names[index].text, distinct(table, index)
        lowered = [value.lower() for value in values]
        if not _POLARIZATION.search(text.lower()) or not set(lowered) <= {*_STATES, *_NATURAL}:
            continue
        if not set(lowered) & _STATES.keys() or (stated and len(values) == 1):
            continue
        ways = [
            (f"where={{{text!r}: {v!r}}} and " if len(values) > 1 else "")
            + f"illumination='{_STATES.get(v.lower(), 'natural')}'"
            for v in values
        ]
        raise DataError(
            f"{table.path}: the column {text!r} says that the light was polarised ({', '.join(values)}); "
            "if that is the "
            "incident light, read "
            f"{'one state at a time, with ' if len(values) > 1 else 'it with '}{', or with '.join(ways)}"
            f" (Q = I_p - I_s; s-p turns the sign); if it does not matter, leave the column out with ignore=[{text!r}]"
        )
