"""The panels of a fit: measured points beside the model, and how far they are from each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.statistics import relative_errors
from pbrdf.report.dataset.panels import (
    channel_label,
    cut_axis_label,
    cut_panel,
    point_label,
    remark,
    scale_intensity,
)
from pbrdf.report.dataset.quantities import is_intensity, quantity_label
from pbrdf.report.dataset.shown_cuts import ShownCuts
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.numbers import brief
from pbrdf.report.style import GREY, Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["agreement_panel", "difference_panel", "fitted_cut_panel"]

#: With more points than this the markers are small and see-through.
_MANY_POINTS = 300


def fitted_cut_panel(
    ax: Axes, points: FittedPoints, shown: ShownCuts, name: str, curves: list[np.ndarray]
) -> None:
    """One channel against the angle: points with error bars, the model as lines.

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
    curves
        The model along each cut's path.
    """
    for cut, look, curve in zip(shown.cuts, shown.looks, curves, strict=True):
        line, width = ("--", 2.0) if points.held_out[cut.rows].all() else ("-", 1.4)
        ax.plot(
            cut.path_x,
            curve,
            color=look.colour,
            linestyle=line,
            linewidth=width,
            label="model",
            zorder=2,
        )
    cut_panel(ax, points.measured, shown, name, points.held_out)
    if points.diffuse is not None:
        measured = points.measured.channel(name).measured
        for cut in shown.cuts:
            used = points.diffuse[cut.rows]
            ax.plot(
                cut.x[used],
                measured[cut.rows[used]],
                "o",
                color="white",
                markersize=2.0,
                label="diffuse step",
                zorder=4,
            )


def difference_panel(ax: Axes, points: FittedPoints, shown: ShownCuts, name: str) -> None:
    """Model − measured against the angle, relative for the intensity; parameters as of :func:`fitted_cut_panel`."""
    measured = points.measured.channel(name).measured
    modelled = points.modelled[name]
    relative = name == "intensity"
    differences = 100.0 * relative_errors(modelled, measured) if relative else modelled - measured
    ax.axhline(0.0, color="black", linewidth=0.8, zorder=1)
    for cut, look in zip(shown.cuts, shown.looks, strict=True):
        held = points.held_out[cut.rows]
        for chosen, filled in ((~held, True), (held, False)):
            if chosen.any():
                ax.plot(
                    cut.x[chosen],
                    differences[cut.rows[chosen]],
                    look.marker,
                    color=look.colour,
                    markerfacecolor=look.colour if filled else "white",
                    label=point_label(filled),
                )
    rows = np.concatenate([cut.rows for cut in shown.cuts])
    _limit_differences(ax, differences[rows], " %" if name == "intensity" else "")
    ax.set_xlabel(cut_axis_label(shown))
    what = "DoLP" if name == "dolp" else quantity_label(name)
    ax.set_ylabel("relative difference of intensity (%)" if name == "intensity" else f"difference of {what}")


def agreement_panel(ax: Axes, points: FittedPoints, looks: dict[str, Look], name: str) -> None:
    """Modelled against measured values of all points, with the line of equality.

    Parameters
    ----------
    ax, points, name
        As of :func:`fitted_cut_panel`.
    looks
        How to draw each group.
    """
    measured, modelled = points.measured.channel(name).measured, points.modelled[name]
    many = measured.size > _MANY_POINTS
    usable = np.isfinite(measured) & np.isfinite(modelled)
    if is_intensity(name):
        usable &= measured > 0.0
    for filled in (True, False):  # the few that were held out are drawn over the many that were not
        for group, look in looks.items():
            chosen = usable & (points.measured.group == group) & (points.held_out != filled)
            if chosen.any():
                ax.plot(
                    measured[chosen],
                    modelled[chosen],
                    look.marker,
                    color=look.colour,
                    markerfacecolor=look.colour if filled else "white",
                    markersize=3.0 if many else 4.5,
                    markeredgewidth=0.7,
                    alpha=0.6 if many else 1.0,
                    label=point_label(filled),
                )
    values = np.concatenate([measured[usable], modelled[usable]])
    ends = np.array([values.min(), values.max()]) if values.size else np.array([0.0, 1.0])
    ax.plot(ends, ends, color="black", linewidth=0.9, zorder=4, label="equal")
    if is_intensity(name):
        for factor in (0.8, 1.25):
            ax.plot(ends, factor * ends, color=GREY, linewidth=0.8, linestyle=":", zorder=4, label="25 % off")
        ax.annotate("dotted: 25 % apart", (0.97, 0.04), xycoords="axes fraction", ha="right", fontsize=8.5)
        scale_intensity(ax, measured, modelled)
    label = channel_label(name, points.measured)
    ax.set_xlabel(f"measured {label}")
    ax.set_ylabel(f"modelled {label}")


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
        remark(ax, f"{count} beyond the axis, up to {brief(float(size.max()), 3)}{unit}")
