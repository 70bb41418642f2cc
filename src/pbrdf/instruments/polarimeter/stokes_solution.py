"""Least-squares Stokes parameters of many pixels at once, and what a set of analyser vectors determines.

Ŝ = W⁺ I with Cov Ŝ = W⁺ Σ W⁺ᵀ, or with weights Ŝ = (WᵀΣ⁻¹W)⁻¹ WᵀΣ⁻¹ I with Cov Ŝ = (WᵀΣ⁻¹W)⁻¹; Σ is the diagonal
covariance of the intensities. Sources: Tyo et al., Applied Optics 45, 5453 (2006); Montier et al., A&A 574, A135
(2015).

A set that measures only part of the Stokes vector has a normal matrix without an inverse. With the projector Π on what
it measures, (WᵀΣ⁻¹W + c(1 − Π))⁻¹ = (WᵀΣ⁻¹W)⁺ + (1 − Π)/c for any c: the pseudo-inverse without a decomposition, and
positive weights do not change Π. Pixels stand last in all arrays here, so that the 4 × 4 elimination runs over whole
rows of pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError

__all__ = ["determined_components", "row_space", "solve_stokes"]

#: Singular values of analyser vectors below this share of the largest count as 0: what they carry is not measured.
RANK_TOLERANCE = 1e-7

#: A component counts as determined if the analyser vectors span it up to rounding.
_SPANNED = 1e-9

#: Pixels worked on at a time: bounds what is needed beside input and output.
BLOCK = 1 << 15

#: A pivot below this share of its diagonal element sends a pixel to a way that does not square the condition number.
_SMALL_PIVOT = 1e-9


def row_space(analyzer: np.ndarray) -> np.ndarray:
    """Projector on what sets of analyser vectors (..., N, 4) measure, shape (..., 4, 4); the unit matrix if all."""
    sets = analyzer.reshape(-1, *analyzer.shape[-2:])
    projector = np.empty((len(sets), 4, 4))
    projector[:] = np.eye(4)
    for first in range(0, len(sets), BLOCK):
        W = sets[first : first + BLOCK]
        gram = W.transpose(0, 2, 1) @ W
        mean = np.maximum(np.trace(gram, axis1=1, axis2=2) / 4.0, np.finfo(float).tiny)
        # det/mean⁴ above 1e-10 keeps the smallest eigenvalue well above the tolerance: no decomposition needed
        weak = np.flatnonzero(~(np.linalg.det(gram / mean[:, None, None]) > 1e-10))
        if weak.size:
            projector[first + weak] = np.linalg.pinv(W[weak], rcond=RANK_TOLERANCE) @ W[weak]
    return projector.reshape(*analyzer.shape[:-2], 4, 4)


def determined_components(projector: np.ndarray) -> np.ndarray:
    """Which of I, Q, U, V are determined where :func:`row_space` is `projector`, shape (..., 4), bool."""
    values: np.ndarray = np.einsum("...ii->...i", projector) > 1.0 - _SPANNED
    return values


def solve_stokes(
    intensities: ArrayLike, variance: ArrayLike, analyzer: ArrayLike, *, weighted: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares Stokes parameters and their covariance.

    Parameters
    ----------
    intensities, variance
        Shape (N, ...).
    analyzer
        Shape (N, 4) or (..., N, 4).
    weighted
        By the inverse variances, or all states alike.

    Returns
    -------
    stokes, covariance
        Shapes (4, ...) and (4, 4, ...); NaN in the components that the analyser vectors do not determine, and where an
        intensity is not finite or a variance is not a positive number.

    Raises
    ------
    DataError
        If the shapes do not fit.
    """
    values = np.asarray(intensities, dtype=float)
    W = np.asarray(analyzer, dtype=float)
    fits = W.ndim >= 2 and W.shape[-2:] == (*values.shape[:1], 4) and W.shape[:-2] in ((), values.shape[1:])
    if not fits or np.shape(variance) != values.shape:
        raise DataError(
            f"shapes do not fit: intensities {values.shape}, variance {np.shape(variance)}, analyser vectors {W.shape}"
        )
    shape = values.shape[1:]
    values = values.reshape(len(values), -1)
    spread = np.asarray(variance, dtype=float).reshape(values.shape)
    if W.ndim > 2:
        W = W.reshape(-1, *W.shape[-2:])
    stokes = np.empty((4, values.shape[1]))
    covariance = np.empty((4, 4, values.shape[1]))
    for first in range(0, values.shape[1], BLOCK):
        block = slice(first, first + BLOCK)
        v, s = values[:, block], spread[:, block]
        bad = ~(np.isfinite(v) & np.isfinite(s) & (s > 0.0)).all(axis=0)
        vectors = W[block] if W.ndim > 2 else W
        projector = row_space(vectors)
        stokes[:, block], covariance[:, :, block] = solve_block(
            np.where(bad, 0.0, v), np.where(bad, 1.0, s), vectors, projector, weighted
        )
        blank(stokes[:, block], covariance[:, :, block], projector, bad)
    return stokes.reshape(4, *shape), covariance.reshape(4, 4, *shape)


def solve_block(
    values: np.ndarray,
    variance: np.ndarray,
    analyzer: np.ndarray,
    projector: np.ndarray,
    weighted: bool,
    spread: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The shortest least-squares solution, and its covariance, of pixels whose numbers are all good.

    Shapes: (N, P) twice, (N, 4) or (P, N, 4) analyser vectors with (4, 4) or (P, 4, 4) projectors; returns (4, P) and
    (4, 4, P), with numbers in what is not determined too. `spread`, of the shape of the variance, is what the values
    really vary by if the variance only weighs them.
    """
    spread = variance if spread is None else spread
    own_spread = spread is not variance
    if analyzer.ndim == 2 and not weighted:
        inverse = np.linalg.pinv(analyzer, rcond=RANK_TOLERANCE)
        outer = (inverse[:, None] * inverse[None]).reshape(16, -1)
        return inverse @ values, (outer @ spread).reshape(4, 4, -1)
    W = analyzer[:, :, None] if analyzer.ndim == 2 else np.ascontiguousarray(analyzer.transpose(1, 2, 0))
    missing = np.eye(4)[:, :, None] - (
        projector[:, :, None] if projector.ndim == 2 else projector.transpose(1, 2, 0)
    )
    weights = 1.0 / variance if weighted else np.ones((len(values), 1))
    inverse, hard = _pseudo_inverse(W, weights, missing)
    if weighted and not own_spread:
        right = np.stack([(W[:, a] * weights * values).sum(axis=0) for a in range(4)])
        solution, covariance = np.einsum("abp,bp->ap", inverse, right), inverse
    else:
        matrix = np.einsum("abp,nbp->anp", inverse, W) * weights
        solution = np.einsum("anp,np->ap", matrix, values)
        covariance = np.einsum("anp,np,bnp->abp", matrix, spread, matrix)
    for p in np.flatnonzero(hard).tolist():
        own, root, gap = (_pixel(array, p) for array in (W, np.sqrt(weights), missing))
        inverse = _graded_inverse(own, root, gap)
        solution[:, p], covariance[:, :, p] = inverse @ values[:, p], (inverse * spread[:, p]) @ inverse.T
    return solution, covariance


def blank(stokes: np.ndarray, covariance: np.ndarray, projector: np.ndarray, bad: np.ndarray) -> None:
    """Put NaN, in place, where nothing is known: bad pixels, and components that are not determined."""
    unknown = ~determined_components(projector)
    unknown = (unknown[:, None] if unknown.ndim == 1 else unknown.T) | bad
    stokes[unknown] = np.nan
    covariance[unknown[:, None] | unknown[None]] = np.nan


def _pixel(array: np.ndarray, p: int) -> np.ndarray:
    return array[..., p if array.shape[-1] > 1 else 0]


def _pseudo_inverse(W: np.ndarray, weights: np.ndarray, missing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(Σ_n w_n W_n W_nᵀ)⁺ for vectors (N, 4, P or 1), weights (N, P or 1), 1 − Π (4, 4, P or 1).

    Returns the inverses (4, 4, P) and which of them are not to be trusted (P,).
    """
    pixels = max(W.shape[-1], weights.shape[-1])
    normal = np.empty((4, 4, pixels))
    for a in range(4):
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = (W[:, a] * W[:, b] * weights).sum(axis=0)
    if not missing.any():
        return _invert(normal)
    scale = np.maximum(np.einsum("aap->p", normal) / 4.0, np.finfo(float).tiny)
    inverse, hard = _invert(normal + scale * missing)
    return inverse - missing / scale, hard


def _graded_inverse(W: np.ndarray, root: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """(√w W)⁺ √w of one pixel (4, N) where weights differ by many orders of magnitude.

    Householder elimination with columns exchanged and rows sorted by size is accurate row by row (Cox & Higham, in
    Numerical Analysis 1997, Longman, p. 57); a singular value decomposition is accurate to the largest row only.
    """
    from scipy.linalg import qr, solve_triangular

    scaled = np.concatenate([W * root[:, None], missing * np.abs(W * root[:, None]).max()])
    order = np.argsort(-np.abs(scaled).max(axis=1))
    q, r, columns = qr(scaled[order], mode="economic", pivoting=True)
    inverse = np.empty((4, len(order)))
    inverse[np.ix_(columns, order)] = solve_triangular(r, q.T)
    values: np.ndarray = inverse[:, : len(root)] * root
    return values


def _invert(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses of symmetric positive definite matrices (4, 4, P) from M = L D Lᵀ, and where a pivot was too small."""
    size, pixels = len(matrices), matrices.shape[-1]
    lower = np.zeros_like(matrices)
    pivots = np.empty((size, pixels))
    hard = np.zeros(pixels, dtype=bool)
    for j in range(size):
        pivot = matrices[j, j] - (lower[j, :j] ** 2 * pivots[:j]).sum(axis=0)
        small = ~(pivot > _SMALL_PIVOT * matrices[j, j])
        hard |= small
        pivots[j] = np.where(small, 1.0, pivot)
        lower[j, j] = 1.0
        for i in range(j + 1, size):
            lower[i, j] = (matrices[i, j] - (lower[i, :j] * lower[j, :j] * pivots[:j]).sum(axis=0)) / pivots[
                j
            ]
    # K = L⁻¹ by forward substitution, M⁻¹ = Kᵀ D⁻¹ K
    solved = np.zeros_like(matrices)
    for j in range(size):
        solved[j, j] = 1.0
        for i in range(j + 1, size):
            solved[i, j] = -(lower[i, j:i] * solved[j:i, j]).sum(axis=0)
    inverse = np.empty_like(matrices)
    for a in range(size):
        for b in range(a + 1):
            inverse[a, b] = inverse[b, a] = (solved[a:, a] * solved[a:, b] / pivots[a:]).sum(axis=0)
    return inverse, hard
