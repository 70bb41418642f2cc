"""Importance sampling of a reflection model: the visible facets, or the cosine.

Of the facets those that the ray sees are drawn, after Heitz and d'Eon, "Importance Sampling Microfacet-Based BSDFs
using the Distribution of Visible Normals", Computer Graphics Forum 33, 103 (2014), in the form for V-cavities, the
geometry of the model's own shadowing: draw a facet, and take it or its opposite in proportion to what the ray sees
of them. The two slopes of a facet are drawn as normal variables, so nothing has to be inverted numerically. The diffuse
part is sampled by the cosine. The share of the two follows estimates of their albedos.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from pbrdf.optics.facet_reflection import tan2_tilt
from pbrdf.optics.facets import projected_area_density
from pbrdf.optics.geometry import Geometry

__all__ = ["LEAST_SHARE", "facet_share", "pdf", "sample_direction"]

#: Least share of either part, so that a wrong estimate costs noise only.
LEAST_SHARE = 0.1


def facet_share(facets: Any, body: Any) -> Any:
    """Share of the samples that goes to the facets, strictly between 0 and 1.

    Parameters
    ----------
    facets, body
        Rough albedos of both parts, see :meth:`pbrdf.models.base.Model.albedos`.
    """
    return LEAST_SHARE + (1.0 - 2.0 * LEAST_SHARE) * facets / (facets + body)


def pdf(geometry: Geometry, cos_known: Any, cos_drawn: Any, share: Any, width: Any) -> Any:
    """Density of :func:`sample_direction`, 1/sr.

    Parameters
    ----------
    geometry
        The two rays, above the horizon.
    cos_known, cos_drawn
        Cosine of the zenith angle of the ray that was known, and of that which was drawn.
    share
        Share of the facets; the number 0 or 1 if one part is sampled alone.
    width
        Standard deviation of the slopes that are drawn.
    """
    density: Any = 0.0
    if not _is_number(share, 0.0):
        m = geometry.facet
        P = projected_area_density(m[2], tan2_tilt(geometry), width)
        # visible facets: P min(cosβ/(cosθ cosθ_known), 2); mirrored direction: 1/(4 cosβ)
        density = share * P * dr.minimum(0.25 / (m[2] * cos_known), 0.5 / geometry.cos_beta)
    if not _is_number(share, 1.0):
        density = density + (1.0 - share) * cos_drawn * (1.0 / math.pi)
    return density


def sample_direction(known: Any, share: Any, width: Any, sample1: Any, sample2: Any) -> tuple[Any, Any]:
    """Draw a direction for light that arrives along the other.

    Parameters
    ----------
    known
        Unit vector of the known ray in the shading frame, above the horizon.
    share, width
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
    radius = width * dr.sqrt(-2.0 * dr.log(1.0 - sample2[0]))
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
