"""What a CSV file states about its conventions, in comment lines before the column names or by options."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbrdf.data.formats.attributes import decode_attribute
from pbrdf.data.schema import ATTRIBUTE_NAME, FILE_KEYS, NATURAL_LIGHT, QUANTITIES, TEXT_ATTRIBUTES
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table
from pbrdf.files.plain_numbers import number_from_text

__all__ = ["Header", "statements"]

_OWN_KEYS = ("quantity", "illumination", "simulated", "scale", *FILE_KEYS)
#: The key, which no line can have, of a remark that the uncertainties are expanded ones.
_EXPANDED = "expanded uncertainties"
#: Characters of a remark.
_LOOKED_AT = 200
_ANGLES = {"degrees": True, "radians": False, "deg": True, "rad": False, "degree": True, "radian": False}
_YES_NO = {"yes": True, "1": True, "true": True, "no": False, "0": False, "false": False}


def statements(table: Table) -> dict[str, str]:
    """What the lines ``# key: value`` before the column names state; keys known here are in lower case."""
    stated = {}
    for line, comment in table.comments:
        statement = re.fullmatch(rf"#\s*({ATTRIBUTE_NAME})\s*:(?!//)(.*)", comment)
        if statement and line < table.statements_end:
            key, value = statement[1], statement[2].strip()
            lowered = key.lower()
            stated[lowered if lowered in (*_OWN_KEYS, *TEXT_ATTRIBUTES) else key] = value
        elif line < table.statements_end and re.search(r"(?i)expanded|coverage factor", comment[:_LOOKED_AT]):
            stated[_EXPANDED] = "expanded" if "expanded" in comment.lower() else ""
            if factor := re.search(
                r"(?<![\w.])(?:k|factor)\s*(?:=|of|:)?\s*(\d+(?:\.\d+)?)", comment[:_LOOKED_AT]
            ):
                stated.setdefault("coverage", factor[1])
    return stated


@dataclass(frozen=True)
class Header:
    """What a file states about its conventions, checked.

    Attributes
    ----------
    quantity
        As in :mod:`pbrdf.data.schema`; None where the file leaves it to the name of a column.
    forward_at_zero, p_minus_s, cosine_weighted, degrees
        Whether φ = 0 is forward, Q = I_p − I_s, values carry a factor cos θ_r, angles without a unit are in degrees.
    illumination
        Stokes vector of the source, in the file's convention.
    unstated
        Those of ``azimuth`` and ``stokes`` that the file does not state.
    illumination_stated
        Whether the illumination is stated.
    coverage
        Coverage factor of expanded uncertainties that do not state their own; None if nothing says so.
    expanded
        Whether the file says in words that its uncertainties are expanded ones.
    attrs
        All other statements, as attributes.
    """

    quantity: str | None
    forward_at_zero: bool
    p_minus_s: bool
    illumination: list[float]
    cosine_weighted: bool
    degrees: bool
    unstated: frozenset[str]
    illumination_stated: bool = False
    coverage: float | None = None
    expanded: bool = False
    attrs: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def parse(cls, path: Path, statements: Mapping[str, Any]) -> Header:
        """Check statements, texts of the file and values of options; raises DataError for what is not understood."""

        def choose(key: str, choices: Mapping[str, Any], default: str) -> Any:
            text = str(statements.get(key, default)).replace(" ", "").lower()
            if text not in choices:
                shown = ("degrees", "radians") if key == "angles" else choices
                raise DataError(f"{path}: {key} is {statements[key]!r}; use {' or '.join(shown)}")
            return choices[text]

        if "quantity" in statements and statements["quantity"] not in QUANTITIES:
            raise DataError(f"{path}: quantity is {statements['quantity']!r}; use {' or '.join(QUANTITIES)}")
        attrs = {
            key: decode_attribute(key, value)
            for key, value in statements.items()
            if key not in (*_OWN_KEYS, _EXPANDED)
        }
        attrs["simulated"] = int(choose("simulated", _YES_NO, "0"))
        if "scale" in statements:
            attrs["scale"] = choose("scale", {"arbitrary": "arbitrary", "absolute": "absolute"}, "absolute")
        return cls(
            quantity=statements.get("quantity"),
            forward_at_zero=choose("azimuth", {"forward=0": True, "forward=180": False}, "forward=0"),
            p_minus_s=choose("stokes", {"p-s": True, "s-p": False}, "p-s"),
            illumination=_illumination(path, statements.get("illumination", "natural")),
            cosine_weighted=choose("cosine_weighted", _YES_NO, "no"),
            degrees=choose("angles", _ANGLES, "degrees"),
            unstated=frozenset(("azimuth", "stokes")) - statements.keys(),
            illumination_stated="illumination" in statements,
            coverage=_coverage(path, statements.get("coverage")),
            expanded=bool(statements.get(_EXPANDED)),
            attrs=attrs,
        )


def _coverage(path: Path, stated: Any) -> float | None:
    if stated is None:
        return None
    match = re.fullmatch(r"(?:k\s*=\s*)?(\d+(?:\.\d+)?)", str(stated).strip())
    if match is None or float(match[1]) <= 0.0:
        raise DataError(f"{path}: coverage is {stated!r}; use the coverage factor k, such as 2")
    return float(match[1])


def _illumination(path: Path, stated: str | Sequence[float]) -> list[float]:
    if stated == "natural":
        return list(NATURAL_LIGHT)
    parts = stated.strip("[]() ").split(",") if isinstance(stated, str) else stated
    try:
        vector = [number_from_text(part) if isinstance(part, str) else float(part) for part in parts]
    except (TypeError, ValueError):
        vector = []
    if len(vector) != 4:
        raise DataError(f"{path}: illumination is {stated!r}; use natural or four numbers such as 1,0,0,0")
    return vector
