"""What a fit says about its parameters: uncertainty, correlation, goodness, and what stays undetermined."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

__all__ = [
    "Goodness",
    "covariance",
    "dark_below",
    "goodness",
    "middle",
    "prior_spread",
    "relative_errors",
    "typical",
    "typical_of_each",
]

#: Share of the typical intensity that :func:`dark_below` is.
DARK = 0.05


@dataclass(frozen=True)
class Goodness:
    """Goodness of a fit.

    Attributes
    ----------
    chi2
        Σ ((model − measured)/std)²: twice the minimised cost, so with a robust loss the sum of losses, and with
        priors plus the squares of their deviations.
    data, free
        Numbers of measured values and of free parameters.
    reduced_chi2
        χ²/(data − free); NaN without degrees of freedom.
    r_squared
        1 − Σ residual²/Σ (measured − mean)² by channel, unweighted.
    aic, bic
        Akaike's and the Bayesian information criterion. With known uncertainties from χ², else from
        data·ln(χ²/data) with the scale of the uncertainties estimated.
    """

    chi2: float
    data: int
    free: int
    reduced_chi2: float
    r_squared: dict[str, float]
    aic: float
    bic: float


def goodness(
    chi2: float,
    values: np.ndarray,
    modelled: Sequence[np.ndarray],
    std: np.ndarray,
    channels: tuple[str, ...],
    free: int,
    std_known: bool,
) -> Goodness:
    """Goodness of fit from measured and modelled values, (C, G); infinite ``std`` = not measured."""
    measured = np.isfinite(std)
    count = int(measured.sum())
    freedom = count - free
    r_squared = {}
    for c, name in enumerate(channels):
        y, f = values[c, measured[c]], modelled[c][measured[c]]
        spread = float(((y - y.mean()) ** 2).sum()) if y.size else 0.0
        r_squared[name] = 1.0 - float(((y - f) ** 2).sum()) / spread if spread > 0.0 else math.nan
    misfit = chi2 if std_known else count * math.log(max(chi2, 1e-300) / count)
    return Goodness(
        chi2=chi2,
        data=count,
        free=free,
        reduced_chi2=chi2 / freedom if freedom > 0 else math.nan,
        r_squared=r_squared,
        aic=misfit + 2.0 * free,
        bic=misfit + math.log(count) * free,
    )


def covariance(information: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Invert information matrices JᵀJ, letting directions without information have a very large variance.

    Parameters
    ----------
    information
        Shape (…, P, P).
    spread
        Natural scale of each unknown, shape (…, P); the matrix is scaled with it before its eigenvalues are
        judged against rounding.

    Returns
    -------
    ndarray
        Shape (…, P, P).
    """
    scale = spread[..., :, None] * spread[..., None, :]
    eigenvalues, vectors = np.linalg.eigh(information * scale)
    floor = eigenvalues.max(axis=-1, keepdims=True, initial=0.0) * 1e-15 + 1e-200
    inverse = (vectors / np.maximum(eigenvalues, floor)[..., None, :]) @ vectors.swapaxes(-1, -2)
    values: np.ndarray = inverse * scale
    return values


def prior_spread(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Standard deviation of a value of which only its bounds are known: range/√12."""
    values: np.ndarray = (upper - lower) / math.sqrt(12.0)
    return values


def typical(values: np.ndarray) -> float:
    """Median size of what was measured; where that is 0, as most of it is black, of what is not; 0 of nothing."""
    if not np.isfinite(values).any():
        return 0.0
    return float(typical_of_each(np.abs(values).ravel())[0])


def dark_below(measured: np.ndarray) -> float:
    """Intensity, above 0, below which relative errors do not grow: 5 % of the typical one, what is darker is noise."""
    return max(DARK * typical(measured), float(np.finfo(float).tiny))


def relative_errors(modelled: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(modelled − measured)/measured of intensities, relative to no less than :func:`dark_below`; shape (G,)."""
    values: np.ndarray = (modelled - measured) / np.maximum(measured, dark_below(measured))
    return values


def typical_of_each(size: np.ndarray) -> np.ndarray:
    """What :func:`typical` says of the sizes along the last axis, which is kept; infinite of nothing."""
    known = np.isfinite(size)
    median = middle(size, known)
    if (median == 0.0).any():
        lit = middle(size, known & (size > 0.0))
        median = np.where((median == 0.0) & np.isfinite(lit), lit, median)
    return median


def middle(values: np.ndarray, chosen: np.ndarray, axis: int = -1) -> np.ndarray:
    """Median of the chosen values along an axis, which is kept; infinite where none is."""
    ordered = np.where(chosen, values, np.inf)
    ordered.sort(axis=axis)
    count = chosen.sum(axis=axis, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(place, 0), axis=axis)
        for place in ((count - 1) // 2, count // 2)
    )
    return 0.5 * low + 0.5 * high
