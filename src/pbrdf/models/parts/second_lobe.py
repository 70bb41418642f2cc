"""A second lobe of facets in the same model: those of a density, under names of their own, under a V-cavity.

The formula is the facets' (:mod:`pbrdf.models.parts.facets`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pbrdf.models.parts.facets import Density, Facets
from pbrdf.models.parts.part import Renamed

__all__ = ["SecondLobe"]


class SecondLobe(Renamed):
    """Facets of a density under other names. Reciprocal; conserves energy for ζ₂ ≤ 1.

    Parameters
    ----------
    density
        Of the facets' projected area.
    names
        New names by old ones, with symbols, as for :class:`~pbrdf.models.parts.part.Renamed`; those that the density
        does not have are passed over.
    declared
        By new name, what the declaration of a parameter says otherwise than the first lobe's.
    """

    def __init__(
        self,
        density: Density,
        names: Mapping[str, tuple[str, str]],
        declared: Mapping[str, Mapping[str, Any]],
    ) -> None:
        facets = Facets(density, ("v-cavity",), strength=True)
        own = {p.name for p in facets.parameters}
        super().__init__(facets, {old: new for old, new in names.items() if old in own})
        self.parameters = tuple(replace(p, **declared.get(p.name, {})) for p in self.parameters)
