"""The panel of measured points, and what the panels of other figures share with it: axes, scales, remarks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.dataset.points import Points
from pbrdf.report.dataset.quantities import is_intensity, quantity_label
from pbrdf.report.dataset.shown_cuts import ShownCuts
from pbrdf.report.numbers import brief
from pbrdf.report.style import GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "LOGARITHMIC_FROM",
    "PANEL_SIZE",
    "VIEWING_ANGLE",
    "channel_label",
    "cut_axis_label",
    "cut_panel",
    "dress_hemisphere",
    "point_label",
    "remark",
    "scale_intensity",
    "scale_signed",
]

#: Width and height of a panel of points, inches.
PANEL_SIZE = (4.5, 2.8)
#: Decades from which on an intensity is drawn on a logarithmic axis.
LOGARITHMIC_FROM = 1.5
#: Decades up to which a logarithmic axis has labels at 1, 2 and 5.
_FEW_DECADES = 2.5
#: Decades from which on a linear axis of intensity begins at 0: below, the differences are what matters.
_FROM_ZERO = 0.4
#: Part of the value that 95 % exceed, below which a logarithmic axis does not reach.
_DARK = 0.2

#: Half the least range of an axis of shares such as Q/I.
_SMALLEST_SPAN = 0.005

VIEWING_ANGLE = "viewing angle θr (°), negative on the source's side"
_INCIDENCE = "angle of incidence θi (°)"


def cut_panel(
    ax: Axes, points: Points, shown: ShownCuts, name: str, held_out: np.ndarray | None = None
) -> None:
    """One channel against the angle: points with error bars.

    Parameters
    ----------
    ax
        Where to draw.
    points
        All points.
    shown
        The cuts to draw.
    name
        ``"intensity"``, ``"dolp"`` or one of :attr:`Points.polarised`.
    held_out
        Points to draw with open markers, shape (G,); None for none.
    """
    channel = points.channel(name)
    for cut, look in zip(shown.cuts, shown.looks, strict=True):
        held = np.zeros(cut.rows.shape, dtype=bool) if held_out is None else held_out[cut.rows]
        for chosen, filled in ((~held, True), (held, False)):
            rows = cut.rows[chosen]
            if not rows.size:
                continue
            std = channel.std[rows]
            ax.errorbar(
                cut.x[chosen],
                channel.measured[rows],
                yerr=std if np.isfinite(std).any() else None,
                fmt=look.marker,
                color=look.colour,
                markerfacecolor=look.colour if filled else "white",
                elinewidth=0.8,
                label=point_label(filled),
                zorder=3,
            )
    ax.set_xlabel(cut_axis_label(shown))
    ax.set_ylabel(channel_label(name, points))
    if is_intensity(name):
        scale_intensity(ax, channel.measured[np.concatenate([cut.rows for cut in shown.cuts])])
    elif name == "dolp":
        ax.set_ylim(0.0, min(ax.get_ylim()[1], 1.05))
    else:
        scale_signed(ax, name)


def cut_axis_label(shown: ShownCuts) -> str:
    """Name of the angle along the cuts, for an axis."""
    return _INCIDENCE if shown.cuts[0].over_incidence else VIEWING_ANGLE


def dress_hemisphere(ax: Any) -> None:
    """Label a polar plot of viewing directions: θ_r outwards, forward on the right."""
    ax.set_ylim(0.0, 90.0)
    ax.set_yticks([30.0, 60.0], ["30°", "60°"], fontsize=7.5)
    ax.set_xticks(np.deg2rad([0.0, 90.0, 180.0, 270.0]), ["forward", "90°", "back", "−90°"], fontsize=8.5)
    ax.tick_params(axis="x", pad=8.0)


def channel_label(name: str, points: Points) -> str:
    """Name of a channel with its unit, for an axis."""
    if name == "dolp":
        return "degree of linear polarisation"
    if name != "intensity":
        return quantity_label(name)
    return "intensity (arbitrary scale)" if points.arbitrary_scale else "intensity (1/sr)"


def point_label(filled: bool) -> str:
    """What filled and open markers stand for."""
    return "measured" if filled else "held out"


def scale_intensity(ax: Axes, measured: np.ndarray, modelled: np.ndarray | None = None) -> None:
    """Scale the axis to what was drawn: logarithmic if that spans decades, else from 0 if it comes near 0.

    With modelled values too, both axes. What the axes leave out is counted in the panel.
    """
    together = measured if modelled is None else np.concatenate([measured, modelled])
    positive = together[together > 0.0]
    if not positive.size:
        return
    # A few readings in the dark must not press everything else into a corner.
    floor = _DARK * float(np.quantile(positive, 0.05))
    lowest = max(floor, float(positive.min()))
    decades = math.log10(float(positive.max()) / lowest)
    if decades <= LOGARITHMIC_FROM:
        if modelled is None and decades > _FROM_ZERO:
            ax.set_ylim(bottom=min(0.0, float(np.nanmin(together))))
        return
    for name in ("y",) if modelled is None else ("y", "x"):
        ax.set(**{f"{name}scale": "log"})
        if decades < _FEW_DECADES:
            _label_within_decades(getattr(ax, f"{name}axis"))
        if floor >= positive.min():
            ax.set(**{f"{name}lim": (floor, None)})
    lost = int((measured < lowest).sum())
    if lost:
        limit = f"below {brief(floor, 2)}" if floor >= positive.min() else "≤ 0"
        remark(ax, f"{lost} measured value{'s' if lost > 1 else ''} {limit} not shown")


def scale_signed(ax: Axes, name: str) -> None:
    """Scale the axis of a quantity that has a sign, or of the angle of linear polarisation, to what was drawn."""
    if name == "aolp":
        ax.set_ylim(-45.0, 135.0)
        ax.set_yticks([-45.0, 0.0, 45.0, 90.0, 135.0], ["−45", "0 (p)", "45", "90 (s)", "135"])
        return
    ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
    low, high = ax.get_ylim()
    # what is 0 but for rounding must not look like noise
    ax.set_ylim(max(min(low, -_SMALLEST_SPAN), -1.05), min(max(high, _SMALLEST_SPAN), 1.05))


def _label_within_decades(axis: Any) -> None:
    """Labels 0.1, 0.2, 0.5, 1 … on a logarithmic axis that is short of decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def remark(ax: Axes, text: str) -> None:
    """A remark in the lower left corner, readable over points."""
    ax.annotate(
        text,
        (0.02, 0.03),
        xycoords="axes fraction",
        fontsize=8.5,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5},
        zorder=6,
    )
