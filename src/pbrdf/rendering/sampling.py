"""Importance sampling of a reflection model: the visible facets, or the cosine.

Of the facets those that the ray sees are drawn, after Heitz and d'Eon, "Importance Sampling Microfacet-Based BSDFs
using the Distribution of Visible Normals", Computer Graphics Forum 33, 103 (2014), in the form for V-cavities, the
geometry of the model's own shadowing: draw a facet, and take it or its opposite in proportion to what the ray sees
of them. The two slopes of a facet are normal variables, so nothing has to be inverted numerically. The diffuse part is
sampled by the cosine. The share of the two follows estimates of their albedos.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import drjit as dr

from pbrdf.optics.diffuse import mrpv
from pbrdf.optics.facets import projected_area_density
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry

__all__ = ["facet_share", "pdf", "sample_direction"]

#: Least share of either part, so that a wrong estimate costs noise only.
_LEAST = 0.1
#: cosθ of the direction of view at which the diffuse albedo is estimated: the mean of cosθ over cosθ dω.
_MEAN_COSINE = 2.0 / 3.0


def facet_share(cos_theta: Any, values: Mapping[str, Any]) -> Any:
    """Share of the samples that goes to the facets, strictly between 0 and 1.

    R/(R + A): Fresnel reflectance of the flat surface and the diffuse albedo of a mean direction.

    Parameters
    ----------
    cos_theta
        Cosine of the zenith angle of the known ray, > 0.
    values
        Parameters by name, floats of Mitsuba's.
    """
    R = mueller_reflection(cos_theta, values["n"], values["kappa"]).mean
    A = math.pi * mrpv(
        cos_theta, _MEAN_COSINE, -_MEAN_COSINE * cos_theta, values["a"], values["k"], values["b"]
    )
    return _LEAST + (1.0 - 2.0 * _LEAST) * R / (R + A)


def pdf(geometry: Geometry, cos_known: Any, cos_drawn: Any, share: Any, sigma: Any) -> Any:
    """Density of :func:`sample_direction`, 1/sr.

    Parameters
    ----------
    geometry
        The two rays, above the horizon.
    cos_known, cos_drawn
        Cosine of the zenith angle of the ray that was known, and of that which was drawn.
    share
        Share of the facets; the number 0 or 1 if one part is sampled alone.
    sigma
        Slope standard deviation.
    """
    density: Any = 0.0
    if not _is_number(share, 0.0):
        m = geometry.facet
        tan2 = (m[0] * m[0] + m[1] * m[1]) / (m[2] * m[2])
        P = projected_area_density(m[2], tan2, sigma)
        # visible facets: P min(cosβ/(cosθ cosθ_known), 2); mirrored direction: 1/(4 cosβ)
        density = share * P * dr.minimum(0.25 / (m[2] * cos_known), 0.5 / geometry.cos_beta)
    if not _is_number(share, 1.0):
        density = density + (1.0 - share) * cos_drawn * (1.0 / math.pi)
    return density


def sample_direction(known: Any, share: Any, sigma: Any, sample1: Any, sample2: Any) -> tuple[Any, Any]:
    """Draw a direction for light that arrives along the other.

    Parameters
    ----------
    known
        Unit vector of the known ray in the shading frame, above the horizon.
    share, sigma
        As for :func:`pdf`.
    sample1, sample2
        Random numbers: one that chooses the part and the facet, two for the direction.

    Returns
    -------
    direction, facets
        Unit vector, possibly below the horizon (density 0 there), and whether it was drawn from the facets.
    """
    import mitsuba as mi

    facets = sample1 < share
    radius = sigma * dr.sqrt(-2.0 * dr.log(1.0 - sample2[0]))
    sine, cosine = dr.sincos(2.0 * math.pi * sample2[1])
    x, y = radius * cosine, radius * sine
    # cosines to the facet and to its opposite, times the same length; the sum is positive
    across = dr.fma(x, known[0], y * known[1])
    seen, opposite = dr.maximum(known[2] + across, 0.0), dr.maximum(known[2] - across, 0.0)
    turned = sample1 * (seen + opposite) >= share * seen
    m = dr.normalize(mi.Normal3f(dr.select(turned, -x, x), dr.select(turned, -y, y), 1.0))
    mirrored = mi.reflect(known, m)
    return dr.select(facets, mirrored, mi.warp.square_to_cosine_hemisphere(sample2)), facets


def _is_number(share: Any, number: float) -> bool:
    return isinstance(share, float) and share == number
