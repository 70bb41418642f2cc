"""The Mueller matrix: its sixteen elements over the hemisphere of viewing directions."""

from __future__ import annotations

from typing import Any

from pbrdf.explorer.evaluation import Grid, described, fields, prepare
from pbrdf.explorer.state import State
from pbrdf.explorer.workspace import Workspace

__all__ = ["GRID", "draw"]

#: The pictures are small: a direction every two degrees.
GRID = Grid(91, 91)
ELEMENTS = tuple(f"m{i}{j}" for i in range(4) for j in range(4))


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[memoryview]]:
    """m00, logarithmic, and the other elements as parts of it; of two models the differences."""
    pictures, planes = fields(state, ELEMENTS, GRID, dragging)
    if not dragging:
        prepare(state, ELEMENTS, lambda: fields(state, ELEMENTS, GRID, True))
    header = {
        "grid": [GRID.zeniths, GRID.azimuths],
        "pictures": [{**described(p, state.compare is not None), "range": None} for p in pictures],
        "name": state.shown.name,
        "compared": None if state.compare is None else state.layers[state.compare].name,
        "dragging": dragging,
    }
    return header, [planes.data.cast("B")]
