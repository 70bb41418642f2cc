"""The coherent reflection of a smooth surface, a mirror image of the source as an instrument sees it.

A mirror's BRDF is a delta function; a source and a detector of finite size make it a lobe. The share of the light
that is reflected coherently is Rayleigh's: exp(−g), g = [2π (h/λ) (cosθ_i + cosθ_r)]², for a Gaussian distribution of
heights of standard deviation h (Beckmann and Spizzichino, "The Scattering of Electromagnetic Waves from Rough
Surfaces", 1963).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import drjit as dr

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import EXTINCTION, INDEX, check_index
from pbrdf.models.parameters import Parameter
from pbrdf.models.parts.part import Part
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.facets import projected_area_density
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry

__all__ = ["HEIGHT", "WIDTH", "CoherentMirror", "coherent_share"]

HEIGHT = Parameter(
    "mirror_height", "h/λ", "1", "standard deviation of the surface's height, in wavelengths",
    0.0, 0.3, (0.0, 10.0), 0.05, part="specular",
)  # fmt: skip
WIDTH = Parameter(
    "mirror_width", "δ", "1",
    "width of the mirror image in the facet's tilt (one component, standard deviation): that of source and detector",
    0.002, 0.05, (0.0002, 0.2), 0.005, logarithmic=True, part="specular",
)  # fmt: skip


def coherent_share(cosine: Any, values: Mapping[str, Any]) -> Any:
    """exp(−g), g = [4π (h/λ) cosθ]²."""
    return dr.exp(-dr.square(4.0 * math.pi * values["mirror_height"] * cosine))


class CoherentMirror(Part):
    """Fresnel's mirror image, a normal lobe of the facet's tilt as wide as source and detector make it.

    A uniform round source of angular radius ρ seen by a narrow detector has δ = ρ/4: the standard deviation of one
    component over a disc is ρ/2, and a facet turns the ray by twice its tilt. At h = 0 it carries Fresnel's
    reflectance of the flat surface, smoothed over the lobe. Reciprocal; conserves energy but for the lobe's part
    beyond the horizon.
    """

    kind = "specular"
    parameters = (WIDTH, HEIGHT, INDEX, EXTINCTION)

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        density = projected_area_density(geometry.facet[2], tan2_tilt(geometry), values["mirror_width"])
        share = coherent_share(0.5 * (geometry.cos_i + geometry.cos_r), values)
        return facet_reflection(geometry, density, share, values["n"], values["kappa"])

    def check(self, values: Mapping[str, Any]) -> None:
        check_index(values["n"], values["kappa"])

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        return values["mirror_width"]

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        reflectance = mueller_reflection(cos_theta, values["n"], values["kappa"]).mean
        return reflectance * coherent_share(cos_theta, values)
