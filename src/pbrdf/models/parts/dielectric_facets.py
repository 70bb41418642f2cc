"""Lobes of dielectric facets, each the Fresnel reflection of a facet turned to the surface's frames times a number.

They differ in that number; each class names its source, with the tags of the project's literature brief. Sources that
state a reflectance factor (BRF) are divided by π. Facets have a real index: at 1.5 unless set free in the models of
land surfaces, which hold it there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal

import drjit as dr

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import SLOPE
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.parts.bodies import COATING_INDEX
from pbrdf.models.parts.facets import Density
from pbrdf.models.parts.part import Part
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.facets import ggx_density, projected_area_density
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.shadowing import SHADOWING, smith_lambda

__all__ = [
    "CoatingFacets",
    "DinerFacets",
    "LitvinovLobe",
    "MaignanLobe",
    "PlasticLobe",
]

#: Slope width within which facets of any tilt are found.
_BROAD = 0.35

_LAND_INDEX = replace(
    COATING_INDEX, description="real refractive index of the facets", fitted=False, part="specular"
)


def _strength(symbol: str, description: str, default: float) -> Parameter:
    return Parameter(
        "strength", symbol, "1", f"{description}, on the data's own scale",
        1e-4, 100.0, (0.0, math.inf), default, logarithmic=True, part="specular", amplitude=True,
    )  # fmt: skip


class _Facets(Part):
    """f = P G M(−α2) M_r M(α1)/(4 cosθ cosθ_i cosθ_r) with a density P of the projected area and a factor G."""

    kind: ClassVar[Literal["specular", "diffuse"]] = "specular"

    def density(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        """P, 1/sr."""
        return projected_area_density(geometry.facet[2], tan2_tilt(geometry), values["sigma"])

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        """G, a weight included."""
        raise NotImplementedError

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        density, factor = (f(geometry, values, chosen) for f in (self.density, self.factor))
        return facet_reflection(geometry, density, factor, values["n"])

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        return values.get("sigma")

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return mueller_reflection(cos_theta, values["n"]).mean


class CoatingFacets(_Facets):
    """Gaussian facets of a dielectric coating, unweighted: paper eqs (2)-(8) with κ = 0.

    Reciprocal. Reflects less than all light with v-cavity or Smith shadowing; without, more and more towards grazing
    incidence.
    """

    parameters = (SLOPE, COATING_INDEX)
    options: Mapping[str, Option] = {
        "shadowing": Option(*SHADOWING, description="shadowing and masking of the facets")
    }

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        return SHADOWING[chosen["shadowing"]](geometry, values["sigma"])


class DinerFacets(_Facets):
    """Facets of Diner et al. 2012 with weight ζ, neither shadowed nor masked: Gaussian, eq. (13), or uniform, eq. (14).

    Source: Diner et al., Atmosphere 3, 591 (2012), as in AT3D (DINER_REFLECTION), which multiplies all by π [V]:
    πf = ζ exp(−tan²θ/2σ²)/(8σ² μ_i μ_r cos⁴θ) M(−α2) P_F M(α1) or πf = ζ/(8 μ_i μ_r cosθ) M(−α2) P_F M(α1), that is
    paper eq. (2) with G = ζ and P = eq. (3) or 1/(2π) [D].

    Reciprocal. Without shadowing it reflects ever more towards grazing incidence (uniform, n = 1.5, ζ = 1: 2.1 at 88°);
    nothing binds ζ.

    Parameters
    ----------
    facets
        Their density.
    """

    def __init__(self, facets: Density) -> None:
        self._density = facets
        self.parameters = (*facets.parameters, _LAND_INDEX, _strength("ζ", "weight of the facets", 1.0))

    def density(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        return self._density.projected_area(geometry, values)

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        return values["strength"]

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        # uniform facets have no lobe to resolve: broad enough to find those of every tilt
        return values.get("sigma", _BROAD)

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return values["strength"] * super().albedo(cos_theta, values)


class MaignanLobe(_Facets):
    """Polarised reflectance of Maignan et al. 2009: BRF = C exp(−tanγ) R_F(γ)/(4 (μ_i + μ_r)), γ the local incidence.

    Source: Maignan, Bréon, Fédèle, Bouvier, Remote Sens. Environ. 113, 2642 (2009), as in GRASP (Maign_Breon_XH) and
    VLIDORT (BPDFNDVI) [V]. The factor exp(−NDVI) is part of C, as in GRASP.

    Reciprocal. C is not bound by energy; C = 8, the largest value in use, reflects less than 7 % up to 88° of
    incidence.
    """

    parameters = (
        _strength("C", "weight of the polarised reflectance, exp(−NDVI) included", 2.0),
        _LAND_INDEX,
    )

    def density(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        sin_beta, cos_beta = _local_incidence(geometry)
        return values["strength"] * (1.0 / math.pi) * dr.exp(-sin_beta / cos_beta) * geometry.facet[2]

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        return _harmonic(geometry)

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return values["strength"] * super().albedo(cos_theta, values)


class LitvinovLobe(_Facets):
    """Facets of Litvinov et al. 2011: BRF = α f_sh exp(−tan²θ/2σ²)/(8σ² cos⁴θ (μ_i + μ_r)) R_F.

    f_sh = [½(1 + cos(k_γ(π − Θ)))]³ with the scattering angle Θ. Source: Litvinov, Hasekamp, Cairns, Remote Sens.
    Environ. 115, 781 (2011), as in VLIDORT and GRASP [V]; GRASP leaves the dependence of f_sh on Θ out, here it stands.

    Reciprocal. α is not bound by energy; α = 1 reflects less than 5 %, because μ_i μ_r/(μ_i + μ_r) stands where facets
    have their shadowing.
    """

    parameters = (
        _strength("α", "weight of the facets", 1.0),
        SLOPE,
        Parameter(
            "k_gamma", "k_γ", "1", "width of the shadowing in the scattering angle, 0 for none",
            0.0, 1.0, (0.0, 2.0), 0.75, part="specular",
        ),
        _LAND_INDEX,
    )  # fmt: skip

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        sin_beta, cos_beta = _local_incidence(geometry)
        shadow = 0.5 * (1.0 + dr.cos(values["k_gamma"] * 2.0 * dr.atan2(sin_beta, cos_beta)))
        return values["strength"] * shadow * shadow * shadow * _harmonic(geometry)

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return values["strength"] * super().albedo(cos_theta, values)


class PlasticLobe(_Facets):
    """Facets of Baek et al. 2018 as in Mitsuba 3 ``pplastic`` [V]: weight k_s, separable Smith shadowing G(ω_i) G(ω_r).

    Distributions: Beckmann's, α = √2 σ, with G₁ = 1/(1 + Λ) (Mitsuba takes Walter's rational approximation of it, up to
    0.35 % off), and GGX with G₁ = 2/(1 + √(1 + α² tan²θ)); Walter et al., EGSR 2007.

    Reciprocal. Conserves energy for k_s ≤ 1.
    """

    parameters = (
        _strength("k_s", "weight of the facets", 1.0),
        Parameter(
            "roughness", "α", "1", "width of the distribution of the facets; √2 σ for beckmann",
            0.003, 0.8, (0.001, 2.0), 0.1, logarithmic=True, part="specular",
        ),
        COATING_INDEX,
    )  # fmt: skip
    options: Mapping[str, Option] = {
        "distribution": Option("beckmann", "ggx", description="distribution of the facets' normals")
    }

    def density(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        cosine, tan2, alpha = geometry.facet[2], tan2_tilt(geometry), values["roughness"]
        if chosen["distribution"] == "beckmann":
            return projected_area_density(cosine, tan2, math.sqrt(0.5) * alpha)
        return ggx_density(cosine, tan2, alpha)

    def factor(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Any:
        alpha = values["roughness"]
        shadowing = values["strength"]
        for cosine, sine in ((geometry.cos_i, geometry.sin_i), (geometry.cos_r, geometry.sin_r)):
            if chosen["distribution"] == "beckmann":
                shadowing = shadowing / (1.0 + smith_lambda(cosine, sine, math.sqrt(0.5) * alpha))
            else:
                stretched = alpha * sine / cosine
                shadowing = shadowing * 2.0 / (1.0 + dr.sqrt(dr.fma(stretched, stretched, 1.0)))
        return shadowing

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        # slope width at half maximum: 0.71 α for Beckmann's distribution, 0.55 α for GGX
        return 0.6 * values["roughness"]

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return values["strength"] * super().albedo(cos_theta, values)


def _local_incidence(geometry: Geometry) -> tuple[Any, Any]:
    """sinγ, exact near backscatter, and cosγ, of the local incidence γ."""
    x, y, z = (a - b for a, b in zip(geometry.omega_i, geometry.omega_r, strict=True))
    length2 = dr.fma(x, x, dr.fma(y, y, z * z))
    return 0.5 * dr.sqrt(dr.maximum(length2, 1e-30)), geometry.cos_beta


def _harmonic(geometry: Geometry) -> Any:
    """μ_i μ_r/(μ_i + μ_r): turns the 1/(μ_i μ_r) of facets into 1/(μ_i + μ_r)."""
    return geometry.cos_i * geometry.cos_r / (geometry.cos_i + geometry.cos_r)
