"""Parameters that the pixels of a map share: Newton's method on what is left when every pixel is fitted by itself.

With θ shared and φ_p each pixel's own, the profile F(θ) = Σ_p min_φ F_p(θ, φ) has, where every pixel stands at its
minimum, the gradient Σ_p ∂F_p/∂θ, and the curvature of Gauss and Newton Σ_p (A_θθ − A_θφ A_φφ⁻¹ A_φθ) with A = JᵀJ of
the pixel: the Schur complement of its own unknowns (compare :mod:`pbrdf.inversion.block_solver`). A pass over the image
fits all pixels at given θ, block by block, and leaves these sums only; a few passes are enough, however large the image
is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbrdf.inversion.problem import Space, prior_residuals

__all__ = ["Shared", "Sums", "described", "newton", "sums_of", "with_priors"]

#: A step that promises to lower χ²/2 by no more than this is the last, taken unseen: a thousandth of a standard error.
LAST_STEP = 1e-6
#: Passes over the image, at most.
PASSES = 30


@dataclass(frozen=True, eq=False)
class Shared:
    """What was found of the S shared parameters, for each of L labels.

    Attributes
    ----------
    columns
        Which of the free parameters they are, shape (S,).
    labels
        Shape (L,), ascending; a single 1 where pixels have none.
    unknowns, low, high
        The solver's unknowns and their bounds, shape (L, S).
    covariance
        Of the unknowns, shape (L, S, S), 0 for what stands on a bound; from χ² with the uncertainties as they are.
    chi2, freedom
        Of all pixels of a label together, and its degrees of freedom, shape (L,).
    std_known, converged
        Whether the uncertainties are known, and whether a minimum was found, shape (L,).
    passes
        How often the image was gone through.
    """

    columns: np.ndarray
    labels: np.ndarray
    unknowns: np.ndarray
    low: np.ndarray
    high: np.ndarray
    covariance: np.ndarray
    chi2: np.ndarray
    freedom: np.ndarray
    std_known: np.ndarray
    converged: np.ndarray
    passes: int


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the pixels of each of L labels.

    Attributes
    ----------
    cost, gradient, curvature
        Of the profile, shapes (L,), (L, S) and (L, S, S).
    values, own
        Numbers of measured values and of unknowns of the pixels' own, shape (L,).
    guessed
        Number of pixels of which the scale of the uncertainties is a guess, shape (L,).
    """

    cost: np.ndarray
    gradient: np.ndarray
    curvature: np.ndarray
    values: np.ndarray
    own: np.ndarray
    guessed: np.ndarray

    @classmethod
    def zero(cls, labels: int, size: int) -> Sums:
        """Of no pixels."""
        none = np.zeros(labels)
        return cls(
            np.zeros(labels), np.zeros((labels, size)), np.zeros((labels, size, size)), none, none, none
        )

    def __add__(self, other: Sums) -> Sums:
        return Sums(
            self.cost + other.cost,
            self.gradient + other.gradient,
            self.curvature + other.curvature,
            self.values + other.values,
            self.own + other.own,
            self.guessed + other.guessed,
        )


def sums_of(
    rows: np.ndarray,
    labels: int,
    columns: np.ndarray,
    cost: np.ndarray,
    gradient: np.ndarray,
    information: np.ndarray,
    inside: np.ndarray,
    values: np.ndarray,
    std_known: np.ndarray,
) -> Sums:
    """The sums over some pixels.

    Parameters
    ----------
    rows
        Row of the label of each pixel, shape (B,).
    labels
        Their number L.
    columns
        Which unknowns are shared, shape (S,).
    cost, gradient, information
        Of each pixel at its minimum, shapes (B,), (B, P) and (B, P, P).
    inside
        Which unknowns are the pixel's own and free to move, shape (B, P).
    values
        Number of measured values of each pixel, shape (B,).
    std_known
        Whether the uncertainties of each are known, shape (B,).
    """
    size = gradient.shape[1]
    free = np.where(inside, 1.0, 0.0)
    with np.errstate(divide="ignore"):
        diagonal = np.einsum("bpp->bp", information)
        unit = free / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    own = information * unit[:, :, None] * unit[:, None, :]
    own[:, range(size), range(size)] = 1.0 + 1e-14
    mixed = information[:, :, columns] * unit[:, :, None]
    # the pixels' own unknowns are eliminated from the gradient and from the curvature
    solved = np.linalg.solve(own, np.concatenate([mixed, (gradient * unit)[..., None]], axis=2))
    inner = np.einsum("bps,bpt->bst", mixed, solved)
    curvature = information[:, columns][:, :, columns] - inner[..., :-1]
    slope = gradient[:, columns] - inner[..., -1]
    used = np.isfinite(cost) & np.isfinite(slope).all(axis=1) & np.isfinite(curvature).all(axis=(1, 2))
    result = Sums.zero(labels, len(columns))
    for total, part in (
        (result.cost, cost),
        (result.gradient, slope),
        (result.curvature, curvature),
    ):
        np.add.at(total, rows[used], part[used])
    return Sums(
        result.cost,
        result.gradient,
        result.curvature,
        np.bincount(rows[used], values[used], labels),
        np.bincount(rows[used], inside[used].sum(axis=1), labels),
        np.bincount(rows[used], ~std_known[used], labels),
    )


def with_priors(sums: Sums, space: Space, unknowns: np.ndarray) -> Sums:
    """With the priors of the shared parameters, which count once for each label."""
    penalty = prior_residuals(space)
    if penalty is None:
        return sums
    r, slope = penalty(unknowns)
    curvature, every = sums.curvature.copy(), range(r.shape[1])
    curvature[:, every, every] += slope**2
    return replace(
        sums,
        cost=sums.cost + 0.5 * (r * r).sum(axis=1),
        gradient=sums.gradient + slope * r,
        curvature=curvature,
    )


def newton(
    evaluate: Callable[[np.ndarray], Sums], start: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, Sums, np.ndarray, int]:
    """Minimise the profile of each label within bounds.

    Parameters
    ----------
    evaluate
        Sums at unknowns of shape (L, S).
    start, low, high
        Where to begin, and the bounds, shape (L, S).

    Returns
    -------
    unknowns, sums, converged, passes
        Shape (L, S); the sums there, or a step of no account before; shape (L,); the number of evaluations.
    """
    theta = np.clip(start, low, high)
    sums = evaluate(theta)
    damping = np.zeros(len(theta))
    for passes in range(1, PASSES + 1):
        step = np.stack(
            [
                _step(g, A, float(d), t, a, b)
                for g, A, d, t, a, b in zip(
                    sums.gradient, sums.curvature, damping, theta, low, high, strict=True
                )
            ]
        )
        quadratic = 0.5 * np.einsum("ls,lst,lt->l", step, sums.curvature, step)
        promised = -np.einsum("ls,ls->l", step, sums.gradient) - quadratic
        arrived = promised <= LAST_STEP * (1.0 + damping)
        if arrived.all() or passes == PASSES:
            return np.where(arrived[:, None], theta + step, theta), sums, arrived, passes
        trial = np.where(arrived[:, None], theta, theta + step)
        tried = evaluate(trial)
        better = tried.cost < sums.cost
        damping = np.where(better, 0.1 * damping, np.maximum(10.0 * damping, 0.01))
        # a step that rounding keeps from being better is as good as the last
        taken = better | arrived
        theta = np.where(taken[:, None], trial, theta)
        sums = Sums(
            np.where(taken, tried.cost, sums.cost),
            np.where(taken[:, None], tried.gradient, sums.gradient),
            np.where(taken[:, None, None], tried.curvature, sums.curvature),
            tried.values,
            tried.own,
            tried.guessed,
        )
    raise AssertionError


def _step(
    gradient: np.ndarray,
    curvature: np.ndarray,
    damping: float,
    at: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """Damped step of one label, within the bounds."""
    step = np.zeros_like(at)
    free = ~(((at <= low) & (gradient > 0.0)) | ((at >= high) & (gradient < 0.0)))
    free &= np.diag(curvature) > 0.0
    for _ in range(len(at)):
        if not free.any():
            break
        kept = np.ix_(free, free)
        matrix = curvature[kept] * (1.0 + damping * np.eye(free.sum()))
        step[free] = np.linalg.lstsq(
            matrix, -(gradient + curvature @ np.where(free, 0.0, step))[free], rcond=1e-14
        )[0]
        outside = free & ((at + step < low) | (at + step > high))
        if not outside.any():
            break
        step[outside] = (np.clip(at + step, low, high) - at)[outside]
        free &= ~outside
    return step


def described(shared: Shared, names: list[str], values: np.ndarray, errors: np.ndarray) -> Mapping[str, Any]:
    """What was found, as JSON can hold it: by label, or of all pixels."""
    told = [
        {
            "values": dict(zip(names, map(float, v), strict=True)),
            "standard_errors": {
                n: float(x) if np.isfinite(x) else None for n, x in zip(names, e, strict=True)
            },
            "chi2": float(chi2),
            "degrees_of_freedom": int(freedom),
            "converged": bool(converged),
        }
        for v, e, chi2, freedom, converged in zip(
            values, errors, shared.chi2, shared.freedom, shared.converged, strict=True
        )
    ]
    return {str(label): one for label, one in zip(shared.labels.tolist(), told, strict=True)}
