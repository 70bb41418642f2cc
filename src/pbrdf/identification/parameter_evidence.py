"""How well materials explain fitted parameters: a pixel of a map, or a fit whose data are not at hand.

Estimates u with covariance C of a specimen drawn from N(μ, Σ) are distributed as N(μ, Σ + C): the integrated likelihood
and the distance (u − μ)ᵀ (Σ + C)⁻¹ (u − μ) are closed forms. Parameters that the data do not determine come with a
large variance and say nothing. Bounds are not looked at: a parameter on a bound counts as not determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import FitError
from pbrdf.identification.material import Material

__all__ = ["parameter_evidence"]

#: Rows at a time: what a kernel reads stays in a processor's cache, and the memory is bounded.
BLOCK = 1 << 16


def parameter_evidence(
    materials: Sequence[Material], unknowns: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Integrated likelihoods of C materials for the estimates of N pixels.

    Parameters
    ----------
    materials
        Of one model with the same free parameters.
    unknowns
        Estimates of the solver's unknowns, shape (N, P).
    covariance
        Their covariances as lower triangles by rows, shape (N, P (P + 1) / 2).

    Returns
    -------
    log_evidence, distance
        Shape (N, C) each, float32; the first but for a constant of the pixel.

    Raises
    ------
    FitError
        If the materials differ in their model or free parameters.
    """
    first = materials[0].space
    for material in materials[1:]:
        own = material.space
        if own.model is not first.model or own.names != first.names:
            raise FitError(
                f"materials {materials[0].name} and {material.name} have different models or free parameters: "
                "parameters of a map can be compared with one kind only"
            )
    count = len(unknowns)
    log_evidence = np.empty((count, len(materials)), dtype=np.float32)
    distance = np.empty_like(log_evidence)
    for begin in range(0, count, BLOCK):
        rows = slice(begin, min(begin + BLOCK, count))
        _block(materials, unknowns[rows], covariance[rows], log_evidence[rows], distance[rows])
    return log_evidence, distance


def _block(
    materials: Sequence[Material],
    unknowns: np.ndarray,
    covariance: np.ndarray,
    log_evidence: np.ndarray,
    distance: np.ndarray,
) -> None:
    import drjit as dr

    backend = get_backend()
    Float = backend.Float
    size = unknowns.shape[1]
    u = [backend.upload(Float, column) for column in unknowns.T]
    C = [backend.upload(Float, column) for column in covariance.T]
    for place, material in enumerate(materials):
        mean = [dr.opaque(Float, float(x)) for x in material.mean]
        i, j = np.tril_indices(size)
        sigma = [dr.opaque(Float, float(x)) for x in material.covariance[i, j]]
        found = _normal(u, C, mean, sigma)
        dr.eval(found)
        log_evidence[:, place], distance[:, place] = (x.numpy() for x in found)


def _normal(u: list[Any], C: list[Any], mean: list[Any], sigma: list[Any]) -> tuple[Any, Any]:
    """log N(u; μ, Σ + C) but for (2π)^(−P/2), and the squared distance, by Cholesky."""
    import drjit as dr

    size = len(u)
    L: list[list[Any]] = []
    distance: Any = 0.0
    half_log: Any = 0.0
    y: list[Any] = []
    for i in range(size):
        row = i * (i + 1) // 2
        L.append([])
        for j in range(i + 1):
            value = sigma[row + j] + C[row + j]
            for q in range(j):
                value = dr.fma(-L[i][q], L[j][q], value)
            if i == j:
                half_log = half_log + 0.5 * dr.log(value)
                L[i].append(1.0 / dr.sqrt(value))
            else:
                L[i].append(value * L[j][j])
        value = u[i] - mean[i]
        for q in range(i):
            value = dr.fma(-L[i][q], y[q], value)
        y.append(value * L[i][i])
        distance = dr.fma(y[i], y[i], distance)
    return -0.5 * distance - half_log, distance
