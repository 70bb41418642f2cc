"""Shadowed Gaussian facets whose energy a Lambertian body balances, after Hyde, Schmidt and Havrilla.

Source: Hyde, Schmidt, Havrilla, "A geometrical optics polarimetric bidirectional reflectance distribution function for
dielectric and metallic surfaces", Opt. Express 17, 22138 (2009), of which only the abstract could be read.
"""

from __future__ import annotations

from typing import ClassVar

from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.balance import EnergyBalance
from pbrdf.models.parts.facets import Facets, GaussianSlopes

__all__ = ["HydeType"]


class HydeType(ComposedModel):
    """Gaussian facets under a V-cavity plus a Lambertian body that reflects what they lose; two parameters.

    A reconstruction from the abstract of Hyde, Schmidt and Havrilla (2009), not verified against the paper: the
    magnitude of the body follows from energy conservation for a perfect conductor. Not reciprocal (the body depends
    on θ_i alone). Conserves energy: a perfect conductor reflects 1 at every θ_i, to 1e-3.
    """

    name: ClassVar[str] = "hyde-type"
    parts = (Facets(GaussianSlopes(), ("v-cavity",)), EnergyBalance())
    gaussian_slopes: ClassVar[bool] = True
