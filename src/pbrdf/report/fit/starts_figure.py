"""Where the starts of a fit began and ended, drawn."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.dataset.describe import short_name
from pbrdf.report.style import BLUE, RED, panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.report.fit.subject import Report

__all__ = ["starts_figure"]

# Inches
_PANEL = (2.6, 1.9)


def starts_figure(report: Report) -> Figure:
    """Where every start of a fit began and where it ended, one panel per free parameter.

    Parameters
    ----------
    report
        The fit; its data are not looked at.
    """
    result = report.result
    free = [e for e in result.estimates.values() if e.verdict != "fixed"]
    best = result.chi2_by_start <= np.nanmin(result.chi2_by_start) * (1.0 + 1e-4) + 1e-9
    columns = min(len(free), 3)
    handles: list[dict[str, Any]] = [
        {"color": BLUE, "linestyle": "-", "label": f"reached the best optimum ({best.sum()})"},
        {"color": RED, "linestyle": "--", "label": f"ended elsewhere ({(~best).sum()})"},
    ]
    title = f"{len(best)} start{'s' if len(best) > 1 else ''} of the fit to {short_name(report.name, report.dataset)}"
    with styled():
        from matplotlib.lines import Line2D
        from matplotlib.ticker import FuncFormatter

        figure, axes = panels(
            math.ceil(len(free) / columns),
            columns,
            _PANEL,
            title,
            [Line2D([], [], **h) for h in handles],
        )
        for i, (estimate, ax) in enumerate(zip(free, axes.ravel(), strict=False)):
            for chosen, style in ((~best, handles[1]), (best, handles[0])):
                # One line with gaps for all starts is drawn much faster than a line for each.
                gap = np.full(int(chosen.sum()), np.nan)
                y = np.stack([result.start_values[chosen, i], result.end_values[chosen, i], gap], axis=1)
                x = np.tile([0.0, 1.0, np.nan], len(gap))
                ax.plot(x, y.ravel(), linewidth=0.8, marker="o", markersize=2.5, alpha=0.5, **style)
            p = estimate.parameter
            ax.set_title(textwrap.fill(f"{p.symbol}: {p.description}", 38), fontsize=8.5)
            if p.logarithmic:
                ax.set_yscale("log")
                # formulas as labels and ticks between the decades take longer than the lines
                ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
                ax.minorticks_off()
            ax.set_ylim(estimate.lower, estimate.upper)
            ax.set_xticks([0, 1], ["start", "end"])
            ax.set_xlim(-0.12, 1.12)
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_label_coords(0.5, 0.0)  # it has no label: no search for its place
        for ax in axes.ravel()[len(free) :]:
            ax.remove()
        return figure
