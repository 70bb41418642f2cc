"""Regions of interest of a picture.

Places are counted in pixels of the Stokes picture (for a mosaic one pixel is one cell): x from the left edge to the
right, y from the top edge down. A pixel belongs to a region if its centre, (column + ½, row + ½), lies in it, so that
the rectangle 10:20, 30:40 holds the columns 10 … 19 of the rows 30 … 39.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from pbrdf.errors import DataError

__all__ = ["Ellipse", "LabelRegion", "Polygon", "Rectangle", "Region", "require_inside", "rows_of"]


class Region(Protocol):
    """Part of a picture."""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, right, top and bottom edge of what encloses it, pixels."""
        ...

    def mask(self, first_row: int, last_row: int, columns: int) -> np.ndarray:
        """Which pixels of some rows belong to it, bool, shape (last_row − first_row, columns)."""
        ...

    def outline(self) -> np.ndarray:
        """Points (x, y) around it, for drawing, shape (K, 2); the last is the first."""
        ...


@dataclass(frozen=True)
class Rectangle:
    """Columns x0 … x1 and rows y0 … y1, the last ones not included."""

    x0: float
    x1: float
    y0: float
    y1: float

    def __post_init__(self) -> None:
        if not (self.x0 < self.x1 and self.y0 < self.y1):
            raise DataError(
                f"rectangle {self.x0:g}:{self.x1:g},{self.y0:g}:{self.y1:g}: give the smaller edge first"
            )

    @property
    def box(self) -> tuple[float, float, float, float]:
        return self.x0, self.x1, self.y0, self.y1

    def mask(self, first_row: int, last_row: int, columns: int) -> np.ndarray:
        x, y = _centres(first_row, last_row, columns)
        return (x > self.x0) & (x < self.x1) & (y > self.y0) & (y < self.y1)

    def outline(self) -> np.ndarray:
        x, y = (self.x0, self.x1, self.x1, self.x0, self.x0), (self.y0, self.y0, self.y1, self.y1, self.y0)
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True)
class Ellipse:
    """Ellipse about (x, y) with the half axes rx along x and ry along y, pixels."""

    x: float
    y: float
    rx: float
    ry: float

    def __post_init__(self) -> None:
        if not (self.rx > 0.0 and self.ry > 0.0):
            raise DataError(
                f"ellipse: its half axes are {self.rx:g} and {self.ry:g}, they must be more than 0"
            )

    @property
    def box(self) -> tuple[float, float, float, float]:
        return self.x - self.rx, self.x + self.rx, self.y - self.ry, self.y + self.ry

    def mask(self, first_row: int, last_row: int, columns: int) -> np.ndarray:
        x, y = _centres(first_row, last_row, columns)
        return ((x - self.x) / self.rx) ** 2 + ((y - self.y) / self.ry) ** 2 < 1.0

    def outline(self) -> np.ndarray:
        t = np.linspace(0.0, 2.0 * np.pi, 73)
        return np.stack([self.x + self.rx * np.cos(t), self.y + self.ry * np.sin(t)], axis=-1)


@dataclass(frozen=True)
class Polygon:
    """Polygon with the corners (x, y), …; where its edges cross, inside is what an odd number of them surrounds."""

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if len(self.points) < 3:
            raise DataError(f"a polygon has three corners or more, not {len(self.points)}")

    @property
    def box(self) -> tuple[float, float, float, float]:
        x, y = np.array(self.points, dtype=float).T
        return float(x.min()), float(x.max()), float(y.min()), float(y.max())

    def mask(self, first_row: int, last_row: int, columns: int) -> np.ndarray:
        x, y = _centres(first_row, last_row, columns)
        inside = np.zeros((last_row - first_row, columns), dtype=bool)
        corners = np.array(self.points, dtype=float)
        # a ray from the pixel to the right crosses the outline an odd number of times
        for (xa, ya), (xb, yb) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if ya != yb:
                between = (y > min(ya, yb)) & (y <= max(ya, yb))
                inside ^= between & (x < xa + (y - ya) * (xb - xa) / (yb - ya))
        return inside

    def outline(self) -> np.ndarray:
        return np.array([*self.points, self.points[0]], dtype=float)


@dataclass(frozen=True, eq=False)
class LabelRegion:
    """The pixels of a picture of labels (whole numbers, shape (rows, columns)) that have this value."""

    labels: np.ndarray = field(repr=False)
    value: int

    def __post_init__(self) -> None:
        if not (self.labels == self.value).any():
            raise DataError(f"no pixel of the picture of labels has the value {self.value}")

    @property
    def box(self) -> tuple[float, float, float, float]:
        rows, columns = np.nonzero(self.labels == self.value)
        return float(columns.min()), float(columns.max() + 1), float(rows.min()), float(rows.max() + 1)

    def mask(self, first_row: int, last_row: int, columns: int) -> np.ndarray:
        values: np.ndarray = self.labels[first_row:last_row, :columns] == self.value
        return values

    def outline(self) -> np.ndarray:
        return Rectangle(*self.box).outline()


def _centres(first_row: int, last_row: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(columns)[None, :] + 0.5, np.arange(first_row, last_row)[:, None] + 0.5


def require_inside(regions: Mapping[str, Region], rows: int, columns: int) -> None:
    """Check that every region holds a pixel and lies within a picture of this size.

    Raises
    ------
    DataError
        Names the region.
    """
    for name, region in regions.items():
        left, right, top, bottom = region.box
        if left < 0.0 or top < 0.0 or right > columns or bottom > rows:
            raise DataError(
                f"region {name!r} (x {left:g} … {right:g}, y {top:g} … {bottom:g}) reaches beyond the picture "
                f"of {columns} columns and {rows} rows; a mosaic counts in cells, not in single pixels"
            )
        if isinstance(region, LabelRegion) and region.labels.shape != (rows, columns):
            raise DataError(
                f"region {name!r}: its picture of labels is {region.labels.shape}, not {(rows, columns)}"
            )
        first, last = rows_of({name: region})
        if not region.mask(first, last, columns).any():
            raise DataError(f"region {name!r} holds no pixel's centre: make it larger")


def rows_of(regions: Mapping[str, Region]) -> tuple[int, int]:
    """First and last row (not included) that the regions touch; none without a region."""
    if not regions:
        return 0, 0
    boxes = [region.box for region in regions.values()]
    return int(np.floor(min(box[2] for box in boxes))), int(np.ceil(max(box[3] for box in boxes)))
