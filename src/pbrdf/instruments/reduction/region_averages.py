"""Averages over regions of a picture, with their covariance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.polarimeter.expected_noise import rounding_covariance, systematic_covariance
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.regions import Region, require_inside, rows_of
from pbrdf.instruments.reduction.stokes_image import BAD_FLAGS, PixelFlag, StokesImage
from pbrdf.instruments.reduction.streaming import Block

__all__ = ["RegionAverage", "RegionCollector", "RegionSum"]

#: A region is dim if its pixels are on average not this many standard deviations of their noise above zero.
_DIM = 5.0


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
        self._flagged = {str(flag.name).lower(): 0 for flag in BAD_FLAGS}
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
        for flag in BAD_FLAGS:
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


class RegionCollector:
    """Averages of every region in every series: a sink for :func:`pbrdf.instruments.reduction.reduce.reduce`.

    Parameters
    ----------
    regions
        By name.
    frames, instrument
        What was measured, and with what.

    Raises
    ------
    DataError
        If a region is not within the pictures.
    """

    def __init__(self, regions: Mapping[str, Region], frames: Frames, instrument: Instrument) -> None:
        require_inside(regions, frames.rows, frames.columns)
        self._regions = dict(regions)
        self._columns = frames.columns
        self._instrument = instrument
        self._sums = {name: [RegionSum() for _ in frames.names] for name in regions}
        self.rows = rows_of(regions)

    def __enter__(self) -> RegionCollector:
        return self

    def prepare(self, block: Block) -> None:
        """Nothing: sums over pixels are taken in the order of the blocks, so that they always are the same."""

    def add(self, block: Block, part: None) -> None:
        """Add the pixels of the regions among these rows."""
        for name, region in self._regions.items():
            top, bottom = rows_of({name: region})
            first, last = max(top, block.first_row), min(bottom, block.last_row)
            if first >= last:
                continue
            here = slice(first - block.first_row, last - block.first_row)
            image = block.image
            rows = StokesImage(image.stokes[:, here], image.covariance[:, :, here], image.flags[here])
            self._sums[name][block.series].add(rows, region.mask(first, last, self._columns))

    def __exit__(self, *_: object) -> None:
        pass

    def averages(self) -> dict[str, list[RegionAverage]]:
        """For each region the average in each series."""
        return {name: [s.average(self._instrument) for s in sums] for name, sums in self._sums.items()}
