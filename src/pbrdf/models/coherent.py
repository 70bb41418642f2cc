"""Smooth coats: a mirror image, facets or flakes, and a body.

Sources: Beckmann and Spizzichino (1963) for the coherent share, see :mod:`pbrdf.models.parts.mirror`; the facets are
the double-Gauss's, the body its depolarising share.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import drjit as dr

from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.facets import Facets, GaussianSlopes, GeneralisedGaussian
from pbrdf.models.parts.flakes import Flakes, InterferenceFlakes
from pbrdf.models.parts.haze import Haze
from pbrdf.models.parts.mirror import HEIGHT, CoherentMirror, coherent_share
from pbrdf.models.parts.simple_bodies import MRPV
from pbrdf.optics.geometry import Geometry

__all__ = ["IncoherentFacets", "InterferenceLacquer", "MetallicLacquer", "MirrorFacetsMRPV", "MirrorHazeMRPV"]


class IncoherentFacets(Facets):
    """Facets that reflect what the mirror image does not: 1 − exp(−g) of it, so that both together are one surface.

    g is taken at the ray farther from the normal, where it is smaller: reciprocal, and never more than the mirror
    leaves.
    """

    def __init__(self) -> None:
        super().__init__(GaussianSlopes(), ("v-cavity",))
        self.parameters = (*self.parameters, HEIGHT)

    def share(self, geometry: Geometry, values: Mapping[str, Any]) -> Any:
        return 1.0 - coherent_share(dr.minimum(geometry.cos_i, geometry.cos_r), values)

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return super().albedo(cos_theta, values) * (1.0 - coherent_share(cos_theta, values))


class MirrorFacetsMRPV(ComposedModel):
    """Mirror image of a finite source, Gaussian facets with the rest of its light, and an MRPV body.

    For glossy coats whose highlight is narrower than the facets' lobe. Own construction from the named parts.
    Reciprocal. Energy: mirror and facets together conserve it (some is lost where the facets are steep); the body's
    amplitude a is not bound.
    """

    name: ClassVar[str] = "mirror-facets"
    parts = (CoherentMirror(), IncoherentFacets(), MRPV())


class MirrorHazeMRPV(ComposedModel):
    """Mirror image of a finite source, a haze of generalised Gaussian facets of the same coat, and an MRPV body.

    For glossy coats with a halo. Own construction from the named parts: unlike ``mirror-facets``, how much light the
    haze takes is fitted, not derived. Reciprocal. Energy: each lobe conserves it for ζ₂ ≤ 1; their sum and the body's
    amplitude a are not bound.
    """

    name: ClassVar[str] = "mirror-haze"
    parts = (CoherentMirror(), Haze(GeneralisedGaussian()), MRPV())


class MetallicLacquer(ComposedModel):
    """Mirror image of a finite source in a clear coat, flakes of a generalised Gaussian density below, an MRPV body.

    For automotive lacquers. Own construction from the named parts; the flakes' index is held, their strength fitted.
    Reciprocal. Energy: each lobe conserves it for ζ₂ ≤ 1; their sum and the body's amplitude a are not bound.
    """

    name: ClassVar[str] = "metallic-lacquer"
    parts = (CoherentMirror(), Flakes(GeneralisedGaussian()), MRPV())


class InterferenceLacquer(ComposedModel):
    """Mirror image of a finite source in a clear coat and flakes with a thin film below, which hide any body.

    For lacquers whose colour changes with the angle, of opaque flakes over a dark ground. Own construction from the
    named parts; the indices of flakes and film are held. Reciprocal. Energy: each lobe conserves it for ζ₂ ≤ 1; their
    sum is not bound.
    """

    name: ClassVar[str] = "interference-lacquer"
    parts = (CoherentMirror(), InterferenceFlakes(GeneralisedGaussian()))
