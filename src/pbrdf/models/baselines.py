"""Models of others, composed of parts: coated bodies, and land surfaces.

Where a name claims a paper, its formulas could be read in a public implementation (docs/models-bodies.md says which);
what is added so that a whole measurement can be fitted is called *beyond the paper*. All are reciprocal.
"""

from __future__ import annotations

from typing import ClassVar

from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.bodies import CoatedLambert, HotSpotRPV, Subsurface
from pbrdf.models.parts.dielectric_facets import (
    CoatingFacets,
    DinerFacets,
    LitvinovLobe,
    MaignanLobe,
    PlasticLobe,
)
from pbrdf.models.parts.facets import Facets, GaussianSlopes, Uniform
from pbrdf.models.parts.simple_bodies import MRPV

__all__ = [
    "Baek2018",
    "Diner2012",
    "Diner2012Uniform",
    "GermerSubsurface",
    "Litvinov2011",
    "Maignan2009",
    "RPVHotSpot",
]


class Baek2018(ComposedModel):
    """Polarised plastic of Baek et al. 2018: a Lambertian body under a flat coating, and facets of weight k_s.

    Source: Baek et al., "Simultaneous acquisition of polarimetric SVBRDF and normals", ACM TOG 37, 268 (2018), as in
    Mitsuba 3 ``pplastic``. The body polarises by the macroscopic normal.

    For ρ_d ≤ 1 and k_s ≤ 1 it reflects less than all light: the facets take at most what the body's light loses on its
    ways in and out. No light is sent back inside, so that even ρ_d = 1 loses energy.
    """

    name: ClassVar[str] = "baek-2018"
    parts = (CoatedLambert(), PlasticLobe())


class GermerSubsurface(ComposedModel):
    """Germer's subsurface scattering below a flat coating, and the coating's facets with the same index.

    Sources: SCATMECH, ``Diffuse_Subsurface_BRDF_Model`` (body) and ``Shadowed_Facet_BRDF_Model`` (facets).

    Body light is exact for a flat surface: a white pigment (R = 1) below a smooth coating reflects all light, at every
    angle. With rough facets that are shadowed the sum stays below 1.005 for any σ in bounds, and falls below 0.9 beyond
    80° of incidence: what shadowing takes from the facets is lost.
    """

    name: ClassVar[str] = "germer-subsurface"
    parts = (CoatingFacets(), Subsurface())
    gaussian_slopes: ClassVar[bool] = True


class RPVHotSpot(ComposedModel):
    """Rahman-Pinty-Verstraete body with hot spot, depolarising, and Gaussian facets.

    The RPV function alone is scalar; the facets, which polarise, are beyond its paper. Nothing ties ρ_0 to energy.
    """

    name: ClassVar[str] = "rpv-hot-spot"
    parts = (Facets(GaussianSlopes()), HotSpotRPV())
    gaussian_slopes: ClassVar[bool] = True


class Diner2012(ComposedModel):
    """Diner et al. 2012: depolarising MRPV body without hot spot, plus ζ times unshadowed Gaussian facets, n = 1.5.

    Source: Diner et al., Atmosphere 3, 591 (2012), eqs (6), (13), (16)-(21), as in AT3D, whose hot-spot factor is not
    the paper's and is left out here. The index is held at 1.5, as in the paper, unless set free.

    Not bound by energy: neither is a, and facets without shadowing reflect ever more towards grazing incidence.
    """

    name: ClassVar[str] = "diner-2012"
    parts = (MRPV(), DinerFacets(GaussianSlopes()))
    gaussian_slopes: ClassVar[bool] = True


class Diner2012Uniform(ComposedModel):
    """Diner et al. 2012 with facets of every orientation alike, eq. (14) instead of (13); see ``diner-2012``."""

    name: ClassVar[str] = "diner-2012-uniform"
    parts = (MRPV(), DinerFacets(Uniform()))


class Maignan2009(ComposedModel):
    """Polarised reflectance of vegetation and soil, Maignan et al. 2009, over a depolarising MRPV body.

    Source: Maignan, Bréon, Fédèle, Bouvier, Remote Sens. Environ. 113, 2642 (2009), as in GRASP and VLIDORT. The
    paper's one parameter is C (exp(−NDVI) included); the body is beyond the paper, so that intensity can be fitted
    too. The index is held at 1.5 unless set free.
    """

    name: ClassVar[str] = "maignan-2009"
    parts = (MRPV(), MaignanLobe())


class Litvinov2011(ComposedModel):
    """Polarised reflectance of soil and vegetation, Litvinov et al. 2011, over a depolarising MRPV body.

    Source: Litvinov, Hasekamp, Cairns, Remote Sens. Environ. 115, 781 (2011), as in VLIDORT and GRASP. The body is
    beyond the polarised model of the paper, so that intensity can be fitted too. The index is held at 1.5 unless set
    free.
    """

    name: ClassVar[str] = "litvinov-2011"
    parts = (MRPV(), LitvinovLobe())
    gaussian_slopes: ClassVar[bool] = True
