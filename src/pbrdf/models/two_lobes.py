"""The double-Gauss with a second lobe of facets: metallic flakes below the coat, or a second roughness of it.

Source of the first lobe and of the body: :mod:`pbrdf.models.double_gauss`. The second lobe is the same formula, paper
eq. (2), with parameters of its own. Nothing is refracted: the tilt of flakes below a coat is the one that they seem
to have from outside, and what the coat takes from their light is in the strength.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import DoubleGauss
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.parts.facets import Facets, GaussianSlopes
from pbrdf.models.parts.part import Renamed, added
from pbrdf.optics.geometry import Geometry

__all__ = ["DoubleGaussTwoLobes"]

_NAMES = {
    "sigma": ("flake_sigma", "σ₂"),
    "n": ("flake_n", "n₂"),
    "kappa": ("flake_kappa", "κ₂"),
    "strength": ("flake_strength", "ζ₂"),
}
_SECOND = Renamed(Facets(GaussianSlopes(), ("v-cavity",), strength=True), _NAMES)
#: What is said otherwise of the second lobe: it is broad, its strength is fitted, its index is aluminium's at 550 nm.
_SAID: dict[str, dict[str, Any]] = {
    "flake_sigma": {
        "description": "standard deviation of one slope component of the second lobe's facets",
        "lower": 0.02,
        "default": 0.2,
    },
    "flake_n": {
        "description": "real refractive index of the flakes",
        "lower": 0.1,
        "upper": 4.0,
        "default": 0.96,
        "fitted": False,
    },
    "flake_kappa": {"description": "extinction of the flakes", "upper": 12.0, "default": 6.7},
    "flake_strength": {
        "description": "factor on the second lobe's reflection: share of the surface that flakes cover",
        "lower": 1e-4,
        "upper": 20.0,
        "domain": (0.0, math.inf),
        "default": 0.1,
        "fitted": True,
    },
}


class DoubleGaussTwoLobes(DoubleGauss):
    """Double-Gauss pBRDF plus a second lobe of facets, of flakes below the coat or of the coat itself.

    The first lobe's σ and n shape the body, as in the double-Gauss. Not reciprocal for t > 0 (the body is not).
    Energy: each lobe conserves it for ζ₂ ≤ 1; their sum and the body's amplitude a are not bound.
    """

    name: ClassVar[str] = "double-gauss-two-lobes"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *DoubleGauss.parameters,
        *(replace(p, **_SAID[p.name]) for p in _SECOND.parameters),
    )
    options: ClassVar[Mapping[str, Option]] = {
        **DoubleGauss.options,
        "second": Option(
            "flakes",
            "coat",
            description="what the second lobe's facets are of: flakes with an index of their own, or the coat",
        ),
    }
    # the slopes of both lobes together are not normal
    gaussian_slopes: ClassVar[bool] = False

    def _check_together(self) -> None:
        super()._check_together()
        _SECOND.check(self.values)

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix over generic Dr.Jit floats."""
        f = super().kernel(geometry, values, part)
        return f if part == "diffuse" else added(f, _SECOND.matrix(geometry, self._second(values), {}))

    def albedos(self, cos_theta: Any, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Those of the double-Gauss and of the second lobe's flat surface."""
        facets, body = super().albedos(cos_theta, values)
        return facets + _SECOND.albedo(cos_theta, self._second(values)), body

    def _second(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        if self.chosen["second"] == "flakes":
            return values
        return {**values, "flake_n": values["n"], "flake_kappa": values["kappa"]}
