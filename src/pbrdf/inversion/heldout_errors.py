"""Errors of predictions at geometries that a fit has not seen, one number for them, and its paired uncertainty.

The score of a prediction is √(e_I² + e_P²): e_I the median relative error of the intensity, e_P the root mean square
error of the normalised polarised components (Q/I, U/I, V/I, the Mueller elements over m00, or the DoLP where only
that was measured); where nothing polarised or no intensity was measured the other alone.

Errors at neighbouring geometries are alike, so that the points are no independent witnesses. What is resampled are
units: whole folds where there are enough of them, else bands of each fold. The same units are drawn for all models:
the difference of two scores has an uncertainty of its own, smaller than either score's where both err at the same
geometries (Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.inversion.statistics import dark_below

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ENOUGH_UNITS", "Paired", "PointErrors", "Resampling", "score", "units_of"]

#: So many folds are resampled whole; fewer are cut into bands.
ENOUGH_UNITS = 6
#: Bands of all folds together, where folds are cut.
BANDS = 12
#: Resamples, and the elements of a chunk of them.
RESAMPLES, _CHUNK = 500, 4_000_000
#: Probability of the interval within which two models cannot be told apart.
LEVEL = 0.95


@dataclass(frozen=True)
class PointErrors:
    """What a model misses at N geometries.

    Attributes
    ----------
    intensity
        Relative error of the intensity with its sign, shape (N,), relative to no less than 5 % of the data's median;
        NaN where none was measured, infinite where the model gives no number.
    polarised
        Errors of the normalised polarised components, shape (C, N), NaN where not measured or too dark; C is 0 where
        nothing polarised was measured.
    """

    intensity: np.ndarray
    polarised: np.ndarray

    @classmethod
    def of(cls, comparison: xr.Dataset, channels: tuple[str, ...], where: np.ndarray) -> PointErrors:
        """Errors at the geometries of a mask, from the comparison of a fit or of a cross-validation.

        Parameters
        ----------
        comparison
            As of :class:`~pbrdf.inversion.result.FitResult`.
        channels
            What was fitted.
        where
            Mask of shape (G,).
        """
        size = int(where.sum())

        def column(name: str) -> np.ndarray:
            return comparison[name].values[where] if name in comparison else np.full(size, np.nan)

        measured, modelled = column("I_measured"), column("I_modelled")
        floor = dark_below(comparison["I_measured"].values if "I_measured" in comparison else np.empty(0))
        with np.errstate(divide="ignore", invalid="ignore"):
            intensity = _penalised((modelled - measured) / np.maximum(measured, floor), measured)
            polarised = []
            for name in channels:
                if name in ("I", "m00"):
                    continue
                seen, given = column(f"{name}_measured"), column(f"{name}_modelled")
                if not is_ratio(name):
                    seen, given = seen / measured, given / modelled
                polarised.append(
                    np.where(measured < floor, np.nan, _penalised(given - seen, seen))
                )  # where it is dark the polarisation is noise
        return cls(intensity, np.array(polarised).reshape(len(polarised), size))

    @property
    def intensity_median(self) -> float:
        """Median size of the relative error of the intensity; NaN where none was measured."""
        known = self.intensity[~np.isnan(self.intensity)]
        return float(np.median(np.abs(known))) if known.size else math.nan

    @property
    def polarisation_rms(self) -> float:
        """Root mean square error of the normalised polarised components; NaN where none was measured."""
        known = self.polarised[~np.isnan(self.polarised)]
        return float(np.sqrt(np.mean(known**2))) if known.size else math.nan

    def take(self, where: np.ndarray) -> PointErrors:
        """Those at some of the geometries."""
        return PointErrors(self.intensity[where], self.polarised[:, where])


@dataclass(frozen=True)
class Paired:
    """The difference of two scores at the same geometries.

    Attributes
    ----------
    difference
        First score minus second: positive where the second predicts better.
    uncertainty
        Its standard uncertainty over the units.
    lower, upper
        Interval of 95 % for it: percentiles of the resamples, which need not lie evenly about the difference, stretched
        by what Student's distribution for the number of units is wider than the normal one.
    """

    difference: float
    uncertainty: float
    lower: float
    upper: float

    @property
    def apart(self) -> bool:
        """Whether the two can be told apart."""
        return self.lower > 0.0 or self.upper < 0.0


def score(errors: PointErrors) -> float:
    """√(e_I² + e_P²), see the module's docstring."""
    parts = [e for e in (errors.intensity_median, errors.polarisation_rms) if not math.isnan(e)]
    return math.hypot(*parts) if parts else math.nan


def units_of(
    fold: np.ndarray, theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray
) -> tuple[np.ndarray, str]:
    """Which unit each of N held-out geometries belongs to, numbered from 0, and what the units are in words.

    Bands of a fold hold about as many geometries each, by sinθ_r cosφ − sinθ_i, the distance from the mirror direction
    along the plane of incidence: both sides of that plane, which a model predicts alike, share a band.

    Parameters
    ----------
    fold
        Number of the fold of each geometry, shape (N,).
    theta_i, theta_r, phi
        Angles in radians.
    """
    distinct = np.unique(fold)
    if len(distinct) >= ENOUGH_UNITS:
        return np.unique(fold, return_inverse=True)[1], f"{len(distinct)} folds"
    place = np.round(np.sin(theta_r) * np.cos(phi) - np.sin(theta_i), 6)
    each = math.ceil(BANDS / len(distinct))
    unit = np.zeros(len(fold), dtype=int)
    count = 0
    for number in distinct:
        rows = fold == number
        _, member, counts = np.unique(place[rows], return_inverse=True, return_counts=True)
        middle = np.cumsum(counts) - 0.5 * counts
        _, band = np.unique(np.floor(middle * each / counts.sum()), return_inverse=True)
        unit[rows] = count + band[member]
        count += int(band.max()) + 1
    return unit, f"{count} bands of neighbouring directions"


class Resampling:
    """Scores of several models over the same resampled units.

    Parameters
    ----------
    unit
        Unit of each geometry, shape (N,), numbered from 0.
    seed
        Seed of the draws.
    """

    def __init__(self, unit: np.ndarray, seed: int = 0) -> None:
        self.unit = unit
        self.units = int(unit.max()) + 1
        drawn = np.random.default_rng(seed).integers(0, self.units, (RESAMPLES, self.units))
        self._times = np.stack([np.bincount(row, minlength=self.units) for row in drawn])

    def scores(self, errors: PointErrors) -> np.ndarray:
        """Score of each resample, shape (RESAMPLES,); NaN where a resample holds nothing."""
        squares = np.zeros(RESAMPLES)
        known = np.flatnonzero(~np.isnan(errors.intensity))
        if known.size:
            size = np.abs(errors.intensity[known])
            order = np.argsort(size)
            squares += _weighted_medians(size[order], self.unit[known[order]], self._times) ** 2
        if errors.polarised.size:
            there = ~np.isnan(errors.polarised)
            total = np.bincount(self.unit, (np.where(there, errors.polarised, 0.0) ** 2).sum(0), self.units)
            counts = np.bincount(self.unit, there.sum(0), self.units)
            with np.errstate(invalid="ignore", divide="ignore"):
                squares += (self._times @ total) / (self._times @ counts)
        return np.sqrt(squares)

    def uncertainty(self, scores: np.ndarray) -> float:
        """Standard uncertainty of what was computed of each resample; NaN for a single unit, or without numbers."""
        kept = scores[np.isfinite(scores)]
        if self.units < 2 or len(kept) < 0.9 * len(scores):
            return math.nan
        return float(kept.std(ddof=1))

    def paired(
        self, first: PointErrors, second: PointErrors, scores: tuple[np.ndarray, np.ndarray] | None = None
    ) -> Paired:
        """The difference of two models' scores; ``scores`` those of the resamples where they are known already."""
        from scipy.special import ndtri, stdtrit

        difference = score(first) - score(second)
        if math.isinf(difference):  # one of them gives no numbers
            return Paired(difference, math.nan, difference, difference)
        resampled = scores or (self.scores(first), self.scores(second))
        with np.errstate(invalid="ignore"):
            spread = resampled[0] - resampled[1]
        uncertainty = self.uncertainty(spread)
        if not math.isfinite(uncertainty):
            return Paired(difference, uncertainty, -math.inf, math.inf)
        tail = 0.5 - 0.5 * LEVEL
        stretch = float(stdtrit(self.units - 1, tail) / ndtri(tail))
        low, high = np.quantile(spread[np.isfinite(spread)], [tail, 1.0 - tail])
        ends = (difference + stretch * (end - difference) for end in (float(low), float(high)))
        return Paired(difference, uncertainty, *ends)


def _penalised(error: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """NaN only where nothing was measured: a model that gives no number there misses by infinity."""
    return np.where(np.isnan(error) & np.isfinite(measured), np.inf, error)


def _weighted_medians(values: np.ndarray, unit: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Lower median of ascending values for each row of weights by unit."""
    rows = max(_CHUNK // max(len(values), 1), 1)
    found = []
    for begin in range(0, len(times), rows):
        weight = times[begin : begin + rows][:, unit].cumsum(axis=1)
        total = weight[:, -1:]
        median = values[(2 * weight >= total).argmax(axis=1)]
        found.append(np.where(total[:, 0] > 0, median, np.nan))
    return np.concatenate(found)
