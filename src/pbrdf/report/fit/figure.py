"""Figure of a fit: measured points with the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbrdf.report.dataset.cuts import in_plane
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import PANEL_SIZE
from pbrdf.report.dataset.shown_cuts import shown_cuts
from pbrdf.report.fit.curves import group_looks, legend_handles, model_curves
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.fit.panels import agreement_panel, difference_panel, fitted_cut_panel
from pbrdf.report.style import panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.report.fit.subject import Report

__all__ = ["fit_figure"]

#: Share of points in the plane of incidence from which on the others are not drawn.
_MOSTLY = 0.9


def fit_figure(report: Report) -> Figure:
    """Measured points with the fitted model, and how far they are from each other.

    On the left the cuts through the plane of incidence: intensity and, where it was measured, degree of
    linear polarisation against the angle; points with error bars where their uncertainty is known, the model
    as lines, held-out data with open markers and broken lines. On the right the differences, or, where much
    was measured out of that plane, all measured values against the modelled ones.

    Parameters
    ----------
    report
        The fit and its data.
    """
    result = report.result
    title = f"{result.model.name} fitted to {short_name(report.name, report.dataset)}"
    if result.hold_out is not None:
        title += f"; {result.hold_out} held out"
    with styled():
        return _draw(FittedPoints.from_report(report), title, report)


def _draw(points: FittedPoints, title: str, report: Report) -> Figure:
    shown = shown_cuts(points.measured, points.held_out)
    cuts = shown.cuts
    mostly_in_plane = bool(cuts) and in_plane(points.measured).mean() > _MOSTLY
    looks = group_looks(points, shown)
    channels = points.measured.channels
    figure, axes = panels(
        len(channels), 2 if cuts else 1, PANEL_SIZE, title, legend_handles(points, shown, looks)
    )
    curves = model_curves(report, cuts, list(channels)) if cuts else {}
    for row, name in enumerate(channels):
        if cuts:
            fitted_cut_panel(axes[row, 0], points, shown, name, curves[name])
        if mostly_in_plane:
            difference_panel(axes[row, -1], points, shown, name)
        else:
            agreement_panel(axes[row, -1], points, looks, name)
    if cuts:
        axes[0, 0].set_title(shown.title)
    axes[0, -1].set_title("Model − measured" if mostly_in_plane else f"All {points.held_out.size} geometries")
    return figure
