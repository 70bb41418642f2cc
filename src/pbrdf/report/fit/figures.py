"""Figures of measured data and of fits.

Every function returns a :class:`matplotlib.figure.Figure` that belongs to no window;
:func:`save_figure` writes it.
"""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import predict
from pbrdf.report.dataset.cuts import Cut, in_plane, in_plane_cuts
from pbrdf.report.dataset.describe import wavelengths_in_words
from pbrdf.report.dataset.panels import (
    LOGARITHMIC_FROM,
    agreement_panel,
    channel_label,
    cut_panel,
    difference_panel,
    dress_hemisphere,
)
from pbrdf.report.dataset.points import Channel, Points
from pbrdf.report.numbers import brief
from pbrdf.report.style import (
    BLUE,
    DISTINCT_COLOURS,
    GREY,
    RED,
    Look,
    looks_of,
    new_figure,
    panels,
    save_figure,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from pbrdf.report.fit.subject import Report

__all__ = ["data_figure", "fit_figure", "save_figure", "short_name", "starts_figure"]

#: More cuts than this in one panel cannot be told apart.
_MOST_CUTS = 10
#: Share of points in the plane of incidence from which on the others are not drawn.
_MOSTLY = 0.9
# Inches: a panel of points, and a small one of starts
_PANEL, _SMALL_PANEL = (4.5, 2.8), (2.6, 1.9)


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
    points = Points.from_fit(report)
    result = report.result
    title = f"{result.model.name} fitted to {short_name(report.name, report.dataset)}"
    if result.hold_out is not None:
        title += f"; {result.hold_out} held out"
    with styled():
        return _draw(points, title, report)


def data_figure(dataset: xr.Dataset, name: str) -> Figure:
    """Measured points: intensity and degree of linear polarisation against the angle, or over the hemisphere.

    Parameters
    ----------
    dataset
        The data.
    name
        What to call them.
    """
    with styled():
        return _draw(Points.from_dataset(dataset), short_name(name, dataset), None)


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
    title = f"{len(best)} starts of the fit to {short_name(report.name, report.dataset)}"
    with styled():
        from matplotlib.lines import Line2D

        figure, axes = panels(
            math.ceil(len(free) / columns),
            columns,
            _SMALL_PANEL,
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
            ax.set_ylim(estimate.lower, estimate.upper)
            ax.set_xticks([0, 1], ["start", "end"])
            ax.set_xlim(-0.12, 1.12)
        for ax in axes.ravel()[len(free) :]:
            ax.remove()
        return figure


def short_name(name: str, dataset: xr.Dataset) -> str:
    """What to call data in a title: the file's name and the wavelengths."""
    wavelengths = wavelengths_in_words(dataset)
    return Path(name).name + (f", {wavelengths}" if wavelengths.endswith("nm") else "")


def _draw(points: Points, title: str, report: Report | None) -> Figure:
    """The figure of a fit, or, without a report, of the points alone."""
    cuts = in_plane_cuts(points)
    channels = [("intensity", points.intensity)] + (
        [("dolp", points.dolp)] if points.dolp is not None else []
    )
    modelled = report is not None
    if not modelled and not cuts:
        return _hemispheres(points, title, channels)
    mostly_in_plane = bool(cuts) and in_plane(points).mean() > _MOSTLY
    columns = int(bool(cuts)) + int(modelled)
    shown = _spread(cuts, points)
    cut_looks, group_looks = _looks(points, shown)
    handles = _legend(points, shown, cut_looks, group_looks, modelled)
    figure, axes = panels(len(channels), columns, _PANEL, title, handles)
    curves = _model_curves(report, shown) if report is not None and cuts else {}
    for row, (name, channel) in enumerate(channels):
        if cuts:
            cut_panel(axes[row, 0], points, shown, cut_looks, name, channel, curves.get(name))
        if modelled and mostly_in_plane:
            difference_panel(axes[row, -1], points, shown, cut_looks, name, channel)
        elif modelled:
            agreement_panel(axes[row, -1], points, group_looks, name, channel)
    if cuts:
        some = f" ({len(shown)} of {len(cuts)} curves drawn)" if len(shown) < len(cuts) else ""
        axes[0, 0].set_title(f"Plane of incidence{some}")
    if modelled:
        right = "Model − measured" if mostly_in_plane else f"All {points.theta_i.size} geometries"
        axes[0, -1].set_title(right)
    return figure


def _spread(cuts: list[Cut], points: Points) -> list[Cut]:
    """Not more cuts than can be told apart: evenly spread ones, and those with held-out points first."""
    if len(cuts) <= _MOST_CUTS:
        return cuts
    held = [i for i, cut in enumerate(cuts) if points.held_out[cut.rows].any()][: _MOST_CUTS // 2]
    others = [i for i in range(len(cuts)) if i not in held]
    even = np.linspace(0, len(others) - 1, _MOST_CUTS - len(held)).round().astype(int)
    return [cuts[i] for i in sorted({*held, *(others[j] for j in even)})]


def _looks(points: Points, cuts: list[Cut]) -> tuple[list[Look], dict[str, Look]]:
    """How to draw each cut and each group; a group looks like its cut where each has one."""
    of_cuts = looks_of(len(cuts))
    if len(cuts) > DISTINCT_COLOURS:
        # On a ramp of many colours nobody finds what was held out: it leaves the ramp.
        of_cuts = [
            Look(RED, look.marker) if points.held_out[cut.rows].all() else look
            for cut, look in zip(cuts, of_cuts, strict=True)
        ]
    groups = list(dict.fromkeys(points.group))
    by_cut = {cut.group: look for cut, look in zip(cuts, of_cuts, strict=True)}
    if len(by_cut) == len(cuts) == len(groups):
        return of_cuts, by_cut
    return of_cuts, dict(zip(groups, looks_of(len(groups)), strict=True))


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


def _hemispheres(points: Points, title: str, channels: list[tuple[str, Channel]]) -> Figure:
    """Every point over the hemisphere of viewing directions, one disc per group."""
    groups = list(dict.fromkeys(points.group))
    shown = [
        groups[i] for i in np.unique(np.linspace(0, len(groups) - 1, min(len(groups), 4)).round().astype(int))
    ]
    figure = new_figure(3.2 * len(shown) + 1.0, 3.3 * len(channels) + 0.6)
    axes = figure.subplots(len(channels), len(shown), squeeze=False, subplot_kw={"projection": "polar"})
    for row, (name, channel) in enumerate(channels):
        usable = np.isin(points.group, shown) & np.isfinite(channel.measured)
        norm = _colour_norm(name, channel.measured[usable])
        for ax, group in zip(axes[row], shown, strict=True):
            chosen = usable & (points.group == group)
            drawn = ax.scatter(
                np.deg2rad(points.phi[chosen]),
                points.theta_r[chosen],
                c=channel.measured[chosen],
                s=12.0,
                norm=norm,
                cmap="viridis",
            )
            dress_hemisphere(ax)
            if row == 0:
                ax.set_title(f"group {group}")
        figure.colorbar(drawn, ax=list(axes[row]), label=channel_label(name, points), shrink=0.8)
    figure.suptitle(title + (f" ({len(shown)} of {len(groups)} groups)" if len(shown) < len(groups) else ""))
    return figure


def _colour_norm(name: str, values: np.ndarray) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    positive = values[values > 0.0]
    if (
        name == "intensity"
        and positive.size
        and math.log10(positive.max() / positive.min()) > LOGARITHMIC_FROM
    ):
        return LogNorm(positive.min(), positive.max())
    return Normalize(0.0, float(values.max(initial=1e-6)))


def _legend(
    points: Points, cuts: list[Cut], cut_looks: list[Look], group_looks: dict[str, Look], modelled: bool
) -> list[Any]:
    """An entry for each cut (or group, without cuts), and what the marks mean."""
    from matplotlib.lines import Line2D

    if cuts:
        entries = [
            (look, _cut_label(cut, cuts), points.held_out[cut.rows])
            for cut, look in zip(cuts, cut_looks, strict=True)
        ]
    else:
        entries = [
            (look, f"group {g}", points.held_out[points.group == g]) for g, look in group_looks.items()
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
                linestyle=("--" if whole else "-") if modelled and cuts else "none",
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
    if modelled and cuts:
        bars = np.isfinite(points.intensity.std).any()
        handles.append(
            Line2D([], [], label="measured ± standard uncertainty" if bars else "measured", **mark)
        )
        handles.append(Line2D([], [], color=GREY, label="model"))
    return handles


def _cut_label(cut: Cut, cuts: list[Cut]) -> str:
    if cut.kind == "bistatic":
        return f"group {cut.group}: θi + θr = {brief(cut.constant)}°"
    # The source of a goniometer may stand at 0.001°.
    angle = f"{'θi' if cut.kind == 'theta_i' else 'θr'} = {round(cut.constant, 1):g}°"
    groups = {c.group for c in cuts}
    # Readers of hemispherical data call a group by its angle of incidence: once is enough.
    if len(groups) == 1 or cut.group == f"{cut.constant:.0f}":
        return angle
    return f"group {cut.group}: {angle}"
