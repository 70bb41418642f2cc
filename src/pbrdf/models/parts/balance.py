"""A Lambertian body that makes up for what shadowed facets lose, after Hyde, Schmidt and Havrilla (2009)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import drjit as dr

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import EXTINCTION, INDEX, SLOPE
from pbrdf.models.parts.part import Part, depolarising
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.mirror_reflectance import mirror_reflectance

__all__ = ["EnergyBalance"]


class EnergyBalance(Part):
    """f = R(θ_i) [1 − ρ(θ_i)]/π, unpolarised: what Gaussian facets under a V-cavity do not reflect at once.

    ρ is the reflectance of the same facets if they were perfect mirrors
    (:func:`~pbrdf.optics.mirror_reflectance.mirror_reflectance`), R that of the flat surface by Fresnel. A perfect
    conductor then reflects all light at every θ_i. It depends on θ_i alone: not reciprocal.
    """

    kind = "diffuse"
    parameters = (SLOPE, INDEX, EXTINCTION)

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        return depolarising(self._reflectance(geometry.cos_i, geometry.sin_i, values) * (1.0 / math.pi))

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        sin_theta = dr.sqrt(dr.maximum(1.0 - cos_theta * cos_theta, 0.0))
        return self._reflectance(cos_theta, sin_theta, values)

    def _reflectance(self, cos_theta: Any, sin_theta: Any, values: Mapping[str, Any]) -> Any:
        missing = dr.maximum(1.0 - mirror_reflectance(cos_theta, sin_theta, values["sigma"]), 0.0)
        return missing * mueller_reflection(cos_theta, values["n"], values["kappa"]).mean
