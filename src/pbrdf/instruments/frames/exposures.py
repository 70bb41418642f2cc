"""Single exposures, means of several, and repeated ones: the numbers of a state, and what is known of their noise.

A mean of N exposures has 1/N of the noise of one, and is rounded once more if it was kept as whole numbers. A pixel
that was saturated in some of them reads less than the end of the range on the mean, so that means count as saturated
from three standard deviations of a single exposure below it: what is cut off further up is less than 0.0004 of that.

Of K exposures that are there one by one the mean is taken; the scatter s² of a pixel about it is its noise, s²/K that
of the mean, whatever the detector's numbers say. Saturated is what is so in one of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrdf.instruments.polarimeter.detector import Detector

__all__ = ["Reading", "combine", "single"]

#: Standard deviations of a single exposure below the end of the range from which on a mean counts as saturated.
_MARGIN = 3.0


@dataclass(frozen=True, eq=False)
class Reading:
    """Numbers of the states of some pixels.

    Attributes
    ----------
    numbers
        Digital numbers, means where there are several exposures, shape (N, ...).
    saturated
        Where they must not be used, bool, shape (N, ...).
    scatter
        Variance of `numbers` from repeated exposures, shape (N, ...); None: that of the detector.
    share
        By which the detector's variance is to be multiplied.
    rounding
        What is to be added to it, digital numbers squared.
    """

    numbers: np.ndarray
    saturated: np.ndarray
    scatter: np.ndarray | None = None
    share: float = 1.0
    rounding: float = 0.0

    def variance(self, detector: Detector) -> np.ndarray:
        """Variance of the numbers, digital numbers squared, shape (N, ...)."""
        if self.scatter is not None:
            return self.scatter
        return detector.variance(self.numbers) * self.share + self.rounding


def combine(raw: np.ndarray, detector: Detector, exposures: int = 1) -> Reading:
    """What raw numbers say of the states.

    Parameters
    ----------
    raw
        Shape (N, rows, columns), or (K, N, rows, columns) for K repeats.
    detector
        What took them.
    exposures
        How many exposures each number is the mean of.
    """
    if raw.ndim == 3:
        return single(raw, detector, exposures)
    if len(raw) == 1:
        return single(raw[0], detector, exposures)
    count = len(raw)
    one = single(raw, detector, exposures)
    numbers = raw.mean(axis=0, dtype=float)
    squares = np.zeros_like(numbers)
    for exposure in raw:
        squares += np.square(exposure - numbers)
    return Reading(
        numbers,
        np.any(one.saturated, axis=0),
        squares / ((count - 1) * count),
        one.share / count,
        one.rounding / count,
    )


def single(numbers: np.ndarray, detector: Detector, exposures: int = 1) -> Reading:
    """Numbers of any shape that are there once, each the mean of so many exposures."""
    if exposures == 1:
        return Reading(numbers, detector.saturated(numbers))
    limit = detector.saturation - _MARGIN * float(np.sqrt(detector.variance(detector.saturation)))
    rounding = 1.0 / 12.0 if numbers.dtype.kind in "iu" else 0.0
    return Reading(numbers, np.greater_equal(numbers, limit), None, 1.0 / exposures, rounding)
