"""A model of one's own, as a user writes it outside of the package: facets with long tails over a Lambertian body."""

from __future__ import annotations

import math

from pbrdf.models import Model, Parameter
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.shadowing import v_cavity

INFINITY = float("inf")


class LambertGGX(Model):
    """Facets of the distribution GGX over a Lambertian body.

    Walter, Marschner, Li, Torrance, "Microfacet models for refraction through rough surfaces", EGSR 2007.
    """

    name = "lambert-ggx"
    parameters = (
        Parameter("alpha", "α", "1", "width of the distribution", 0.005, 0.8, (0.001, 2.0), 0.1,
                  logarithmic=True, part="specular"),
        Parameter("index", "n", "1", "refractive index", 1.2, 2.6, (1.0, 100.0), 1.5, part="specular"),
        Parameter("extinction", "κ", "1", "extinction", 0.0, 5.0, (0.0, 100.0), 0.0,
                  fitted=False, vanishing=True, extinction_of="index", part="specular"),
        Parameter("rho", "ρ", "1", "albedo of the body", 1e-3, 2.0, (0.0, INFINITY), 0.5,
                  logarithmic=True, amplitude=True, part="diffuse"),
    )  # fmt: skip

    def kernel(self, geometry, values, part="total"):
        f = [[0.0] * 4 for _ in range(4)]
        if part != "diffuse":
            cosine, width2 = geometry.facet[2], values["alpha"] * values["alpha"]
            spread = width2 + tan2_tilt(geometry)
            density = width2 / (math.pi * cosine * cosine * cosine * spread * spread)
            shadowing = v_cavity(geometry, None)
            f = facet_reflection(geometry, density, shadowing, values["index"], values["extinction"])
        if part != "specular":
            f[0][0] = f[0][0] + values["rho"] * (1.0 / math.pi)
        return f
