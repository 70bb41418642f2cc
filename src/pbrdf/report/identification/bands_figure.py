"""Figure of a measurement over what the specimens of each candidate would show.

A band holds the middle 95 % of the specimens that are drawn from a material, at each geometry by itself; where the gain
is not known, each specimen is scaled to the data by the median of their ratios. The line is the specimen that the
measurement makes most likely. Geometries that lie on no few lines of the plane of incidence stand side by side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.identify import Candidate
from pbrdf.identification.material import Material
from pbrdf.identification.predictive import specimens_shown, typical_gains
from pbrdf.inversion.observations import Observations
from pbrdf.report.dataset.cuts import Cut
from pbrdf.report.dataset.panels import VIEWING_ANGLE, channel_label, scale_intensity, scale_signed
from pbrdf.report.dataset.points import Points
from pbrdf.report.dataset.quantities import channels_behind, is_intensity, quantity_of
from pbrdf.report.dataset.shown_cuts import ShownCuts, shown_cuts
from pbrdf.report.identification.subject import (
    Identified,
    nearest_rejected,
    p_value_in_words,
    probability_in_words,
    shown_probability,
)
from pbrdf.report.style import BLUE, GREY, RED, looks_of, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["bands_figure", "shown_candidates"]

#: Specimens drawn, and what part of them a band holds.
SPECIMENS, PART = 400, 0.95
#: Candidates of the set that are drawn, the nearest rejected one comes beside them; cuts in one panel; quantities.
_MOST_ACCEPTED, _MOST_CUTS, _MOST_QUANTITIES = 3, 3, 3
_PANEL = (3.6, 2.5)


def shown_candidates(report: Identified) -> list[Candidate]:
    """The most probable of the set, and the nearest of those outside."""
    found = report.found
    accepted = [candidate for candidate in found.candidates if candidate.accepted][:_MOST_ACCEPTED]
    nearest = nearest_rejected(found)
    return [*accepted, *([] if nearest is None else [nearest])]


def bands_figure(report: Identified) -> Figure:
    """The measurement over the band of each shown candidate: a column a candidate, a row a quantity."""
    assert report.dataset is not None  # of fitted parameters there is another figure
    points = Points.from_dataset(report.dataset)
    whole = shown_cuts(points)
    cuts = _few(whole.cuts)
    looks = looks_of(len(cuts))
    candidates = shown_candidates(report)
    names = list(points.channels)[:_MOST_QUANTITIES]
    drawn = np.concatenate([cut.rows for cut in cuts]) if cuts else np.arange(points.theta_i.size)
    at = _along(report, cuts)
    with styled():
        handles = _handles(ShownCuts(cuts, looks, whole.found), report)
        figure, axes = panels(len(names), len(candidates), _PANEL, report.title, handles)
        shared: dict[str, tuple[float, float]] = {}
        for column, candidate in enumerate(candidates):
            bands = _bands(report, candidate, at, names)
            for row, name in enumerate(names):
                ax = axes[row, column]
                channel = points.channels[name]
                if cuts:
                    begin = 0
                    for cut, look in zip(cuts, looks, strict=True):
                        there = np.isfinite(cut.path_x)
                        part = slice(begin, begin + int(there.sum()))
                        begin = part.stop
                        low, high, line = (_with_gaps(values[part], there) for values in bands[name])
                        ax.fill_between(cut.path_x, low, high, color=look.colour, alpha=0.25, linewidth=0)
                        ax.plot(
                            cut.path_x, line, color=look.colour, linewidth=1.1, label="most likely specimen"
                        )
                        _measured(ax, cut.x, channel.measured[cut.rows], channel.std[cut.rows], look)
                    over = cuts[0].over_incidence
                    ax.set_xlabel("angle of incidence θi (°)" if over else VIEWING_ANGLE, fontsize=8.5)
                else:
                    _side_by_side(ax, bands[name], channel.measured, channel.std)
                _scale(ax, name, channel.measured[drawn], shared)
                ax.set_ylabel(channel_label(name, points) if column == 0 else "")
            state = "in the set" if candidate.accepted else "not in the set"
            probability = probability_in_words(shown_probability(report.found, candidate))
            axes[0, column].set_title(
                f"{candidate.name}: {state}\nprobability {probability}, "
                f"p-value {p_value_in_words(candidate.p_value)}",
                fontsize=9.0,
                color="black" if candidate.accepted else RED,
            )
    return figure


def _few(cuts: list[Cut]) -> list[Cut]:
    """Cuts that can be told apart though each has a band, spread evenly."""
    if len(cuts) <= _MOST_CUTS:
        return cuts
    return [cuts[i] for i in np.linspace(0, len(cuts) - 1, _MOST_CUTS).round().astype(int)]


def _along(report: Identified, cuts: list[Cut]) -> Observations:
    """Geometries at which specimens are shown: along the cuts, or the measured ones."""
    data = report.found.data
    assert data is not None
    theta_i, theta_r, phi = data.theta_i, data.theta_r, data.phi
    if cuts:
        theta_i, theta_r, phi = (
            np.concatenate(a) for a in zip(*(cut.path_angles() for cut in cuts), strict=True)
        )
        there = np.isfinite(theta_i)
        theta_i, theta_r, phi = theta_i[there], theta_r[there], phi[there]
    nothing = np.empty((0, len(theta_i)))
    return Observations(theta_i, theta_r, phi, (), nothing, nothing, data.illumination, False)


def _bands(
    report: Identified, candidate: Candidate, at: Observations, names: list[str]
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Lower and upper end of the band and the most likely specimen, by quantity."""
    material = report.found.library[candidate.name]
    drawn = material.draw(SPECIMENS, np.random.default_rng(0))
    likely = np.array([[candidate.values[name] for name in material.space.names]])
    parameters = np.concatenate([likely, drawn])
    shown = _quantities(material, parameters, at, names)
    if report.found.gain and (data := report.found.data) is not None:
        gains = typical_gains(material, parameters, data)
        shown = {n: v * gains[:, None] if is_intensity(n) else v for n, v in shown.items()}
    ends = 0.5 * (1.0 - PART), 0.5 * (1.0 + PART)
    return {n: (*np.quantile(v[1:], ends, axis=0), v[0]) for n, v in shown.items()}


def _quantities(
    material: Material, parameters: np.ndarray, at: Observations, names: list[str]
) -> dict[str, np.ndarray]:
    channels = tuple(dict.fromkeys(channel for name in names for channel in channels_behind(name)))
    values = specimens_shown(material, parameters, at, channels)
    flat = {channel: array.ravel() for channel, array in values.items()}
    shape = (len(parameters), len(at.theta_i))
    return {name: quantity_of(name, flat).reshape(shape) for name in names}


def _with_gaps(values: np.ndarray, there: np.ndarray) -> np.ndarray:
    whole = np.full(there.shape, np.nan)
    whole[there] = values
    return whole


def _measured(ax: Axes, x: np.ndarray, measured: np.ndarray, std: np.ndarray, look: Any) -> None:
    ax.errorbar(
        x, measured, yerr=std if np.isfinite(std).any() else None, fmt=look.marker, color=look.colour,
        markeredgecolor="black", markeredgewidth=0.4, markersize=4.0, elinewidth=0.9, label="measured", zorder=4,
    )  # fmt: skip


def _side_by_side(ax: Axes, band: tuple[np.ndarray, ...], measured: np.ndarray, std: np.ndarray) -> None:
    """Geometries in their order, each with its band as a bar."""
    low, high, line = band
    place = np.arange(1, measured.size + 1)
    ax.bar(place, high - low, 0.7, bottom=low, color=BLUE, alpha=0.25, linewidth=0)
    ax.plot(place, line, "_", color=BLUE, markersize=9.0, markeredgewidth=1.4, label="most likely specimen")
    ax.errorbar(
        place, measured, yerr=std if np.isfinite(std).any() else None, fmt="o", color="black", markersize=4.0,
        elinewidth=0.9, label="measured", zorder=4,
    )  # fmt: skip
    ax.locator_params(axis="x", integer=True)
    ax.set_xlim(0.4, measured.size + 0.6)
    ax.set_xlabel("number of the geometry", fontsize=8.5)


def _scale(ax: Axes, name: str, measured: np.ndarray, shared: dict[str, tuple[float, float]]) -> None:
    """All candidates on the scale of the measurement: a band far off must not press it into a corner."""
    finite = measured[np.isfinite(measured)]
    if not finite.size:
        return
    if name not in shared:
        if is_intensity(name):
            scale_intensity(ax, measured)
            positive = finite[finite > 0.0]
            if ax.get_yscale() == "log" and positive.size:
                # what lies below a limit that is set has been counted as not shown
                lowest = 0.4 * float(positive.min()) if ax.get_autoscaley_on() else ax.get_ylim()[0]
                shared[name] = (lowest, 2.5 * float(positive.max()))
            else:
                shared[name] = (min(0.0, 1.1 * float(finite.min())), 1.35 * float(finite.max()))
        elif name == "dolp":
            shared[name] = (0.0, min(max(1.4 * float(finite.max()), 0.02), 1.05))
        else:
            scale_signed(ax, name)
            shared[name] = ax.get_ylim()
    elif is_intensity(name):
        scale_intensity(ax, measured)
    ax.set_ylim(*shared[name])


def _handles(shown: ShownCuts, report: Identified) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=look.colour, marker=look.marker, linestyle="none", label=shown.label(cut))
        for cut, look in zip(shown.cuts, shown.looks, strict=True)
    ]
    colour = GREY if shown.cuts else BLUE
    best = " (scaled to the data)" if report.found.gain else ""
    some = f", {len(shown.cuts)} of {shown.found} curves" if len(shown.cuts) < shown.found else ""
    handles.append(
        Line2D([], [], color="black", marker="o", linestyle="none", label=f"points: measured{some}")
    )
    handles.append(Patch(color=colour, alpha=0.3, linewidth=0, label=f"95 % of specimens{best}"))
    handles.append(Line2D([], [], color=colour, label="most likely specimen"))
    return handles
