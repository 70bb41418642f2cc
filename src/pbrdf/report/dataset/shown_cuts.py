"""The cuts that a figure draws: not more than can be told apart, and how each of them looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrdf.report.dataset.cuts import Cut, in_plane_cuts
from pbrdf.report.dataset.points import Points
from pbrdf.report.numbers import brief
from pbrdf.report.style import DISTINCT_COLOURS, RED, Look, looks_of

__all__ = ["ShownCuts", "shown_cuts"]

#: More cuts than this in one panel cannot be told apart.
_MOST_CUTS = 10


@dataclass(frozen=True)
class ShownCuts:
    """Cuts through the plane of incidence, chosen to be drawn.

    Attributes
    ----------
    cuts, looks
        The cuts, and how to draw each; empty if the points are on no few lines.
    found
        How many cuts there are, those that are not drawn included.
    """

    cuts: list[Cut]
    looks: list[Look]
    found: int

    @property
    def title(self) -> str:
        """What stands above the panel."""
        some = f" ({len(self.cuts)} of {self.found} curves drawn)" if len(self.cuts) < self.found else ""
        return f"Plane of incidence{some}"

    def label(self, cut: Cut) -> str:
        """What one of the cuts is called in the legend."""
        if cut.kind == "bistatic":
            return f"group {cut.group}: θi + θr = {brief(cut.constant)}°"
        # The source of a goniometer may stand at 0.001°.
        left = {"theta_i": "θi", "theta_r": "θr", "mirror": "θr − θi"}[cut.kind]
        angle = f"{left} = {round(cut.constant, 1) + 0.0:g}°"
        # Readers of hemispherical data call a group by its angle of incidence: once is enough.
        if len({c.group for c in self.cuts}) == 1 or cut.group == f"{cut.constant:.0f}":
            return angle
        return f"group {cut.group}: {angle}"


def shown_cuts(points: Points, held_out: np.ndarray | None = None) -> ShownCuts:
    """The cuts through the points, thinned out evenly if they are many.

    Parameters
    ----------
    points
        All points.
    held_out
        Points that must be found in the figure, shape (G,): their cuts are drawn first. None for none.
    """
    apart = np.zeros(points.theta_i.shape, dtype=bool) if held_out is None else held_out
    found = in_plane_cuts(points)
    cuts = _spread(found, apart)
    looks = looks_of(len(cuts))
    if len(cuts) > DISTINCT_COLOURS:
        # On a ramp of many colours nobody finds what was held out: it leaves the ramp.
        looks = [
            Look(RED, look.marker) if apart[cut.rows].all() else look
            for cut, look in zip(cuts, looks, strict=True)
        ]
    return ShownCuts(cuts, looks, len(found))


def _spread(cuts: list[Cut], apart: np.ndarray) -> list[Cut]:
    """Evenly spread cuts, those with points set apart first."""
    if len(cuts) <= _MOST_CUTS:
        return cuts
    held = [i for i, cut in enumerate(cuts) if apart[cut.rows].any()][: _MOST_CUTS // 2]
    others = [i for i in range(len(cuts)) if i not in held]
    even = np.linspace(0, len(others) - 1, _MOST_CUTS - len(held)).round().astype(int)
    return [cuts[i] for i in sorted({*held, *(others[j] for j in even)})]
