"""The double-Gauss with a second lobe of facets: metallic flakes below the coat, or a second roughness of it.

Source of the first lobe and of the body: :mod:`pbrdf.models.double_gauss`. The second lobe is the same formula, paper
eq. (2), with parameters of its own, see :mod:`pbrdf.models.parts.flakes`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import DoubleGauss
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.parts.facets import GaussianSlopes
from pbrdf.models.parts.flakes import Flakes
from pbrdf.models.parts.part import added
from pbrdf.optics.geometry import Geometry

__all__ = ["DoubleGaussTwoLobes"]

_SECOND = Flakes(GaussianSlopes())


class DoubleGaussTwoLobes(DoubleGauss):
    """Double-Gauss pBRDF plus a second lobe of facets, of flakes below the coat or of the coat itself.

    The first lobe's σ and n shape the body, as in the double-Gauss. Not reciprocal for t > 0 (the body is not).
    Energy: each lobe conserves it for ζ₂ ≤ 1; their sum and the body's amplitude a are not bound.
    """

    name: ClassVar[str] = "double-gauss-two-lobes"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *DoubleGauss.parameters,
        *_SECOND.parameters,
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
