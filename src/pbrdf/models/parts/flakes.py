"""A second lobe of facets: flakes below a clear coat, with a density, a strength and an index of their own.

The formula is the facets' (:mod:`pbrdf.models.parts.facets`). Nothing is refracted: the tilt of flakes below a coat
is the one that they seem to have from outside, and what the coat takes from their light is in the strength.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pbrdf.models.arrays import Matrix, is_zero
from pbrdf.models.parameters import Parameter
from pbrdf.models.parts.facets import Density
from pbrdf.models.parts.second_lobe import SecondLobe
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.interference import two_beam_interference

__all__ = ["Flakes", "InterferenceFlakes"]

_NAMES = {
    "sigma": ("flake_sigma", "σ₂"),
    "roughness": ("flake_roughness", "α₂"),
    "exponent": ("flake_exponent", "β₂"),
    "n": ("flake_n", "n₂"),
    "kappa": ("flake_kappa", "κ₂"),
    "strength": ("flake_strength", "ζ₂"),
}
#: What is said otherwise of the second lobe: it is broad, its strength is fitted, its index is aluminium's at 550 nm.
_SAID: dict[str, dict[str, Any]] = {
    "flake_sigma": {
        "description": "standard deviation of one slope component of the second lobe's facets",
        "lower": 0.02,
        "default": 0.2,
    },
    "flake_roughness": {
        "description": "slope at which the density of the second lobe's facets has fallen to 1/e",
        "lower": 0.01,
        "default": 0.2,
    },
    "flake_exponent": {"description": "exponent of the density of the second lobe's slopes"},
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


class Flakes(SecondLobe):
    """Facets of a density under the names ``flake_…``, under a V-cavity. Reciprocal; conserves energy for ζ₂ ≤ 1.

    Parameters
    ----------
    density
        Of the facets' projected area.
    """

    def __init__(self, density: Density) -> None:
        super().__init__(density, _NAMES, _SAID)


_FILM = (
    Parameter(
        "film_order", "m", "1", "order of the film's interference at normal incidence, 2 n_f d/λ",
        0.3, 4.0, (0.0, 100.0), 1.5, part="specular",
    ),
    Parameter(
        "film_visibility", "V", "1", "contrast of the film's interference",
        0.0, 1.0, (0.0, 1.0), 0.5, part="specular",
    ),
    Parameter(
        "film_n", "n_f", "1", "refractive index of the film on the flakes (magnesium fluoride's unless given)",
        1.2, 2.6, (1.0, 10.0), 1.38, fitted=False, part="specular", refractive_index=True,
    ),
)  # fmt: skip


class InterferenceFlakes(Flakes):
    """Flakes with a thin film, whose reflection changes with the local angle of incidence.

    Own construction: the flakes' matrix times the two beams' interference
    (:func:`~pbrdf.optics.interference.two_beam_interference`), the same for both polarisations. Reciprocal; conserves
    energy for ζ₂ ≤ 1.
    """

    def __init__(self, density: Density) -> None:
        super().__init__(density)
        self.parameters = (*self.parameters, *_FILM)

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        share = two_beam_interference(
            geometry.cos_beta, values["film_order"], values["film_visibility"], values["film_n"]
        )
        f = super().matrix(geometry, values, chosen)
        return [[x if is_zero(x) else x * share for x in row] for row in f]

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        share = two_beam_interference(
            cos_theta, values["film_order"], values["film_visibility"], values["film_n"]
        )
        return super().albedo(cos_theta, values) * share
