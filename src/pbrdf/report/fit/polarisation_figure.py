"""Figure of a fit's polarised light: Q/I, U/I, V/I and the angle of polarisation, or every measured Mueller element."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import PANEL_SIZE
from pbrdf.report.dataset.quantities import is_element
from pbrdf.report.dataset.shown_cuts import shown_cuts
from pbrdf.report.fit.curves import group_looks, legend_handles, model_curves
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.fit.panels import agreement_panel, fitted_cut_panel
from pbrdf.report.style import panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.report.fit.subject import Report

__all__ = ["polarisation_figure"]

#: Width and height of the panel of a Mueller element, inches: four stand in a row.
_ELEMENT_SIZE = (2.1, 1.7)


def polarisation_figure(report: Report) -> Figure | None:
    """Every measured quantity of polarised light with the model, a panel each.

    Stokes vectors give Q/I, U/I, V/I and the angle of linear polarisation, in two columns; Mueller matrices their
    elements, divided by m00, in the places that they have in the matrix. Against the angle in the plane of incidence,
    or, where the data lie on no few lines there, modelled against measured values.

    Parameters
    ----------
    report
        The fit and its data.

    Returns
    -------
    Figure or None
        None where no more than intensity and DoLP was fitted.
    """
    points = FittedPoints.from_report(report)
    names = list(points.measured.polarised)
    if not names:
        return None
    elements = is_element(names[0])
    shown = shown_cuts(points.measured, points.held_out)
    looks = group_looks(points, shown)
    curves = model_curves(report, shown.cuts, names) if shown.cuts else {}
    title = f"{report.result.model.name} fitted to {short_name(report.name, report.dataset)}: polarised light"
    with styled():
        rows, columns = (4, 4) if elements else (math.ceil(len(names) / 2), min(len(names), 2))
        size = _ELEMENT_SIZE if elements else PANEL_SIZE
        figure, axes = panels(rows, columns, size, title, legend_handles(points, shown, looks))
        for i, ax in enumerate(axes.ravel()):
            name = f"m{i // 4}{i % 4}" if elements else (names[i] if i < len(names) else "")
            if name not in points.measured.polarised:
                ax.remove()
                continue
            if shown.cuts:
                fitted_cut_panel(ax, points, shown, name, curves[name])
            else:
                agreement_panel(ax, points, looks, name)
            if elements:
                ax.set_title(ax.get_ylabel().removeprefix("modelled "), fontsize=9.0)
                ax.set_ylabel("")
                angle = "θi (°)" if shown.cuts and shown.cuts[0].over_incidence else "θr (°)"
                ax.set_xlabel(angle if shown.cuts and i >= 12 else "")
        return figure
