"""Joint confidence regions of pairs of parameters, drawn."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pbrdf.models.parameters import shown_unit
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.numbers import brief
from pbrdf.report.style import BLUE, GREY, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.inversion.contour import Contour
    from pbrdf.inversion.estimates import Estimate
    from pbrdf.report.fit.subject import Report

__all__ = ["contour_figure"]

# Inches
_PANEL = (3.9, 3.2)
#: Opacity of the regions from the smallest on, and the style of their edges.
_REGIONS: tuple[tuple[float, Literal["-", "--", ":"]], ...] = ((0.55, "-"), (0.25, "--"), (0.12, ":"))
_BEST: dict[str, Any] = {"color": "black", "marker": "+", "markersize": 9.0, "linestyle": "none"}


def contour_figure(report: Report) -> Figure:
    """The joint confidence regions that a fit was asked for, one panel per pair.

    The regions are those of the pair, wider on each axis than the interval of that parameter by itself. A cross
    marks the best optimum, a grey bar a bound at which a region ends.

    Parameters
    ----------
    report
        A fit whose checks hold contours, at least one.
    """
    assert report.checks is not None
    contours = report.checks.contours
    columns = min(len(contours), 3)
    rises = contours[0].rises
    with styled():
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        handles: list[Any] = [
            Patch(
                facecolor=(BLUE, opacity),
                edgecolor=BLUE,
                linestyle=line,
                label=f"{level:.0%} for the pair (χ² + {brief(rise, 3)})",
            )
            for (level, rise), (opacity, line) in zip(sorted(rises.items()), _REGIONS, strict=False)
        ]
        handles.append(Line2D([], [], label="best", **_BEST))
        if any(_bounds_met(c, report) for c in contours):
            handles.append(Line2D([], [], color=GREY, linewidth=3.0, label="bound of the fit"))
        title = f"Joint confidence regions, {short_name(report.name, report.dataset)}"
        figure, axes = panels(math.ceil(len(contours) / columns), columns, _PANEL, title, handles)
        for found, ax in zip(contours, axes.ravel(), strict=False):
            _draw(ax, found, report)
        for ax in axes.ravel()[len(contours) :]:
            ax.remove()
        return figure


def _draw(ax: Axes, contour: Contour, report: Report) -> None:
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    estimates = [report.result.estimates[name] for name in (contour.a, contour.b)]
    factors = [shown_unit(e.parameter)[0] for e in estimates]
    x, y = (f * contour.grid[name].values for f, name in zip(factors, (contour.a, contour.b), strict=True))
    rise = contour.grid["chi2_rise"].values.T
    inner = min(float(np.nanmin(rise)), 0.0) - 1.0
    for level, (opacity, line) in zip(sorted(contour.rises), _REGIONS, strict=False):
        edge = contour.rises[level]
        ax.contourf(x, y, rise, levels=[inner, edge], colors=[BLUE], alpha=opacity)
        ax.contour(x, y, rise, levels=[edge], colors=[BLUE], linestyles=line)
    ax.plot(*(f * e.value for f, e in zip(factors, estimates, strict=True)), **_BEST)
    for name, edge in _bounds_met(contour, report):
        draw = ax.axvline if name == contour.a else ax.axhline
        draw(edge, color=GREY, linewidth=3.0)
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    for axis, values, estimate in ((ax.xaxis, x, estimates[0]), (ax.yaxis, y, estimates[1])):
        if estimate.parameter.logarithmic and values[-1] > 10.0 * values[0] > 0.0:
            axis.axes.set(**{f"{axis.axis_name}scale": "log"})
        else:
            axis.set_major_locator(MaxNLocator(5))
            axis.set_major_formatter(ScalarFormatter(useOffset=False))
        axis.set_label_text(_label(estimate), fontsize=8.5)


def _bounds_met(contour: Contour, report: Report) -> list[tuple[str, float]]:
    """The bounds, in the shown unit, at which the largest region ends, with the name of their parameter."""
    met = []
    inside = contour.grid["chi2_rise"] <= max(contour.rises.values())
    for name, other in ((contour.a, contour.b), (contour.b, contour.a)):
        estimate = report.result.estimates[name]
        along = inside.any(other).values
        values = contour.grid[name].values
        reach = 1e-6 * (values[-1] - values[0])
        for end, bound in ((0, estimate.lower), (-1, estimate.upper)):
            if along[end] and abs(values[end] - bound) <= reach:
                met.append((name, shown_unit(estimate.parameter)[0] * bound))
    return met


def _label(estimate: Estimate) -> str:
    p = estimate.parameter
    _, unit = shown_unit(p)
    symbol = p.name if "[" in p.name else p.symbol
    return textwrap.fill(f"{symbol}: {p.description}" + (f" ({unit})" if unit != "1" else ""), 56)
