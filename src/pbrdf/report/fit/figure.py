"""Figure of a fit: measured points with the model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import predict
from pbrdf.report.dataset.cuts import Cut, in_plane
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import PANEL_SIZE
from pbrdf.report.dataset.shown_cuts import ShownCuts, shown_cuts
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.fit.panels import agreement_panel, difference_panel, fitted_cut_panel
from pbrdf.report.style import GREY, Look, looks_of, panels, styled

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
    group_looks = _group_looks(points, shown)
    channels = points.measured.channels
    figure, axes = panels(
        len(channels), 2 if cuts else 1, PANEL_SIZE, title, _legend(points, shown, group_looks)
    )
    curves = _model_curves(report, cuts) if cuts else {}
    for row, name in enumerate(channels):
        if cuts:
            fitted_cut_panel(axes[row, 0], points, shown, name, curves[name])
        if mostly_in_plane:
            difference_panel(axes[row, -1], points, shown, name)
        else:
            agreement_panel(axes[row, -1], points, group_looks, name)
    if cuts:
        axes[0, 0].set_title(shown.title)
    axes[0, -1].set_title("Model − measured" if mostly_in_plane else f"All {points.held_out.size} geometries")
    return figure


def _group_looks(points: FittedPoints, shown: ShownCuts) -> dict[str, Look]:
    """How to draw each group; it looks like its cut where each has one."""
    groups = list(dict.fromkeys(points.measured.group))
    by_cut = {cut.group: look for cut, look in zip(shown.cuts, shown.looks, strict=True)}
    if len(by_cut) == len(shown.cuts) == len(groups):
        return by_cut
    return dict(zip(groups, looks_of(len(groups)), strict=True))


def _model_curves(report: Report, cuts: list[Cut]) -> dict[str, list[np.ndarray]]:
    """Intensity and DoLP of the fit along each cut, its nuisance terms included, all from one evaluation."""
    theta_i, theta_r, phi = (
        np.concatenate(a) for a in zip(*(cut.path_angles() for cut in cuts), strict=True)
    )
    there = np.isfinite(theta_i)
    # Each cut stands for the group and the wavelength of its first point.
    rows = np.repeat([cut.rows[0] for cut in cuts], [cut.path_x.size for cut in cuts])[there]
    ds = report.dataset
    along = Observations(
        theta_i=theta_i[there],
        theta_r=theta_r[there],
        phi=phi[there],
        channels=(),
        values=np.empty((0, len(rows))),
        std=np.empty((0, len(rows))),
        illumination=tuple(float(x) for x in ds.attrs["illumination"]),  # type: ignore[arg-type]
        std_known=False,
        group=ds["group"].values[rows],
        wavelength=ds["wavelength"].values[rows] if "wavelength" in ds.coords else None,
        scale=1.0 / np.cos(theta_i[there]) if ds.attrs["quantity"] in ("radiance", "dn") else None,
    )
    values = predict(report.result.space, report.result.unknowns, along, ("I", "dolp"))
    ends = np.cumsum([cut.path_x.size for cut in cuts])[:-1]
    curves = {}
    for name, channel in (("intensity", "I"), ("dolp", "dolp")):
        whole = np.full(theta_i.size, np.nan)
        whole[there] = values[channel]
        curves[name] = np.split(whole, ends)
    return curves


def _legend(points: FittedPoints, shown: ShownCuts, group_looks: dict[str, Look]) -> list[Any]:
    """An entry for each cut (or group, without cuts), and what the marks mean."""
    from matplotlib.lines import Line2D

    cuts = shown.cuts
    if cuts:
        entries = [
            (look, shown.label(cut), points.held_out[cut.rows])
            for cut, look in zip(cuts, shown.looks, strict=True)
        ]
    else:
        entries = [
            (look, f"group {g}", points.held_out[points.measured.group == g])
            for g, look in group_looks.items()
        ]
    handles = []
    for look, label, held in entries:
        whole = bool(held.all())
        handles.append(
            Line2D(
                [],
                [],
                color=look.colour,
                marker=look.marker,
                linestyle=("--" if whole else "-") if cuts else "none",
                markerfacecolor="white" if whole else look.colour,
                label=label + (" (held out)" if whole else ""),
            )
        )
    mark: dict[str, Any] = {"color": GREY, "marker": "o", "linestyle": "none"}
    if any(held.any() and not held.all() for *_, held in entries):
        handles.append(Line2D([], [], markerfacecolor="white", label="held out", **mark))
    if points.diffuse is not None and cuts:
        handles.append(
            Line2D(
                [],
                [],
                markerfacecolor="white",
                markeredgewidth=2.0,
                label="white dot: used for the diffuse step",
                **mark,
            )
        )
    if cuts:
        bars = np.isfinite(points.measured.intensity.std).any()
        handles.append(
            Line2D([], [], label="measured ± standard uncertainty" if bars else "measured", **mark)
        )
        handles.append(Line2D([], [], color=GREY, label="model"))
    return handles
