"""Part of a dense data set that stands for all of it: what many starts search, before the best see every geometry.

Geometries are drawn evenly over strata of direction (tilt of the mirroring facet on a logarithmic scale, so that a
narrow lobe keeps its points; θ_i; θ_r) and of the groups or wavelengths that have unknowns, or held values, of their
own. Each counts for those of its stratum that were left out, so χ² of the part estimates χ² of all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space
from pbrdf.optics.half_difference import facet_tilt

__all__ = ["Part", "draw", "thinned"]

#: Geometries that are enough to search, at least, and for each unknown.
ENOUGH, FOR_EACH_UNKNOWN = 250, 40
#: Data of fewer than so many times as many geometries are searched as they are.
WORTH_IT = 3
#: Edges of the strata, degrees.
_TILT = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 7.0, 12.0, 20.0, 35.0])
_ZENITH = np.arange(10.0, 90.0, 10.0)


@dataclass(frozen=True)
class Part:
    """Geometries that stand for all.

    Attributes
    ----------
    rows
        Their numbers, shape (g,).
    weight
        How many each counts for, shape (g,).
    """

    rows: np.ndarray
    weight: np.ndarray

    def of(self, data: Observations) -> Observations:
        """The part of a data set of the same geometries."""
        part = data.subset(self.rows)
        return replace(part, std=part.std / np.sqrt(self.weight))


def thinned(space: Space, data: Observations) -> Observations | None:
    """Part of the geometries, weighted to stand for all; None where there are not many more than are enough."""
    part = draw(space, data)
    return None if part is None else part.of(data)


def draw(space: Space, data: Observations, seed: int = 0) -> Part | None:
    """Draw part of the geometries; None where there are not many more than are enough.

    Parameters
    ----------
    space
        The problem: with a robust loss, which is no sum of squares, each counts for itself only.
    data
        All observations.
    seed
        Seed of the draw.

    Returns
    -------
    Part or None
    """
    enough = max(ENOUGH, FOR_EACH_UNKNOWN * len(space.free))
    used = np.flatnonzero(np.isfinite(data.std).any(axis=0))
    if len(used) < WORTH_IT * enough:
        return None
    stratum = _strata(space, data, used)
    chance = np.random.default_rng(seed).random(len(used))
    # a geometry's place among those of its stratum, in the order of chance
    order = np.lexsort((chance, stratum))
    sizes = np.bincount(stratum)
    place = np.empty(len(used), dtype=int)
    place[order] = np.arange(len(used)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    chosen = np.lexsort((chance, place))[:enough]
    drawn = np.bincount(stratum[chosen], minlength=len(sizes))
    weight = (sizes / np.maximum(drawn, 1))[stratum[chosen]]
    return Part(used[chosen], weight if space.loss == "linear" else np.ones(enough))


def _strata(space: Space, data: Observations, used: np.ndarray) -> np.ndarray:
    """Number of the stratum of each geometry that is used."""
    tilt = np.rad2deg(facet_tilt(data.theta_i[used], data.theta_r[used], data.phi[used]))
    columns = [np.digitize(tilt, _TILT)]
    columns += [np.digitize(np.rad2deg(angle[used]), _ZENITH) for angle in (data.theta_i, data.theta_r)]
    for own, labels in ((space.labels("group"), data.group), (space.wavelengths, data.wavelength)):
        if own and labels is not None:
            columns.append(np.unique(labels[used], return_inverse=True)[1])
    return np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)[1].ravel()
