"""The panels that figures are made of: each draws one channel into one pair of axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.dataset.cuts import Cut
from pbrdf.report.dataset.points import Channel, Points
from pbrdf.report.numbers import brief
from pbrdf.report.style import GREY, Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "LOGARITHMIC_FROM",
    "VIEWING_ANGLE",
    "agreement_panel",
    "channel_label",
    "cut_panel",
    "difference_panel",
    "dress_hemisphere",
]

#: Decades from which on an intensity is drawn on a logarithmic axis.
LOGARITHMIC_FROM = 1.5
#: Decades up to which a logarithmic axis has labels at 1, 2 and 5.
_FEW_DECADES = 2.5
#: Decades from which on a linear axis of intensity begins at 0: below, the differences are what matters.
_FROM_ZERO = 0.4
#: Part of the value that 95 % exceed, below which a logarithmic axis does not reach.
_DARK = 0.2
#: With more points than this the markers are small and see-through.
_MANY_POINTS = 300

VIEWING_ANGLE = "viewing angle θr (°), negative on the source's side"
_INCIDENCE = "angle of incidence θi (°)"


def cut_panel(
    ax: Axes,
    points: Points,
    cuts: list[Cut],
    looks: list[Look],
    name: str,
    channel: Channel,
    curves: list[np.ndarray] | None,
) -> None:
    """One channel against the angle: points with error bars, the model as lines.

    Parameters
    ----------
    ax
        Where to draw.
    points
        All points.
    cuts, looks
        What to draw, and how.
    name, channel
        ``"intensity"`` or ``"dolp"``, and its values.
    curves
        The model along each cut's path; None without a model.
    """
    for i, (cut, look) in enumerate(zip(cuts, looks, strict=True)):
        held = points.held_out[cut.rows]
        if curves is not None:
            line, width = ("--", 2.0) if held.all() else ("-", 1.4)
            ax.plot(
                cut.path_x,
                curves[i],
                color=look.colour,
                linestyle=line,
                linewidth=width,
                label="model",
                zorder=2,
            )
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
                label=_label_of_points(filled),
                zorder=3,
            )
        if points.diffuse is not None:
            used = points.diffuse[cut.rows]
            ax.plot(
                cut.x[used],
                channel.measured[cut.rows[used]],
                "o",
                color="white",
                markersize=2.0,
                label="diffuse step",
                zorder=4,
            )
    ax.set_xlabel(_INCIDENCE if cuts[0].kind == "theta_r" else VIEWING_ANGLE)
    ax.set_ylabel(channel_label(name, points))
    if name == "intensity":
        _scale_intensity(ax, channel.measured[np.concatenate([cut.rows for cut in cuts])])
    else:
        ax.set_ylim(0.0, min(ax.get_ylim()[1], 1.05))


def difference_panel(
    ax: Axes, points: Points, cuts: list[Cut], looks: list[Look], name: str, channel: Channel
) -> None:
    """Model − measured against the angle, relative for the intensity; parameters as of :func:`cut_panel`."""
    differences = channel.modelled - channel.measured
    if name == "intensity":
        with np.errstate(divide="ignore", invalid="ignore"):
            differences = np.where(channel.measured > 0.0, 100.0 * differences / channel.measured, np.nan)
    ax.axhline(0.0, color="black", linewidth=0.8, zorder=1)
    for cut, look in zip(cuts, looks, strict=True):
        held = points.held_out[cut.rows]
        for chosen, filled in ((~held, True), (held, False)):
            if chosen.any():
                ax.plot(
                    cut.x[chosen],
                    differences[cut.rows[chosen]],
                    look.marker,
                    color=look.colour,
                    markerfacecolor=look.colour if filled else "white",
                    label=_label_of_points(filled),
                )
    rows = np.concatenate([cut.rows for cut in cuts])
    _limit_differences(ax, differences[rows], " %" if name == "intensity" else "")
    ax.set_xlabel(_INCIDENCE if cuts[0].kind == "theta_r" else VIEWING_ANGLE)
    ax.set_ylabel("relative difference of intensity (%)" if name == "intensity" else "difference of DoLP")


def agreement_panel(ax: Axes, points: Points, looks: dict[str, Look], name: str, channel: Channel) -> None:
    """Modelled against measured values of all points, with the line of equality.

    Parameters
    ----------
    ax, points, name, channel
        As of :func:`cut_panel`.
    looks
        How to draw each group.
    """
    many = points.theta_i.size > _MANY_POINTS
    usable = np.isfinite(channel.measured) & np.isfinite(channel.modelled)
    if name == "intensity":
        usable &= channel.measured > 0.0
    for filled in (True, False):  # the few that were held out are drawn over the many that were not
        for group, look in looks.items():
            chosen = usable & (points.group == group) & (points.held_out != filled)
            if chosen.any():
                ax.plot(
                    channel.measured[chosen],
                    channel.modelled[chosen],
                    look.marker,
                    color=look.colour,
                    markerfacecolor=look.colour if filled else "white",
                    markersize=3.0 if many else 4.5,
                    markeredgewidth=0.7,
                    alpha=0.6 if many else 1.0,
                    label=_label_of_points(filled),
                )
    values = np.concatenate([channel.measured[usable], channel.modelled[usable]])
    ends = np.array([values.min(), values.max()]) if values.size else np.array([0.0, 1.0])
    ax.plot(ends, ends, color="black", linewidth=0.9, zorder=4, label="equal")
    if name == "intensity":
        for factor in (0.8, 1.25):
            ax.plot(ends, factor * ends, color=GREY, linewidth=0.8, linestyle=":", zorder=4, label="25 % off")
        ax.annotate("dotted: 25 % apart", (0.97, 0.04), xycoords="axes fraction", ha="right", fontsize=8.5)
        _scale_intensity(ax, channel.measured, channel.modelled)
    label = channel_label(name, points)
    ax.set_xlabel(f"measured {label}")
    ax.set_ylabel(f"modelled {label}")


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
    return "intensity (arbitrary scale)" if points.arbitrary_scale else "intensity (1/sr)"


def _label_of_points(filled: bool) -> str:
    return "measured" if filled else "held out"


def _scale_intensity(ax: Axes, measured: np.ndarray, modelled: np.ndarray | None = None) -> None:
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
        _remark(ax, f"{lost} measured value{'s' if lost > 1 else ''} {limit} not shown")


def _label_within_decades(axis: Any) -> None:
    """Labels 0.1, 0.2, 0.5, 1 … on a logarithmic axis that is short of decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _limit_differences(ax: Axes, differences: np.ndarray, unit: str) -> None:
    """Limits symmetric about 0; if a few values are far out, without them, and says so."""
    size = np.abs(differences[np.isfinite(differences)])
    if not size.size or size.max() == 0.0:
        return
    usual = float(np.quantile(size, 0.95)) * 1.5
    limit = 1.1 * float(size.max()) if size.max() <= 2.0 * usual else usual
    ax.set_ylim(-limit, limit)
    beyond = int((size > limit).sum())
    if beyond:
        count = f"{beyond} value{'s' if beyond > 1 else ''}"
        _remark(ax, f"{count} beyond the axis, up to {brief(float(size.max()), 3)}{unit}")


def _remark(ax: Axes, text: str) -> None:
    """A remark in the lower left corner, readable over points."""
    ax.annotate(
        text,
        (0.02, 0.03),
        xycoords="axes fraction",
        fontsize=8.5,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5},
        zorder=6,
    )
