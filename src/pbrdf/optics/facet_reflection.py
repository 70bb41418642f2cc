"""Reflection by facets that mirror the source into the viewer, paper eq. (2), whatever the density of the facets."""

from __future__ import annotations

from typing import Any

from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.reference_planes import facet_rotations

__all__ = ["facet_reflection", "tan2_tilt"]


def tan2_tilt(geometry: Geometry) -> Any:
    """tan²θ of the mirror facet's tilt θ; near the mirror direction more exact than 1/cos²θ − 1."""
    m = geometry.facet
    return (m[0] * m[0] + m[1] * m[1]) / (m[2] * m[2])


def facet_reflection(
    geometry: Geometry, density: Any, shadowing: Any, n: Any, kappa: Any | None = None
) -> list[list[Any]]:
    """f_mf = P G M(−α2) M_r M(α1)/(4 cosθ cosθ_i cosθ_r) in 1/sr, paper eq. (2).

    Parameters
    ----------
    geometry
        Both rays above the horizon.
    density
        P, density of the facets' projected area per solid angle at the mirror facet, 1/sr: ∫P dω = 1. A distribution of
        normals D (area of facets per solid angle) is P/cosθ.
    shadowing
        G, share of the mirror facets that is lit and seen.
    n, kappa
        Refractive index n − iκ of the facets; None for a dielectric.

    Returns
    -------
    list of list
        4 x 4 Mueller matrix in the surface's frames; elements that are zero by structure are the Python number 0.
    """
    scale = density * shadowing / (4.0 * geometry.facet[2] * geometry.cos_i * geometry.cos_r)
    r = mueller_reflection(geometry.cos_beta, n, kappa)
    A, B, C = r.mean * scale, r.difference * scale, r.real * scale
    c1, s1, c2, s2 = facet_rotations(geometry)
    f = [
        [A, B * c1, B * s1, 0.0],
        [B * c2, A * c1 * c2 + C * s1 * s2, A * s1 * c2 - C * c1 * s2, 0.0],
        [B * s2, A * c1 * s2 - C * s1 * c2, A * s1 * s2 + C * c1 * c2, 0.0],
        [0.0, 0.0, 0.0, C],
    ]
    if r.imaginary is not None:
        D = r.imaginary * scale
        f[1][3], f[2][3] = D * s2, -D * c2
        f[3][1], f[3][2] = -D * s1, D * c1
    return f
