"""The chosen quantities over the hemisphere of viewing directions, or their differences between two models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pbrdf.explorer.evaluation import POLARISED, Grid, described, fields, prepare
from pbrdf.explorer.state import QUANTITIES, State, StateError, number
from pbrdf.explorer.workspace import Workspace

__all__ = ["GRID", "draw"]

#: A direction a degree.
GRID = Grid(181, 181)


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[memoryview]]:
    """One picture for each quantity of the state.

    ``settings.hemisphere.range`` fixes the ranges of colours: the least and the largest value by the quantity, in the
    units of the colour bar; others follow what is shown.

    Raises
    ------
    StateError
        If a range is none.
    """
    difference = state.compare is not None
    ranges = _ranges(state.settings.get("hemisphere", {}))
    # angles of polarisation fade where there is none
    hidden = (POLARISED,) if "aolp" in state.quantities else ()
    asked = (*state.quantities, *hidden)
    found, planes = fields(state, asked, GRID, dragging)
    if not dragging:
        prepare(state, asked, lambda: fields(state, asked, GRID, True))
    pictures, strength = found[: len(state.quantities)], found[len(state.quantities) :]
    shown = []
    for picture in pictures:
        content = described(picture, difference)
        content["range"] = _fixed(content, ranges)
        if picture.quantity == "aolp":
            content["polarised"] = [strength[0].plane, strength[0].mirrored]
        shown.append(content)
    header = {
        "grid": [GRID.zeniths, GRID.azimuths],
        "pictures": shown,
        "theta_i": state.light.theta_i,
        "name": state.shown.name,
        "compared": None if state.compare is None else state.layers[state.compare].name,
        "dragging": dragging,
    }
    return header, [planes.data.cast("B")]


def _ranges(settings: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    given = settings.get("range", {})
    place = "settings.hemisphere.range"
    if not isinstance(given, Mapping):
        raise StateError(
            place, "ranges of colours should be a JSON object: least and largest value by the quantity"
        )
    found = {}
    for quantity, ends in given.items():
        if quantity not in QUANTITIES:
            raise StateError(place, f"{str(quantity)[:40]!r} is not one of {', '.join(QUANTITIES)}")
        if not isinstance(ends, list | tuple) or len(ends) != 2:
            raise StateError(f"{place}.{quantity}", "a range of colours has a least and a largest value")
        low, high = (number(end, f"{place}.{quantity}") for end in ends)
        if not low < high:
            raise StateError(
                f"{place}.{quantity}", "the least value of a range of colours is below its largest"
            )
        found[quantity] = (low, high)
    return found


def _fixed(
    picture: Mapping[str, Any], ranges: Mapping[str, tuple[float, float]]
) -> tuple[float, float] | None:
    """A fixed range as the picture's planes count, None where it follows."""
    quantity = picture["quantity"]
    if quantity not in ranges or picture["colours"] == "cyclic":
        return None
    low, high = ranges[quantity]
    if not picture["logarithmic"]:
        return low, high
    if low <= 0.0:
        raise StateError(f"settings.hemisphere.range.{quantity}", "logarithmic colours begin above 0")
    return math.log10(low), math.log10(high)
