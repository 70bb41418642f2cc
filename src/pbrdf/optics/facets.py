"""Slope statistics of the facets, paper eq. (3).

The two slopes of a facet are independent normal variables of standard deviation σ. P is the density of
the facets' *projected* area per solid angle, ∫P dω = 1; P/cosθ is the Beckmann distribution with α = √2 σ.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

__all__ = ["projected_area_density"]


def projected_area_density(cos_theta: Any, tan2_theta: Any, sigma: Any) -> Any:
    """P(θ) = exp(−tan²θ/2σ²)/(2πσ² cos³θ) in 1/sr, paper eq. (3).

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
