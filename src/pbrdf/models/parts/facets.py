"""Facets that mirror the source into the viewer: their densities, and the lobe that they make.

Formulas and sources of the densities: :mod:`pbrdf.optics.facets`; of the lobe, paper eq. (2):
:mod:`pbrdf.optics.facet_reflection`; of shadowing: :mod:`pbrdf.optics.shadowing`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import EXTINCTION, INDEX, SLOPE, check_index
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.parts.part import Part
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.facets import (
    generalised_gaussian_density,
    ggx_density,
    projected_area_density,
    uniform_density,
)
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.shadowing import SHADOWING

__all__ = [
    "GGX",
    "STRENGTH",
    "Density",
    "Exponential",
    "Facets",
    "GaussianSlopes",
    "GeneralisedGaussian",
    "Uniform",
]

#: Slope at which a Gaussian of σ = 1 has fallen to half.
_HALF = math.sqrt(2.0 * math.log(2.0))

STRENGTH = Parameter(
    "strength", "ζ", "1", "factor on the facets' reflection, 1 for Fresnel's reflectance of n",
    0.02, 50.0, (0.0, math.inf), 1.0, fitted=False, logarithmic=True, part="specular",
)  # fmt: skip


class Density:
    """Base of the densities of the facets.

    Attributes
    ----------
    parameters
        What the density depends on.
    gaussian
        Whether the slopes are normal with the parameter ``sigma``, as Smith's shadowing supposes.
    """

    parameters: tuple[Parameter, ...] = ()
    gaussian: bool = False

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        """P at the mirror facet in 1/sr, ∫P dω = 1 over the facets of the hemisphere."""
        raise NotImplementedError

    def width(self, values: Mapping[str, Any]) -> Any:
        """Slope standard deviation of the Gaussian of the same half width, a number or a generic float; or None."""
        return None


class GaussianSlopes(Density):
    """Normal slopes, paper eq. (3): Beckmann's distribution with α = √2 σ."""

    parameters = (SLOPE,)
    gaussian = True

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return projected_area_density(geometry.facet[2], tan2_tilt(geometry), values["sigma"])

    def width(self, values: Mapping[str, Any]) -> Any:
        return values["sigma"]


class GGX(Density):
    """Long tails: Trowbridge and Reitz (1975), Walter et al. (2007)."""

    parameters = (
        Parameter(
            "roughness", "α", "1", "width of the distribution GGX: slope that half of the facets exceed",
            0.005, 0.8, (0.001, 2.0), 0.1, logarithmic=True, part="specular",
        ),
    )  # fmt: skip

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return ggx_density(geometry.facet[2], tan2_tilt(geometry), values["roughness"])

    def width(self, values: Mapping[str, Any]) -> Any:
        return values["roughness"] * (math.sqrt(math.sqrt(2.0) - 1.0) / _HALF)


_ROUGHNESS = Parameter(
    "roughness", "α", "1", "slope at which the density of the facets has fallen to 1/e",
    0.003, 0.8, (0.001, 2.0), 0.06, logarithmic=True, part="specular",
)  # fmt: skip


class GeneralisedGaussian(Density):
    """Slopes of density ∝ exp(−(tanθ/α)^β), after the generalised Gaussian of Ichikawa et al. (CVPR 2023).

    Theirs is over the tilt θ instead of its tangent, see :mod:`pbrdf.optics.facets`.
    """

    parameters = (
        _ROUGHNESS,
        Parameter(
            "exponent", "β", "1", "exponent of the density of the slopes, 2 for a Gaussian, less for longer tails",
            0.3, 4.0, (0.2, 20.0), 2.0, part="specular",
        ),
    )  # fmt: skip

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return generalised_gaussian_density(
            geometry.facet[2], tan2_tilt(geometry), values["roughness"], values["exponent"]
        )

    def width(self, values: Mapping[str, Any]) -> Any:
        return values["roughness"] * math.log(2.0) ** (1.0 / values["exponent"]) / _HALF


class Exponential(Density):
    """Slopes of density ∝ exp(−tanθ/α): the generalised Gaussian with exponent 1."""

    parameters = (_ROUGHNESS,)

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return generalised_gaussian_density(geometry.facet[2], tan2_tilt(geometry), values["roughness"], 1.0)

    def width(self, values: Mapping[str, Any]) -> Any:
        return values["roughness"] * (math.log(2.0) / _HALF)


class Uniform(Density):
    """P = 1/2π over the hemisphere, Diner et al. (2012); it has no width."""

    def projected_area(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return uniform_density(geometry.facet[2])


class Facets(Part):
    """P G M(−α2) M_r M(α1)/(4 cosθ cosθ_i cosθ_r), paper eq. (2), for any density of the facets.

    Reciprocal with every shadowing. With the V-cavity, energy is conserved for every density and ζ ≤ 1: each cavity of
    two facets sends on what it gets or less. Without shadowing it is not, towards grazing.

    Parameters
    ----------
    density
        Of the facets' projected area.
    shadowing
        Names of :data:`~pbrdf.optics.shadowing.SHADOWING` to choose from, the first the default; all that the density
        allows if not given. A single one is no option.
    strength
        Whether the reflection has a factor, :data:`STRENGTH`, that a fit may set free.
    """

    kind = "specular"

    def __init__(
        self, density: Density, shadowing: Sequence[str] | None = None, *, strength: bool = False
    ) -> None:
        self._density = density
        if shadowing is None:
            shadowing = [name for name in SHADOWING if density.gaussian or name != "smith"]
        self._shadowing = tuple(shadowing)
        if len(self._shadowing) > 1:
            self.options = {
                "shadowing": Option(
                    *self._shadowing,
                    description=f"shadowing and masking of the facets, {' or '.join(self._shadowing)}",
                )
            }
        self.parameters = (*density.parameters, INDEX, EXTINCTION, *((STRENGTH,) if strength else ()))

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        shadowing = chosen["shadowing"] if self.options else self._shadowing[0]
        seen = SHADOWING[shadowing](geometry, values.get("sigma"))
        share = self.share(geometry, values)
        if share is not None:
            seen = share * seen
        density = self._density.projected_area(geometry, values)
        return facet_reflection(geometry, density, seen, values["n"], values["kappa"])

    def share(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        """Factor on the whole lobe, None for 1: ζ where it is a parameter."""
        return values["strength"] if STRENGTH in self.parameters else None

    def check(self, values: Mapping[str, Any]) -> None:
        check_index(values["n"], values["kappa"])

    def lobe_width(self, values: Mapping[str, Any]) -> Any:
        return self._density.width(values)

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        reflectance = mueller_reflection(cos_theta, values["n"], values["kappa"]).mean
        return reflectance * values["strength"] if STRENGTH in self.parameters else reflectance
