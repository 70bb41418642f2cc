"""Figures of measured data and of fits.

Every function returns a :class:`matplotlib.figure.Figure` that belongs to no window; :func:`save_figure` writes
it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.cuts import Cut, in_plane, in_plane_cuts
from pbrdf.report.points import Channel, Points
from pbrdf.report.style import BLUE, GREY, MARKERS, RED, colours, new_figure, save_figure, styled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.models import Model
    from pbrdf.report.subject import Report

__all__ = ["data_figure", "fit_figure", "save_figure", "starts_figure"]

#: Decades from which on an intensity is drawn on a logarithmic axis.
_LOGARITHMIC_FROM = 1.5
#: More cuts than this in one panel cannot be told apart.
_MOST_CUTS = 10
#: With more points than this the markers are small and see-through.
_MANY_POINTS = 300

_PANEL_WIDTH, _PANEL_HEIGHT, _MARGIN = 5.4, 3.5, 0.9


def fit_figure(report: Report) -> Figure:
    """Measured points with the fitted model, and how far they are from each other.

    On the left the cuts through the plane of incidence: intensity and, where it was measured, degree of linear
    polarisation against the angle, points with error bars, the model as lines, held-out data with open markers
    and broken lines. On the right the differences, or, where much was measured out of that plane, all measured
    values against the modelled ones.

    Parameters
    ----------
    report
        The fit and its data.
    """
    points = Points.from_fit(report)
    result = report.result
    title = f"{result.model.name} fitted to {report.name}"
    if result.hold_out is not None:
        title += f", {result.hold_out} held out"
    illumination = (
        (1.0, 0.0, 0.0, 0.0) if "mueller" in report.dataset else report.dataset.attrs["illumination"]
    )
    with styled():
        return _draw(points, title, result.model, illumination)


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
        return _draw(Points.from_dataset(dataset), name, None, None)


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
    rows = math.ceil(len(free) / columns)
    with styled():
        figure = new_figure(3.4 * columns, 2.7 * rows + _MARGIN)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for i, (estimate, ax) in enumerate(zip(free, axes, strict=False)):
            begin, end = result.start_values[:, i], result.end_values[:, i]
            for chosen, style in (
                (~best, {"color": RED, "alpha": 0.45, "linestyle": "--"}),
                (best, {"color": BLUE, "alpha": 0.6, "linestyle": "-"}),
            ):
                ax.plot(
                    [0, 1], [begin[chosen], end[chosen]], linewidth=0.8, marker="o", markersize=2.5, **style
                )
            p = estimate.parameter
            ax.set_title(f"{p.symbol}: {p.description}", fontsize=8.5, wrap=True)
            ax.set_ylabel(p.symbol + ("" if p.unit == "1" else f" ({p.unit})"))
            if p.logarithmic:
                ax.set_yscale("log")
            ax.set_ylim(estimate.lower, estimate.upper)
            ax.margins(y=0.03)
            ax.set_xticks([0, 1], ["start", "end"])
            ax.set_xlim(-0.12, 1.12)
        for ax in axes[len(free) :]:
            ax.remove()
        from matplotlib.lines import Line2D

        handles = [
            Line2D([], [], color=BLUE, marker="o", label=f"reached the best optimum ({best.sum()})"),
            Line2D([], [], color=RED, marker="o", linestyle="--", label=f"ended elsewhere ({(~best).sum()})"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
        figure.suptitle(f"{len(best)} starts of the fit to {report.name}")
        return figure


def _draw(points: Points, title: str, model: Model | None, illumination: Any) -> Figure:
    cuts = in_plane_cuts(points)
    channels = [("intensity", points.intensity)] + (
        [("dolp", points.dolp)] if points.dolp is not None else []
    )
    if model is None and not cuts:
        return _hemispheres(points, title, channels)
    mostly_in_plane = bool(cuts) and in_plane(points).mean() > 0.9
    columns = (1 if cuts else 0) + (1 if model is not None else 0)
    shown = _spread(cuts, points)
    figure = new_figure(_PANEL_WIDTH * max(columns, 1) + 0.2, _PANEL_HEIGHT * len(channels) + _MARGIN)
    axes = figure.subplots(len(channels), max(columns, 1), squeeze=False)
    colour_of = _colours_of_groups(points, shown)
    curves = _model_curves(model, shown, illumination) if model is not None else {}
    for row, (name, channel) in enumerate(channels):
        if cuts:
            _cut_panel(axes[row, 0], points, shown, name, channel, curves.get(name), colour_of)
        if model is None:
            continue
        if mostly_in_plane:
            _difference_panel(axes[row, -1], points, shown, name, channel, colour_of)
        else:
            _agreement_panel(axes[row, -1], points, name, channel, colour_of)
    if cuts:
        left = "Plane of incidence"
        if len(shown) < len(cuts):
            left += f" ({len(shown)} of {len(cuts)} curves drawn)"
        axes[0, 0].set_title(left)
    if model is not None:
        axes[0, -1].set_title(
            "Model − measured" if mostly_in_plane else f"All {points.theta_i.size} geometries"
        )
    handles = _legend_handles(points, shown, model is not None, colour_of)
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), frameon=False)
    figure.suptitle(title)
    return figure


def _spread(cuts: list[Cut], points: Points) -> list[Cut]:
    """Not more cuts than can be told apart: evenly spread ones, and those with held-out points first."""
    if len(cuts) <= _MOST_CUTS:
        return cuts
    held = [i for i, cut in enumerate(cuts) if points.held_out[cut.rows].any()][: _MOST_CUTS // 2]
    others = [i for i in range(len(cuts)) if i not in held]
    even = np.linspace(0, len(others) - 1, _MOST_CUTS - len(held)).round().astype(int)
    return [cuts[i] for i in sorted({*held, *(others[j] for j in even)})]


def _colours_of_groups(points: Points, cuts: list[Cut]) -> dict[Any, tuple[str, str]]:
    """Colour and marker by cut and by group; a group has the colour of its only cut."""
    keys = [(cut.group, cut.constant) for cut in cuts] if cuts else []
    groups = list(dict.fromkeys(points.group))
    table: dict[Any, tuple[str, str]] = {}
    for i, (key, colour) in enumerate(zip(keys, colours(max(len(keys), 1)), strict=False)):
        table[key] = (colour, MARKERS[i % len(MARKERS)])
    one_cut_each = len({key[0] for key in keys}) == len(keys) == len(groups)
    for i, (group, colour) in enumerate(zip(groups, colours(len(groups)), strict=True)):
        own = next((table[key] for key in keys if key[0] == group), None) if one_cut_each else None
        table[group] = own or (colour, MARKERS[i % len(MARKERS)])
    return table


def _model_curves(model: Model, cuts: list[Cut], illumination: Any) -> dict[str, list[np.ndarray]]:
    """Intensity and DoLP of the model along each cut, all from one evaluation."""
    if not cuts:
        return {}
    theta_i, theta_r, phi = (
        np.concatenate(a) for a in zip(*(cut.path_angles() for cut in cuts), strict=True)
    )
    there = np.isfinite(theta_i) & np.isfinite(theta_r)
    stokes = np.full((theta_i.size, 4), np.nan)
    stokes[there] = model.stokes(theta_i[there], theta_r[there], phi[there], incident=tuple(illumination))
    ends = np.cumsum([cut.path_x.size for cut in cuts])[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        dolp = np.hypot(stokes[:, 1], stokes[:, 2]) / stokes[:, 0]
    return {"intensity": np.split(stokes[:, 0], ends), "dolp": np.split(dolp, ends)}


def _cut_panel(
    ax: Axes,
    points: Points,
    cuts: list[Cut],
    name: str,
    channel: Channel,
    curves: list[np.ndarray] | None,
    colour_of: dict[Any, tuple[str, str]],
) -> None:
    """One channel against the angle: points with error bars, the model as lines."""
    rows = np.concatenate([cut.rows for cut in cuts])
    if name == "intensity":
        _scale_intensity(ax, channel.measured[rows])
    for i, cut in enumerate(cuts):
        colour, marker = colour_of[(cut.group, cut.constant)]
        held = points.held_out[cut.rows]
        if curves is not None:
            ax.plot(cut.path_x, curves[i], color=colour, linestyle="--" if held.all() else "-", zorder=2)
        for chosen, filled in ((~held, True), (held, False)):
            _points(ax, cut.x[chosen], channel, cut.rows[chosen], colour, marker, filled)
    _label_angle(ax, cuts[0].kind)
    ax.set_ylabel(_label(name, points))
    if name == "dolp":
        _limit_dolp(ax, channel.measured[rows])


def _points(
    ax: Axes, x: np.ndarray, channel: Channel, rows: np.ndarray, colour: str, marker: str, filled: bool
) -> None:
    if not rows.size:
        return
    std = channel.std[rows]
    ax.errorbar(
        x,
        channel.measured[rows],
        yerr=std if np.isfinite(std).any() else None,
        fmt=marker,
        color=colour,
        markerfacecolor=colour if filled else "white",
        markeredgecolor=colour,
        elinewidth=0.8,
        label="measured" if filled else "held out",
        zorder=3,
    )


def _difference_panel(
    ax: Axes,
    points: Points,
    cuts: list[Cut],
    name: str,
    channel: Channel,
    colour_of: dict[Any, tuple[str, str]],
) -> None:
    """Model − measured against the angle, relative for the intensity."""
    differences = channel.modelled - channel.measured
    if name == "intensity":
        positive = channel.measured > 0.0
        differences = np.where(
            positive, 100.0 * differences / np.where(positive, channel.measured, 1.0), np.nan
        )
    ax.axhline(0.0, color="black", linewidth=0.8, zorder=1)
    for cut in cuts:
        colour, marker = colour_of[(cut.group, cut.constant)]
        held = points.held_out[cut.rows]
        for chosen, filled in ((~held, True), (held, False)):
            ax.plot(
                cut.x[chosen],
                differences[cut.rows[chosen]],
                marker,
                color=colour,
                markerfacecolor=colour if filled else "white",
                label="measured" if filled else "held out",
            )
    _limit_differences(ax, differences[np.concatenate([cut.rows for cut in cuts])])
    _label_angle(ax, cuts[0].kind)
    ax.set_ylabel("relative difference of intensity (%)" if name == "intensity" else "difference of DoLP")


def _agreement_panel(
    ax: Axes, points: Points, name: str, channel: Channel, colour_of: dict[Any, tuple[str, str]]
) -> None:
    """Modelled against measured values of all points, with the line of equality."""
    many = points.theta_i.size > _MANY_POINTS
    size = {"markersize": 3.0 if many else 4.5, "alpha": 0.6 if many else 1.0, "markeredgewidth": 0.7}
    usable = np.isfinite(channel.measured) & np.isfinite(channel.modelled)
    if name == "intensity":
        _scale_intensity(ax, channel.measured[usable], channel.modelled[usable], both=True)
        usable &= channel.measured > 0.0
    for filled in (True, False):  # the few that were held out are drawn over the many that were not
        for group in dict.fromkeys(points.group):
            colour, marker = colour_of[group]
            chosen = usable & (points.group == group) & (points.held_out != filled)
            ax.plot(
                channel.measured[chosen],
                channel.modelled[chosen],
                marker,
                color=colour,
                markerfacecolor=colour if filled else "white",
                label="measured" if filled else "held out",
                **size,
            )
    values = np.concatenate([channel.measured[usable], channel.modelled[usable]])
    ends = np.array([values.min(), values.max()]) if values.size else np.array([0.0, 1.0])
    ax.plot(ends, ends, color="black", linewidth=0.9, zorder=4, label="equal")
    if name == "intensity":
        for factor in (0.8, 1.25):
            ax.plot(ends, factor * ends, color=GREY, linewidth=0.8, linestyle=":", zorder=4, label="± 25 %")
        ax.annotate("dotted: 25 % apart", (0.97, 0.04), xycoords="axes fraction", ha="right", fontsize=8.5)
    label = _label(name, points)
    ax.set_xlabel(f"measured {label}")
    ax.set_ylabel(f"modelled {label}")


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
        figure.colorbar(drawn, ax=list(axes[row]), label=_label(name, points), shrink=0.8)
    figure.suptitle(title + (f" ({len(shown)} of {len(groups)} groups)" if len(shown) < len(groups) else ""))
    return figure


def dress_hemisphere(ax: Any) -> None:
    """Label a polar plot of viewing directions: θ_r outwards, forward on the right."""
    ax.set_ylim(0.0, 90.0)
    ax.set_yticks([30.0, 60.0], ["30°", "60°"], fontsize=7.5)
    ax.set_xticks(np.deg2rad([0.0, 90.0, 180.0, 270.0]), ["forward", "90°", "back", "−90°"], fontsize=8.5)
    ax.grid(color="white", linewidth=0.5, alpha=0.7)


def _colour_norm(name: str, values: np.ndarray) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    positive = values[values > 0.0]
    if (
        name == "intensity"
        and positive.size
        and math.log10(positive.max() / positive.min()) > _LOGARITHMIC_FROM
    ):
        return LogNorm(positive.min(), positive.max())
    return Normalize(0.0, float(values.max(initial=1e-6)))


def _legend_handles(
    points: Points, cuts: list[Cut], modelled: bool, colour_of: dict[Any, tuple[str, str]]
) -> list[Any]:
    from matplotlib.lines import Line2D

    handles = []
    if cuts:
        entries = [
            (colour_of[(c.group, c.constant)], _cut_label(c, cuts), points.held_out[c.rows]) for c in cuts
        ]
    else:
        groups = dict.fromkeys(points.group)
        entries = [(colour_of[g], f"group {g}", points.held_out[points.group == g]) for g in groups]
    for (colour, marker), label, held in entries:
        whole = bool(held.all())
        handles.append(
            Line2D(
                [],
                [],
                color=colour,
                marker=marker,
                linestyle=("--" if whole else "-") if modelled and cuts else "none",
                markerfacecolor="white" if whole else colour,
                label=label + (" (held out)" if whole else ""),
            )
        )
    if any(held.any() and not held.all() for *_, held in entries):
        handles.append(
            Line2D(
                [], [], color=GREY, marker="o", linestyle="none", markerfacecolor="white", label="held out"
            )
        )
    if modelled and cuts:
        handles.append(Line2D([], [], color=GREY, marker="o", linestyle="none", label="measured"))
        handles.append(Line2D([], [], color=GREY, label="model"))
    return handles


def _cut_label(cut: Cut, cuts: list[Cut]) -> str:
    if cut.kind == "bistatic":
        return f"group {cut.group}: θi + θr = {cut.constant:.4g}°"
    angle = f"θi = {cut.constant:.3g}°" if cut.kind == "theta_i" else f"θr = {cut.constant:.3g}°"
    groups = {c.group for c in cuts}
    # Readers of hemispherical data call a group by its angle of incidence: once is enough.
    if len(groups) == 1 or cut.group == f"{cut.constant:.0f}":
        return angle
    return f"group {cut.group}: {angle}"


def _label_angle(ax: Axes, kind: str) -> None:
    if kind == "theta_r":
        ax.set_xlabel("angle of incidence θi (°)")
    else:
        ax.set_xlabel("viewing angle θr (°), negative on the source's side")


def _label(name: str, points: Points) -> str:
    if name == "dolp":
        return "degree of linear polarisation"
    return "intensity (arbitrary scale)" if points.arbitrary_scale else "intensity (1/sr)"


def _scale_intensity(ax: Axes, *values: np.ndarray, both: bool = False) -> None:
    """A logarithmic axis if the positive values span decades; what it cannot show is counted in the panel."""
    together = np.concatenate(values)
    positive = together[together > 0.0]
    if not positive.size or math.log10(positive.max() / positive.min()) <= _LOGARITHMIC_FROM:
        if not both and positive.size == together[np.isfinite(together)].size:
            ax.set_ylim(bottom=0.0)
        return
    ax.set_yscale("log", nonpositive="clip")
    if both:
        ax.set_xscale("log", nonpositive="clip")
    lost = int((values[0] <= 0.0).sum())
    if lost:
        ax.annotate(
            f"{lost} measured value{'s' if lost > 1 else ''} ≤ 0 not shown",
            (0.03, 0.04),
            xycoords="axes fraction",
            fontsize=8.5,
        )


def _limit_dolp(ax: Axes, measured: np.ndarray) -> None:
    """From 0; not beyond what was measured because of a few wild values."""
    finite = measured[np.isfinite(measured)]
    ax.set_ylim(0.0, None)
    if finite.size and ax.get_ylim()[1] > 1.05:
        ax.set_ylim(0.0, 1.05)


def _limit_differences(ax: Axes, differences: np.ndarray) -> None:
    """Symmetric about 0; if a few values are far out, without them, and says so."""
    size = np.abs(differences[np.isfinite(differences)])
    if not size.size or size.max() == 0.0:
        return
    usual = float(np.quantile(size, 0.95)) * 1.5
    limit = 1.1 * float(size.max()) if size.max() <= 2.0 * usual else usual
    ax.set_ylim(-limit, limit)
    beyond = int((size > limit).sum())
    if beyond:
        ax.annotate(
            f"{beyond} value{'s' if beyond > 1 else ''} beyond the axis, up to {size.max():.3g}",
            (0.03, 0.04),
            xycoords="axes fraction",
            fontsize=8.5,
        )
