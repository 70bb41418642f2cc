"""Statistics of the facets: densities of their slopes or tilts.

All give P, the density of the facets' *projected* area per solid angle at the tilt θ: ∫P dω = 1 over the hemisphere.
A distribution of normals (area of facets per solid angle) is P/cosθ; a density p of the two slopes gives P = p/cos³θ,
because the area d²t of slopes is dω/cos³θ.

Sources: Gaussian slopes: paper eq. (3); P/cosθ is the Beckmann distribution with α = √2 σ. GGX: Trowbridge and Reitz,
J. Opt. Soc. Am. 65, 531 (1975), in the form of Walter, Marschner, Li and Torrance, EGSR 2007, eq. 33. Generalised
Gaussian: Ichikawa, Fukao, Nobuhara and Nishino, "Fresnel Microfacet BRDF" (CVPR 2023) take P ∝ cosθ exp(−(θ/α)^β) over
the tilt and normalise it numerically (so their published code, kyotovision-public/fmbrdf); here it is the *slope* tanθ
that has the density ∝ exp(−(tanθ/α)^β), which has a closed norm, is Gaussian for β = 2 and agrees with theirs for small
tilts. Uniform: Diner et al., Atmosphere 3, 591 (2012).
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

__all__ = [
    "generalised_gaussian_density",
    "ggx_density",
    "projected_area_density",
    "uniform_density",
]


def projected_area_density(cos_theta: Any, tan2_theta: Any, sigma: Any) -> Any:
    """P(θ) = exp(−tan²θ/2σ²)/(2πσ² cos³θ) in 1/sr of Gaussian slopes, paper eq. (3).

    Parameters
    ----------
    cos_theta, tan2_theta
        cosθ and tan²θ of the facet's tilt θ; tan²θ is passed apart because near the mirror direction it is
        known more exactly than 1/cos²θ − 1.
    sigma
        Standard deviation of one slope component.
    """
    variance = sigma * sigma
    return dr.exp(-0.5 * tan2_theta / variance) / (
        2.0 * math.pi * variance * cos_theta * cos_theta * cos_theta
    )


def ggx_density(cos_theta: Any, tan2_theta: Any, alpha: Any) -> Any:
    """P(θ) = α²/(π cos³θ (α² + tan²θ)²) in 1/sr; half of the facets are steeper than α.

    Parameters
    ----------
    cos_theta, tan2_theta
        As in :func:`projected_area_density`.
    alpha
        Width α of Walter et al. The variance of the slopes is infinite.
    """
    width2 = alpha * alpha
    spread = width2 + tan2_theta
    return width2 / (math.pi * cos_theta * cos_theta * cos_theta * spread * spread)


def generalised_gaussian_density(cos_theta: Any, tan2_theta: Any, alpha: Any, exponent: Any) -> Any:
    """P(θ) = β exp(−(tanθ/α)^β)/(2π α² Γ(2/β) cos³θ) in 1/sr.

    Parameters
    ----------
    cos_theta, tan2_theta
        As in :func:`projected_area_density`.
    alpha, exponent
        Slope α at which the density has fallen to 1/e, and β: 2 for Gaussian slopes of σ = α/√2, 1 for exponential
        ones, less for longer tails.
    """
    width2 = alpha * alpha
    # (tanθ/α)^β by the logarithm, with the limit 0 at θ = 0
    ratio2 = dr.maximum(tan2_theta / width2, 1e-30)
    fall = dr.exp(0.5 * exponent * dr.log(ratio2))
    norm = exponent * dr.exp(-dr.lgamma(2.0 / exponent)) / (2.0 * math.pi * width2)
    return norm * dr.exp(-fall) / (cos_theta * cos_theta * cos_theta)


def uniform_density(cos_theta: Any) -> Any:
    """P = 1/2π in 1/sr: every direction of the hemisphere has the same projected area."""
    return 0.0 * cos_theta + 0.5 / math.pi
