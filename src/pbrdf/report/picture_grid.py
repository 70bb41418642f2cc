"""Axes for pictures in rows and columns, everything in its place in inches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Margins", "beside", "panel_height", "picture_grid"]

#: Height over width of a panel, at least and at most, whatever the picture's proportions are.
_FLATTEST, _STEEPEST = 0.25, 2.0


@dataclass(frozen=True)
class Margins:
    """Space around and between panels, inches."""

    left: float
    right: float
    top: float
    bottom: float
    across: float
    down: float


def panel_height(shape: tuple[int, int]) -> float:
    """Height over width of the panel of a picture with so many rows and columns."""
    return min(max(shape[0] / shape[1], _FLATTEST), _STEEPEST)


def picture_grid(
    rows: int,
    columns: int,
    width: float,
    shape: tuple[int, int],
    margins: Margins,
    groups: int = 1,
    title: float = 0.0,
) -> tuple[Figure, np.ndarray]:
    """Axes of the pictures' own proportions, as far as these are not extreme.

    Parameters
    ----------
    rows, columns
        Of panels in a group.
    width
        Of a panel, inches.
    shape
        Rows and columns of the picture.
    margins
        Around and between the panels.
    groups
        Grids below each other.
    title
        Space above each group but the first, inches.

    Returns
    -------
    figure, axes
        The axes have the shape (groups * rows, columns).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    high = width * panel_height(shape)
    m = margins
    group = rows * high + (rows - 1) * m.down
    size = (
        m.left + columns * width + (columns - 1) * m.across + m.right,
        m.top + groups * group + (groups - 1) * title + m.bottom,
    )
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    axes = np.empty((groups * rows, columns), dtype=object)
    for row in range(groups * rows):
        above = row // rows * (group + title) + row % rows * (high + m.down)
        for column in range(columns):
            x, y = m.left + column * (width + m.across), size[1] - m.top - above - high
            box = (x / size[0], y / size[1], width / size[0], high / size[1])
            axes[row, column] = figure.add_axes(box)
    return figure, axes


def beside(ax: Axes) -> Any:
    """The coordinates of the axes, moved right by a tenth of an inch: where a scale of colours stands."""
    from matplotlib.transforms import ScaledTranslation

    return ax.transAxes + ScaledTranslation(0.1, 0.0, ax.figure.dpi_scale_trans)
