"""Facets over a depolarising body: the common models of reflection, polarised by Fresnel's equations at the facets.

Sources: Cook and Torrance, ACM Trans. Graph. 1, 7 (1982); Priest and Germer, "Polarimetric BRDF in the microfacet
model" (2000), whose radiometric factor and Jones matrices equal the facets of NIST SCATMECH; Walter, Marschner, Li and
Torrance, EGSR 2007. What each was checked against: docs/models.md.
"""

from __future__ import annotations

from typing import ClassVar

from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.facets import GGX, Facets, GaussianSlopes, GeneralisedGaussian
from pbrdf.models.parts.simple_bodies import MRPV, Lambert

__all__ = ["CookTorranceLambert", "GGXLambert", "GeneralisedGaussianMRPV", "PriestGermer"]


class CookTorranceLambert(ComposedModel):
    """Cook and Torrance's facets (Beckmann, V-cavity), polarised, over a Lambertian body.

    Normalised as in Walter et al. (∫P dω = 1); the original of 1982 has π for 4 in the denominator. Beckmann's width is
    √2 σ. Reciprocal. Energy: the facets alone conserve it; with the body, where ρ ≤ 1 − the facets' reflectance.
    """

    name: ClassVar[str] = "cook-torrance-lambert"
    parts = (Facets(GaussianSlopes(), strength=True), Lambert())
    gaussian_slopes: ClassVar[bool] = True


class PriestGermer(ComposedModel):
    """Gaussian facets without shadowing and without a body, after Priest and Germer (2000).

    Reciprocal. It does not conserve energy towards grazing (no shadowing): a perfect mirror of σ = 0.3 gives off 1.9
    times what it gets at 85°.
    """

    name: ClassVar[str] = "priest-germer"
    parts = (Facets(GaussianSlopes(), ("none",)),)
    gaussian_slopes: ClassVar[bool] = True


class GGXLambert(ComposedModel):
    """Facets of the distribution GGX (long tails) over a Lambertian body.

    Reciprocal. Energy: the facets alone conserve it (V-cavity); with the body, where ρ ≤ 1 − the facets' reflectance.
    """

    name: ClassVar[str] = "ggx-lambert"
    parts = (Facets(GGX(), strength=True), Lambert())


class GeneralisedGaussianMRPV(ComposedModel):
    """Facets of a generalised Gaussian density of slopes over a body of the modified Rahman-Pinty-Verstraete shape.

    The density is that of FMBRDF (Ichikawa et al., CVPR 2023) in the slope instead of the angle; of that model's other
    parts (networks for body and shadowing) nothing is taken over. Reciprocal. Energy: the facets alone conserve it
    (V-cavity); the body's amplitude a is not bound.
    """

    name: ClassVar[str] = "generalised-gaussian"
    parts = (Facets(GeneralisedGaussian(), strength=True), MRPV())
