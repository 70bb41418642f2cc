"""The haze around a mirror image: facets of the coat itself, with a density and a strength of their own.

The formula is the facets' (:mod:`pbrdf.models.parts.facets`), the index that of the coat.
"""

from __future__ import annotations

from typing import Any

from pbrdf.models.parts.facets import Density
from pbrdf.models.parts.second_lobe import SecondLobe

__all__ = ["Haze"]

_NAMES = {
    "sigma": ("haze_sigma", "σ₂"),
    "roughness": ("haze_roughness", "α₂"),
    "exponent": ("haze_exponent", "β₂"),
    "strength": ("haze_strength", "ζ₂"),
}
_SAID: dict[str, dict[str, Any]] = {
    "haze_strength": {
        "description": "share of the coat's surface that makes the haze, on the data's own scale",
        "lower": 1e-3,
        "default": 0.3,
        "fitted": True,
    },
}


class Haze(SecondLobe):
    """Facets of a density under the names ``haze_…``, under a V-cavity. Reciprocal; conserves energy for ζ₂ ≤ 1.

    Parameters
    ----------
    density
        Of the facets' projected area.
    """

    def __init__(self, density: Density) -> None:
        super().__init__(density, _NAMES, _SAID)
