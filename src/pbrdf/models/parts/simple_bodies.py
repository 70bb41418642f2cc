"""Bodies of one formula that depolarise completely: Lambert's, and the modified Rahman-Pinty-Verstraete function.

Sources: ``Lambert``: f = ρ/π (Lambert 1760). ``MRPV``: Martonchik et al. (1998), the shape of the double-Gauss's
diffuse part, see :mod:`pbrdf.optics.diffuse`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import AMPLITUDE, ASYMMETRY, MEAN_COSINE, MINNAERT
from pbrdf.models.parameters import Parameter
from pbrdf.models.parts.part import Part, depolarising
from pbrdf.optics.diffuse import mrpv
from pbrdf.optics.geometry import Geometry

__all__ = ["ALBEDO", "MRPV", "Lambert"]

ALBEDO = Parameter(
    "albedo", "ρ", "1", "albedo of the body, on the data's own scale",
    1e-4, 10.0, (0.0, math.inf), 0.5, logarithmic=True, part="diffuse", amplitude=True,
)  # fmt: skip


class Lambert(Part):
    """f = ρ/π: equally bright from everywhere, unpolarised. Reciprocal; conserves energy for ρ ≤ 1."""

    kind = "diffuse"
    parameters = (ALBEDO,)

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        return depolarising(values["albedo"] * (1.0 / math.pi))

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return values["albedo"] + 0.0 * cos_theta


class MRPV(Part):
    """f = (a/π) [(μ_r + μ_i) μ_r μ_i]^(k−1) exp(b cosω), unpolarised. Reciprocal; a is not bound by energy."""

    kind = "diffuse"
    parameters = (AMPLITUDE, MINNAERT, ASYMMETRY)

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        shape = values["a"], values["k"], values["b"]
        return depolarising(mrpv(geometry.cos_i, geometry.cos_r, geometry.cos_scattering, *shape))

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        shape = values["a"], values["k"], values["b"]
        return math.pi * mrpv(cos_theta, MEAN_COSINE, -MEAN_COSINE * cos_theta, *shape)
