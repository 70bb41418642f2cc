"""Degree and angle of polarisation with their standard errors, and without the bias that noise gives the degree.

First order in the noise, with the exact derivatives of the ratios and the whole covariance of (I, Q, U, V), the
correlations of the intensity with the others included. The degree of polarisation is never negative, so noise lifts
it: by σ²/2p where p ≫ σ, by 1.25 σ where there is no polarisation. Estimators that take this back:

``wardle-kronberg``
    √(p² − b²), 0 below b: Wardle & Kronberg, Astrophysical Journal 194, 249 (1974). Clips, biased below p = 2σ.
``mas``
    p − b² (1 − exp(−p²/b²))/(2p): the modified asymptotic estimator, Plaszczynski et al., MNRAS 439, 4048 (2014).
    Never negative, continuous, unbiased above p ≈ 2σ.

Both take b² from the covariance as Plaszczynski et al. do (their eqs. 32-35): the variance across the direction of
polarisation in the plane of Q/I and U/I, which is what the bias is made of; σ² if the errors are equal and independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.optics import stokes as degrees

__all__ = ["Polarization", "debiased_dolp", "normalized_covariance", "polarization", "unbiased_dolp_squared"]

#: Standard deviation of an angle of polarisation of which nothing is known: uniform over π.
UNKNOWN_ANGLE = np.pi / np.sqrt(12.0)


@dataclass(frozen=True, eq=False)
class Polarization:
    """Degrees (ratios) and angle (radians) of polarisation with their standard errors, arrays of one shape.

    Attributes
    ----------
    dolp, docp, dop
        As :mod:`pbrdf.optics.stokes` defines them: not debiased. NaN where they need a component that is not known.
    aolp
        Within (−π/2, π/2].
    dolp_std, docp_std, dop_std, aolp_std
        First order. At p = 0 the direction of the error is not defined, and its mean over all directions is given. The
        error of the angle is never more than π/√12, that of an angle of which nothing is known.
    """

    dolp: np.ndarray
    dolp_std: np.ndarray
    docp: np.ndarray
    docp_std: np.ndarray
    dop: np.ndarray
    dop_std: np.ndarray
    aolp: np.ndarray
    aolp_std: np.ndarray


def polarization(stokes: ArrayLike, covariance: ArrayLike) -> Polarization:
    """Degrees and angle of polarisation with standard errors.

    Parameters
    ----------
    stokes
        I, Q, U, V, shape (4, ...).
    covariance
        Shape (4, 4, ...).

    Raises
    ------
    DataError
        If the shapes do not fit.
    """
    S, C = _checked(stokes, covariance)
    last = np.moveaxis(S, 0, -1)
    dolp, docp, dop, aolp = (f(last) for f in (degrees.dolp, degrees.docp, degrees.dop, degrees.aolp))
    normal = _normalized(S, C)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = S[1:] / S[0]
        flat = _along(ratios[:2], normal[:2, :2])
        # the angle moves across: its variance is that of q and u across the direction, over (2p)²
        turn = 0.5 * np.sqrt(_across(ratios[:2], normal[:2, :2])) / dolp
    return Polarization(
        dolp=dolp,
        dolp_std=np.sqrt(flat),
        docp=docp,
        docp_std=np.sqrt(normal[2, 2]),
        dop=dop,
        dop_std=np.sqrt(_along(ratios, normal)),
        aolp=aolp,
        # at p = 0 the quotient is infinite or 0/0
        aolp_std=np.where(dolp == 0.0, UNKNOWN_ANGLE, np.minimum(turn, UNKNOWN_ANGLE)),
    )


def normalized_covariance(stokes: ArrayLike, covariance: ArrayLike) -> np.ndarray:
    """Covariance of (Q/I, U/I, V/I), shape (3, 3, ...), first order: J C Jᵀ with J = [−(q, u, v), 1]/I."""
    return _normalized(*_checked(stokes, covariance))


def debiased_dolp(
    stokes: ArrayLike, covariance: ArrayLike, method: Literal["mas", "wardle-kronberg"] = "mas"
) -> np.ndarray:
    """Degree of linear polarisation without most of the bias of noise, shape (...).

    Parameters
    ----------
    stokes, covariance
        Shapes (4, ...) and (4, 4, ...).
    method
        ``"mas"`` or ``"wardle-kronberg"``.

    Raises
    ------
    DataError
        If the method is not known or the shapes do not fit.
    """
    S, C = _checked(stokes, covariance)
    if method not in ("mas", "wardle-kronberg"):
        raise DataError(f"no estimator is called {method!r}; use mas or wardle-kronberg")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = S[1:3] / S[0]
        p2 = (ratios**2).sum(axis=0)
        b2 = _across(ratios, _normalized(S, C)[:2, :2])
        if method == "wardle-kronberg":
            # NaN stays NaN
            return np.sqrt(np.where(p2 < b2, 0.0, p2 - b2))
        p = np.sqrt(p2)
        corrected = p + np.where(b2 > 0.0, b2 * np.expm1(-p2 / b2), 0.0) / (2.0 * p)
        # p − b²(1 − e^{−p²/b²})/2p → p/2 where p → 0
        return np.where(p2 == 0.0, 0.0, corrected)


def unbiased_dolp_squared(stokes: ArrayLike, covariance: ArrayLike) -> np.ndarray:
    """Estimate of the squared degree of linear polarisation whose mean is the true one; may be negative.

    p² − σ_q² − σ_u², of normal errors of q = Q/I and u = U/I.
    """
    S, C = _checked(stokes, covariance)
    normal = _normalized(S, C)
    with np.errstate(divide="ignore", invalid="ignore"):
        values: np.ndarray = ((S[1:3] / S[0]) ** 2).sum(axis=0) - normal[0, 0] - normal[1, 1]
        return values


def _checked(stokes: ArrayLike, covariance: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    S, C = np.asarray(stokes, dtype=float), np.asarray(covariance, dtype=float)
    if S.shape[:1] != (4,) or C.shape != (4, *S.shape):
        raise DataError(f"Stokes vectors {S.shape} with covariance {C.shape}: give (4, …) and (4, 4, …)")
    return S, C


def _normalized(S: np.ndarray, C: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        r = S[1:] / S[0]
        mixed = r[:, None] * C[0, 1:][None]
        moved = C[1:, 1:] - mixed - np.swapaxes(mixed, 0, 1) + r[:, None] * r[None] * C[0, 0]
        values: np.ndarray = moved / S[0] ** 2
        return values


def _along(r: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Variance along the vector r (k, ...) of its covariance (k, k, ...); the mean of all directions where r = 0."""
    length2 = (r**2).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.einsum("a...,ab...,b...->...", r, C, r) / length2
    values: np.ndarray = np.where(length2 == 0.0, np.einsum("aa...->...", C) / len(r), along)
    return values


def _across(r: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Variance across the vector r (2, ...) of its covariance (2, 2, ...); the mean of all directions where r = 0."""
    return _along(np.stack([-r[1], r[0]]), C)
