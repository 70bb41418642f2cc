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

_OWN_KEYS = ("quantity", "illumination", "simulated", *FILE_KEYS)
_YES_NO = {"yes": True, "1": True, "true": True, "no": False, "0": False, "false": False}


def statements(table: Table) -> dict[str, str]:
    """What the lines ``# key: value`` before the column names state; keys known here are in lower case."""
    stated = {}
    for line, comment in table.comments:
        statement = re.fullmatch(rf"#\s*({ATTRIBUTE_NAME})\s*:(?!//)(.*)", comment)
        if statement and line < table.names_line:
            key, value = statement[1], statement[2].strip()
            lowered = key.lower()
            stated[lowered if lowered in (*_OWN_KEYS, *TEXT_ATTRIBUTES) else key] = value
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
    attrs: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def parse(cls, path: Path, statements: Mapping[str, Any]) -> Header:
        """Check statements, texts of the file and values of options; raises DataError for what is not understood."""

        def choose(key: str, choices: Mapping[str, Any], default: str) -> Any:
            text = str(statements.get(key, default)).replace(" ", "").lower()
            if text not in choices:
                raise DataError(f"{path}: {key} is {statements[key]!r}; use {' or '.join(choices)}")
            return choices[text]

        if "quantity" in statements and statements["quantity"] not in QUANTITIES:
            raise DataError(f"{path}: quantity is {statements['quantity']!r}; use {' or '.join(QUANTITIES)}")
        attrs = {
            key: decode_attribute(key, value) for key, value in statements.items() if key not in _OWN_KEYS
        }
        attrs["simulated"] = int(choose("simulated", _YES_NO, "0"))
        return cls(
            quantity=statements.get("quantity"),
            forward_at_zero=choose("azimuth", {"forward=0": True, "forward=180": False}, "forward=0"),
            p_minus_s=choose("stokes", {"p-s": True, "s-p": False}, "p-s"),
            illumination=_illumination(path, statements.get("illumination", "natural")),
            cosine_weighted=choose("cosine_weighted", _YES_NO, "no"),
            degrees=choose("angles", {"degrees": True, "radians": False}, "degrees"),
            unstated=frozenset(("azimuth", "stokes")) - statements.keys(),
            attrs=attrs,
        )


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
