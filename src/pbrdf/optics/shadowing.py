"""Shadowing and masking of facets: the paper's V-cavity form, eq. (4), and its alternatives.

Sources: ``v_cavity``: Torrance and Sparrow (1967), Cook and Torrance, ACM TOG 1, 7 (1982), paper eq. (4).
``smith``: Smith (1967) in the height-correlated form G = 1/(1 + Λ_i + Λ_r) for Gaussian slopes, as used by
Mishchenko and Travis (1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import drjit as dr

from pbrdf.optics.geometry import Geometry

__all__ = ["SHADOWING", "smith", "smith_lambda", "unshadowed", "v_cavity"]


def v_cavity(geometry: Geometry, sigma: Any) -> Any:
    """G = min(1, 2 cosθ cosθ_i/cosβ, 2 cosθ cosθ_r/cosβ), paper eq. (4); it does not depend on σ."""
    scale = 2.0 * geometry.facet[2] / geometry.cos_beta
    return dr.minimum(1.0, scale * dr.minimum(geometry.cos_i, geometry.cos_r))


def smith_lambda(cos_theta: Any, sin_theta: Any, sigma: Any) -> Any:
    """Smith's Λ for Gaussian slopes: ½[√(2/π) (σ/ν) exp(−ν²/2σ²) − erfc(ν/√2σ)], ν = cotθ."""
    # below 1e-6 rad from the normal Λ is 0 to the last digit for every σ in use
    x = cos_theta / (math.sqrt(2.0) * sigma * dr.maximum(sin_theta, 1e-6))
    gauss = dr.exp(-x * x) / (math.sqrt(math.pi) * dr.maximum(x, 1e-12))
    return dr.maximum(0.5 * (gauss - (1.0 - dr.erf(x))), 0.0)


def smith(geometry: Geometry, sigma: Any) -> Any:
    """Height-correlated Smith shadowing and masking, G = 1/(1 + Λ(θ_i) + Λ(θ_r))."""
    lambda_i = smith_lambda(geometry.cos_i, geometry.sin_i, sigma)
    lambda_r = smith_lambda(geometry.cos_r, geometry.sin_r, sigma)
    return dr.rcp(1.0 + lambda_i + lambda_r)


def unshadowed(geometry: Geometry, sigma: Any) -> Any:
    """G = 1: neither shadowing nor masking (Priest and Germer 2000)."""
    return 1.0


SHADOWING: dict[str, Callable[[Geometry, Any], Any]] = {
    "v-cavity": v_cavity,
    "smith": smith,
    "none": unshadowed,
}
