"""Make the table of ``pbrdf.optics.mirror_reflectance``: reflectance of mirror facets with Gaussian slopes.

Integrates the light that facets with |r| = 1 and V-cavity shadowing reflect into the hemisphere, over slopes, with
nodes on both sides of the edges of the lit region; fits a product of Chebyshev polynomials; prints the coefficients
as the lines of the module, and the largest error on other nodes than those of the fit.

Run as ``python scripts/make_mirror_reflectance.py``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import chebyshev, legendre

#: Degrees in the mapped angle and in σ; largest σ; scale of the map.
DEGREES, LARGEST, SCALE = (14, 12), 1.0, 2.0
#: Standard deviations of slope that the integral reaches to.
REACH = 8.0


def panels(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights, ``count`` times 24."""
    node, weight = legendre.leggauss(24)
    edges = np.linspace(low, high, count + 1)
    half = 0.5 * (edges[1:] - edges[:-1])[:, None]
    return (half * (node + 1.0) + edges[:-1, None]).ravel(), (half * weight).ravel()


def reflectance(sigma: float, tan_theta: float) -> float:
    """E[min(g/c, 2, 2 cosθ_r/c)] over lit facets whose light goes up, g = c + s x; slopes x, y ~ N(0, σ²).

    With dω_r = 4 cosβ dω_m the integral of f cosθ_r is ∫ P G cosβ/(cosθ cosθ_i) dω_m, G = min(1, 2 cosθ cosθ_i/cosβ,
    2 cosθ cosθ_r/cosβ), and cosβ = g cosθ.
    """
    cosine = 1.0 / math.hypot(1.0, tan_theta)
    sine = tan_theta * cosine
    edge = 1.0 / (tan_theta * sigma)
    x, weight_x = panels(-min(edge, REACH), min(4.0 * edge, REACH), 10)
    if 4.0 * edge < REACH:
        more = panels(4.0 * edge, REACH, 6)
        x, weight_x = np.concatenate([x, more[0]]), np.concatenate([weight_x, more[1]])
    y, weight_y = panels(0.0, REACH, 3)
    density = np.exp(-0.5 * (x[:, None] ** 2 + y**2)) / math.pi * weight_x[:, None] * weight_y
    g = cosine + sine * sigma * x[:, None]
    cos_r = 2.0 * g / (1.0 + (sigma * x[:, None]) ** 2 + (sigma * y) ** 2) - cosine
    share = np.minimum(np.minimum(g / cosine, 2.0), 2.0 * cos_r / cosine)
    return float((density * np.where((g > 0.0) & (cos_r > 0.0), share, 0.0)).sum())


def grid(angles: int, sigmas: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mapped angles z, σ and the reflectance on Chebyshev nodes, z = σ tanθ/(σ tanθ + ½)."""
    z = 0.5 * (1.0 - np.cos((np.arange(angles) + 0.5) * np.pi / angles))
    s = 0.5 * (1.0 - np.cos((np.arange(sigmas) + 0.5) * np.pi / sigmas))
    values = [[reflectance(LARGEST * b, a / (1.0 - a) / (SCALE * LARGEST * b)) for b in s] for a in z]
    return np.repeat(z, sigmas), np.tile(s, angles), np.array(values).ravel()


def basis(z: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Products of Chebyshev polynomials, shape (points, 15·13)."""
    first, second = (
        chebyshev.chebvander(2.0 * u - 1.0, degree) for u, degree in zip((z, s), DEGREES, strict=True)
    )
    return (first[:, :, None] * second[:, None, :]).reshape(len(z), -1)


def main() -> None:
    z, s, values = grid(44, 24)
    coefficients = np.round(np.linalg.lstsq(basis(z, s), values, rcond=None)[0], 6)
    for row in coefficients.reshape(DEGREES[0] + 1, -1):
        print("    (" + ", ".join(f"{c + 0.0:g}" for c in row) + "),")
    z, s, values = grid(61, 17)
    print(f"largest error {np.abs(basis(z, s) @ coefficients - values).max():.1e}")


if __name__ == "__main__":
    main()
