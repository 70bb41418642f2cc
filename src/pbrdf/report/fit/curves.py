"""Curves of a fitted model along cuts through the plane of incidence, and what a legend says of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.comparison import compared_channels
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import predict
from pbrdf.report.dataset.cuts import Cut
from pbrdf.report.dataset.quantities import channels_behind, quantity_of
from pbrdf.report.dataset.shown_cuts import ShownCuts
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.style import GREY, Look, looks_of

if TYPE_CHECKING:
    from pbrdf.report.fit.subject import Report

__all__ = ["group_looks", "legend_handles", "model_curves"]


def group_looks(points: FittedPoints, shown: ShownCuts) -> dict[str, Look]:
    """How to draw each group; it looks like its cut where each has one."""
    groups = list(dict.fromkeys(points.measured.group))
    by_cut = {cut.group: look for cut, look in zip(shown.cuts, shown.looks, strict=True)}
    if len(by_cut) == len(shown.cuts) == len(groups):
        return by_cut
    return dict(zip(groups, looks_of(len(groups)), strict=True))


def model_curves(report: Report, cuts: list[Cut], names: Sequence[str]) -> dict[str, list[np.ndarray]]:
    """Quantities of the fit along each cut, its nuisance terms included, all from one evaluation.

    Parameters
    ----------
    report
        The fit and its data.
    cuts
        Where to evaluate it.
    names
        ``"intensity"``, ``"dolp"``, or as of :func:`pbrdf.report.dataset.quantities.polarised_quantities`.

    Returns
    -------
    dict
        By name, a curve along the path of each cut.
    """
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
    # those that were compared come first, as then: the kernel of that evaluation stands already, and serves all figures
    needed = [column for name in names for column in channels_behind(name)]
    if "dolp" in needed:
        needed = [*(column for column in needed if column != "dolp"), *"IQU"]
    columns = tuple(dict.fromkeys((*compared_channels(report.result.data.channels), *needed)))
    values = predict(report.result.space, report.result.unknowns, along, columns)
    if "dolp" in names:
        with np.errstate(divide="ignore", invalid="ignore"):
            values["dolp"] = np.hypot(values["Q"], values["U"]) / values["I"]
    ends = np.cumsum([cut.path_x.size for cut in cuts])[:-1]
    curves = {}
    for name in names:
        whole = np.full(theta_i.size, np.nan)
        whole[there] = quantity_of(name, values)
        curves[name] = np.split(whole, ends)
    return curves


def legend_handles(points: FittedPoints, shown: ShownCuts, looks: dict[str, Look]) -> list[Any]:
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
            (look, f"group {g}", points.held_out[points.measured.group == g]) for g, look in looks.items()
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
        bars = any(np.isfinite(channel.std).any() for channel in points.measured.channels.values())
        handles.append(
            Line2D([], [], label="measured ± standard uncertainty" if bars else "measured", **mark)
        )
        handles.append(Line2D([], [], color=GREY, label="model"))
    return handles
