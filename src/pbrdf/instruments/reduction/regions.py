"""Regions of interest of a picture, and what is averaged over them.

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
from pbrdf.instruments.polarimeter.expected_noise import rounding_covariance, systematic_covariance
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.stokes_image import PixelFlag, StokesImage

__all__ = [
    "Ellipse",
    "LabelRegion",
    "Polygon",
    "Rectangle",
    "Region",
    "RegionAverage",
    "RegionSum",
    "require_inside",
    "rows_of",
]

_BAD = (PixelFlag.SATURATED, PixelFlag.DEAD, PixelFlag.DARK)

#: A region is dim if its pixels are on average not this many standard deviations of their noise above zero.
_DIM = 5.0


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
        return self.labels[first_row:last_row, :columns] == self.value

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
    """First and last row (not included) that the regions touch."""
    boxes = [region.box for region in regions.values()]
    return int(np.floor(min(box[2] for box in boxes))), int(np.ceil(max(box[3] for box in boxes)))


@dataclass(frozen=True)
class RegionAverage:
    """Mean over the good pixels of a region.

    Dark pixels are left out where the region is bright: they are shadows or defects. Where the region as a whole is so
    dim that noise alone makes pixels dark, they are part of the mean; without them it would be too bright.

    Attributes
    ----------
    stokes
        I, Q, U, V in digital numbers, shape (4,), in the instrument's axes; NaN where a component is not determined
        or no pixel is good.
    covariance
        Of the errors of `stokes`, shape (4, 4): detector noise, calibration, stability of the source.
    noise
        The part of it that is detector noise, shape (4, 4).
    scatter
        Standard deviation of the good pixels about the mean, shape (4,); NaN for fewer than two.
    pixels
        Number of pixels of the region.
    counts
        Of averaged ("good"), saturated, dead and dark pixels; a pixel may be counted in several of the last three, and
        dark ones that are averaged are good, not dark.
    """

    stokes: np.ndarray
    covariance: np.ndarray
    noise: np.ndarray
    scatter: np.ndarray
    pixels: int
    counts: dict[str, int]


class _PixelSum:
    """Sums over pixels, about a value near their mean so that squares do not lose their digits."""

    def __init__(self) -> None:
        self.count = 0
        self.origin: np.ndarray | None = None
        self.stokes = np.zeros(4)
        self.squares = np.zeros(4)
        self.covariance = np.zeros((4, 4))

    def add(self, stokes: np.ndarray, covariance: np.ndarray) -> None:
        """Add pixels, shapes (4, P) and (16, P)."""
        if not stokes.shape[1]:
            return
        if self.origin is None:
            self.origin = np.nan_to_num(stokes[:, 0])
        away = stokes - self.origin[:, None]
        self.count += stokes.shape[1]
        self.stokes += away.sum(axis=1)
        self.squares += np.einsum("kp,kp->k", away, away)
        self.covariance += covariance.sum(axis=1).reshape(4, 4)

    def joined(self, other: _PixelSum) -> _PixelSum:
        """The sums over the pixels of both."""
        if self.origin is None or other.origin is None:
            return other if self.origin is None else self
        found = _PixelSum()
        shift = other.origin - self.origin
        found.count, found.origin = self.count + other.count, self.origin
        found.stokes = self.stokes + other.stokes + other.count * shift
        found.squares = self.squares + other.squares + 2.0 * shift * other.stokes + other.count * shift**2
        found.covariance = self.covariance + other.covariance
        return found

    @property
    def mean(self) -> np.ndarray:
        """Mean Stokes vector, shape (4,)."""
        assert self.origin is not None
        return self.origin + self.stokes / self.count

    @property
    def scatter(self) -> np.ndarray:
        """Standard deviation of the pixels, shape (4,); NaN for one."""
        if self.count < 2:
            return np.full(4, np.nan)
        squares = self.squares - self.stokes**2 / self.count
        return np.sqrt(np.maximum(squares, 0.0) / (self.count - 1))

    @property
    def dim(self) -> bool:
        """Whether noise alone can make such pixels dark."""
        return bool(self.mean[0] < _DIM * np.sqrt(self.covariance[0, 0] / self.count))


class RegionSum:
    """Sums over the pixels of a region, to which blocks of a picture are added one after another."""

    def __init__(self) -> None:
        self.pixels = 0
        self._flagged = {str(flag.name).lower(): 0 for flag in _BAD}
        self._good = _PixelSum()
        self._dark = _PixelSum()

    def add(self, image: StokesImage, mask: np.ndarray | None = None) -> None:
        """Add the pixels of some rows that the mask (bool, shape of the rows; all without it) takes in."""
        if mask is not None and mask.all():
            mask = None
        flags = image.flags.ravel() if mask is None else image.flags[mask]
        stokes = image.stokes.reshape(4, -1) if mask is None else image.stokes[:, mask]
        covariance = (
            image.covariance.reshape(16, -1) if mask is None else image.covariance[:, :, mask].reshape(16, -1)
        )
        self.pixels += flags.size
        for flag in _BAD:
            self._flagged[str(flag.name).lower()] += int((flags & flag != 0).sum())
        good = flags == 0
        if good.all():
            self._good.add(stokes, covariance)
            return
        self._good.add(stokes[:, good], covariance[:, good])
        dark = (flags == PixelFlag.DARK) & np.isfinite(stokes[0])
        self._dark.add(stokes[:, dark], covariance[:, dark])

    def average(self, instrument: Instrument) -> RegionAverage:
        """Mean and its covariance, with the accuracy and stability of the instrument."""
        used, flagged = self._good, dict(self._flagged)
        if used.count and self._dark.count:
            everything = used.joined(self._dark)
            if everything.dim:
                used = everything
                flagged["dark"] -= self._dark.count
        counts = {"good": used.count, **flagged}
        if not used.count:
            nothing = np.full((4, 4), np.nan)
            return RegionAverage(nothing[0], nothing, nothing.copy(), nothing[0].copy(), self.pixels, counts)
        stokes = used.mean
        signal = instrument.polarimeter.mean_analyzer @ np.nan_to_num(stokes)
        noise = used.covariance / used.count**2 + rounding_covariance(instrument, signal, used.count)
        covariance = noise + systematic_covariance(instrument, stokes)
        return RegionAverage(stokes, covariance, noise, used.scatter, self.pixels, counts)
