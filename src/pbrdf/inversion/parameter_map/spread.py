"""Standard errors, correlations and flags of the pixels of a block, by the definitions of a single fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbrdf.inversion.parameter_map.layout import FLAGS
from pbrdf.inversion.solver import on_bounds
from pbrdf.inversion.statistics import covariance, prior_spread

__all__ = ["Spread", "spread_of"]

#: Where the inverse of a matrix of unit diagonal has no larger elements than this, rounding is of no account.
WELL_CONDITIONED = 1e10


class Spread(NamedTuple):
    """How uncertain B sets of P unknowns are.

    Attributes
    ----------
    error
        Standard errors of the unknowns, shape (B, P); NaN on a bound.
    covariance
        Shape (B, P, P), 0 in the rows and columns of unknowns on a bound.
    flags
        Bits of :data:`~pbrdf.inversion.parameter_map.layout.FLAGS`, shape (B, P).
    """

    error: np.ndarray
    covariance: np.ndarray
    flags: np.ndarray


def spread_of(
    u: np.ndarray,
    information: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    scale: np.ndarray,
    shared: tuple[np.ndarray, np.ndarray] | None = None,
) -> Spread:
    """What :func:`~pbrdf.inversion.estimates.estimates_at` says of one fit, of many.

    Parameters
    ----------
    u, information
        Unknowns at the optimum and JᵀJ there, shapes (B, P) and (B, P, P).
    low, high
        Bounds of the unknowns, shape (B, P).
    scale
        What the covariance is multiplied with, shape (B,): the reduced χ² where the uncertainties' scale is a guess.
    shared
        Columns of the unknowns that were found from all pixels, shape (S,), and their covariance C, (B, S, S): with
        K = −A_φφ⁻¹ A_φθ, A being the information, the pixel's own have A_φφ⁻¹ + K C Kᵀ, and K C with the shared ones.
    """
    at_low, at_high = on_bounds(u, low, high)
    inside = ~(at_low | at_high)
    prior = prior_spread(low, high)
    own = inside
    if shared is not None:
        own = inside.copy()
        own[:, shared[0]] = False
    found = _inverse(information, own, prior)
    if shared is not None:
        columns, common = shared
        slope = -found @ information[:, :, columns]
        slope[:, columns] = np.eye(len(columns))
        found = found + slope @ common @ slope.swapaxes(1, 2)
    found *= scale[:, None, None]
    with np.errstate(invalid="ignore"):
        error = np.where(inside, np.sqrt(np.einsum("bpp->bp", found)), np.nan)
        undetermined = error >= prior
    flags = (
        at_low * np.uint8(FLAGS["at_lower_bound"])
        + at_high * np.uint8(FLAGS["at_upper_bound"])
        + undetermined * np.uint8(FLAGS["undetermined"])
    )
    return Spread(error, found, flags.astype(np.uint8))


def _inverse(information: np.ndarray, inside: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Covariances of the unknowns inside their bounds, 0 for the others."""
    size = information.shape[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = np.where(inside, 1.0 / np.sqrt(np.einsum("bpp->bp", information)), 0.0)
    usable = np.isfinite(unit).all(axis=1) & np.isfinite(information).all(axis=(1, 2))
    unit = np.where(usable[:, None], unit, 0.0)
    matrices = np.where(usable[:, None, None], information, 0.0)
    matrices *= unit[:, :, None] * unit[:, None, :]
    # to each a unit diagonal; rows of unknowns on a bound become those of the unit matrix
    matrices[:, range(size), range(size)] = 1.0
    inverse = _inverted(matrices)
    with np.errstate(invalid="ignore"):
        usable &= np.abs(inverse).max(axis=(1, 2), initial=0.0) < WELL_CONDITIONED
        # the inverse of what is not positive definite has no variances
        usable &= (np.einsum("bpp->bp", inverse) > 0.0).all(axis=1)
    inverse *= unit[:, :, None] * unit[:, None, :]
    inverse[~usable] = 0.0
    # the others by their eigenvalues, those with the same unknowns on a bound together
    left = np.flatnonzero(~usable & np.isfinite(information).all(axis=(1, 2)))
    for kept in np.unique(inside[left], axis=0):
        here = left[(inside[left] == kept).all(axis=1)]
        free = np.flatnonzero(kept)
        at = np.ix_(here, free, free)
        inverse[at] = covariance(information[at], prior[np.ix_(here, free)])
    return inverse


def _inverted(matrices: np.ndarray) -> np.ndarray:
    """Inverses; NaN of what is singular."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        # one that is exactly singular stops all
        regular = np.linalg.slogdet(matrices)[0] != 0.0
        result = np.full_like(matrices, np.nan)
        result[regular] = np.linalg.inv(matrices[regular])
        return result
