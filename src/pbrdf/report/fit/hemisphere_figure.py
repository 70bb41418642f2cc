"""Figure of a fit's residuals over the hemisphere of viewing directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.statistics import relative_errors
from pbrdf.report.dataset.cuts import in_plane
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import dress_hemisphere
from pbrdf.report.dataset.quantities import quantity_label
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.report.fit.subject import Report

__all__ = ["hemisphere_figure"]

#: With fewer points than this out of the plane of incidence there is no hemisphere to show.
_FEWEST = 8
#: As many discs as stand side by side.
_MOST_GROUPS = 4
#: Part of the residuals that the colours span; the others have the colours of the ends.
_SPAN = 0.95
#: Per cent beyond which relative differences of dark points would leave no colour to the others.
_WIDEST = 100.0


def hemisphere_figure(report: Report) -> Figure | None:
    """Model − measured in every viewing direction: of the intensity in per cent, and of the DoLP.

    Parameters
    ----------
    report
        The fit and its data.

    Returns
    -------
    Figure or None
        A disc per group, forward on the right; None where (nearly) all was measured in the plane of incidence.
    """
    points = FittedPoints.from_report(report)
    measured = points.measured
    if (~in_plane(measured)).sum() < _FEWEST:
        return None
    groups = sorted(dict.fromkeys(measured.group), key=_number)
    held = [g for g in groups if points.held_out[measured.group == g].any()][:1]
    others = [g for g in groups if g not in held]
    even = np.linspace(0, len(others) - 1, min(len(others), _MOST_GROUPS - len(held))).round().astype(int)
    shown = sorted({*held, *(others[i] for i in even)}, key=groups.index)
    channels = measured.channels
    title = f"Model − measured, {short_name(report.name, report.dataset)}"
    if len(shown) < len(groups):
        title += f" ({len(shown)} of {len(groups)} groups)"
    with styled():
        from matplotlib.colors import Normalize

        figure = new_figure(2.9 * max(len(shown), 2) + 1.0, 3.2 * len(channels) + 0.5)
        axes = figure.subplots(len(channels), len(shown), squeeze=False, subplot_kw={"projection": "polar"})
        for row, name in zip(axes, channels, strict=True):
            modelled, seen = points.modelled[name], channels[name].measured
            relative = name == "intensity"
            residual = 100.0 * relative_errors(modelled, seen) if relative else modelled - seen
            finite = np.abs(residual[np.isin(measured.group, shown) & np.isfinite(residual)])
            limit = float(np.quantile(finite, _SPAN)) if finite.size and finite.max() > 0.0 else 1.0
            if name == "intensity":
                limit = min(limit, _WIDEST)
            for ax, group in zip(row, shown, strict=True):
                chosen = (measured.group == group) & np.isfinite(residual)
                # the largest residuals on top
                order = np.argsort(np.abs(residual[chosen]))
                drawn = ax.scatter(
                    np.deg2rad(measured.phi[chosen][order]),
                    measured.theta_r[chosen][order],
                    c=residual[chosen][order],
                    s=14.0,
                    norm=Normalize(-limit, limit),
                    cmap="RdBu_r",
                    edgecolors="#777777",
                    linewidths=0.3,
                    rasterized=chosen.sum() > 400,
                )
                dress_hemisphere(ax)
                if ax in axes[0]:
                    apart = " (held out)" if points.held_out[measured.group == group].all() else ""
                    ax.set_title(f"group {group}{apart}", fontsize=9.5)
            label = f"{'DoLP' if name == 'dolp' else quantity_label(name)}: model − measured"
            if name == "intensity":
                label = "intensity: (model − measured)/measured (%)"
            figure.colorbar(drawn, ax=list(row), label=label, shrink=0.8, aspect=14.0, extend="both")
        figure.suptitle(title, fontsize=11.0)
        return figure


def _number(group: str) -> float:
    """Groups that are angles go by their size, others stay in the order of the file."""
    try:
        return float(group)
    except ValueError:
        return 0.0
