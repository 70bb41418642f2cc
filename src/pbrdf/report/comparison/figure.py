"""Figures of a comparison: every model's curve over the measurements, and the ranking with its uncertainties."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.model_comparison import Contender
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import predict
from pbrdf.report.comparison.subject import Compared
from pbrdf.report.dataset.cuts import Cut, in_plane_cuts
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import (
    PANEL_SIZE,
    VIEWING_ANGLE,
    channel_label,
    scale_intensity,
    scale_signed,
)
from pbrdf.report.dataset.points import Points
from pbrdf.report.dataset.quantities import channels_behind, polarised_quantities, quantity_of
from pbrdf.report.dataset.shown_cuts import ShownCuts
from pbrdf.report.style import BLUE, GREY, looks_of, new_figure, panels, styled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["curves_figure", "ranking_figure"]

#: So many models have a colour of their own; the others are drawn in grey below them.
_IN_COLOUR = 6
#: Cuts that are drawn, each in a column of its own: those held out first.
_COLUMNS = 3
_PALE = "#B8B8B8"
#: An axis of the ranking reaches to this many times the best error; what is worse ends in an arrow.
_WORST = 12.0


def curves_figure(report: Compared) -> Figure:
    """Every model's curve over what was measured in the plane of incidence, or else predicted against measured values.

    A column for each of at most three angles of incidence (or positions of camera), those that were held out first; a
    row for the intensity and one for the degree of linear polarisation where that was measured.

    Parameters
    ----------
    report
        The comparison and its data.
    """
    comparison = report.comparison
    points = Points.from_dataset(comparison.dataset)
    cuts = _chosen(in_plane_cuts(points), comparison.held_out)
    title = (
        f"{len(comparison.ranking)} models on {short_name(report.name, comparison.dataset)}; {comparison.by}"
    )
    names = list(points.channels)
    with styled():
        handles = _handles(comparison.ranking, bool(cuts))
        figure, axes = panels(len(names), max(len(cuts), 1), PANEL_SIZE, title, handles)
        if not cuts:
            for row, name in enumerate(names):
                _agreement(axes[row, 0], report, points, name)
            return figure
        curves = [_along(c, comparison.dataset, cuts, names) for c in comparison.ranking]
        for column, cut in enumerate(cuts):
            held = comparison.held_out[cut.rows]
            for row, name in enumerate(names):
                ax = axes[row, column]
                _measured(ax, points, cut, name, held)
                _models(ax, cut, [c[name][column] for c in curves])
                _limits(ax, points.channels[name].measured[cut.rows], name)
                ax.set_ylabel(channel_label(name, points) if column == 0 else "")
                ax.set_xlabel("angle of incidence θi (°)" if cut.over_incidence else VIEWING_ANGLE)
            alone = comparison.held_out.sum() < comparison.held_out.size and held.all()
            label = ShownCuts(cuts, looks_of(len(cuts)), len(cuts)).label(cut)
            axes[0, column].set_title(label + (" (held out)" if alone else ""))
    return figure


def ranking_figure(report: Compared) -> Figure:
    """Held-out error of every model with its standard uncertainty, the best at the top.

    Filled marks are models that cannot be told apart from the best.
    """
    ranking = report.comparison.ranking
    limit = _WORST * max(ranking[0].score, 1e-12)
    with styled():
        figure = new_figure(9.0, 1.3 + 0.27 * len(ranking))
        ax = figure.add_subplot()
        for place, contender in enumerate(ranking):
            score, error = 100.0 * contender.score, 100.0 * contender.uncertainty
            leads = not contender.behind.apart
            colour = BLUE if leads else GREY
            if not contender.score <= limit:
                ax.plot(100.0 * limit, place, ">", color=GREY, label="beyond the axis")
                continue
            ax.errorbar(
                score, place, xerr=error if math.isfinite(error) else None, fmt="o", color=colour,
                markerfacecolor=colour if leads else "white", elinewidth=1.0, capsize=2.5, label=contender.name,
            )  # fmt: skip
        ax.set_yticks(range(len(ranking)), [f"{c.name} ({c.free})" for c in ranking], fontsize=8.5)
        ax.set_ylim(len(ranking) - 0.5, -0.5)
        ax.set_xlim(left=0.0)
        ax.set_xlabel("held-out error (%), with its standard uncertainty")
        ax.set_title("Models (free parameters); filled: not told apart from the best", fontsize=10.0)
    return figure


def _chosen(cuts: list[Cut], held_out: np.ndarray) -> list[Cut]:
    """At most three cuts: held-out ones first where only some are, else spread evenly; in their order."""
    if len(cuts) <= _COLUMNS:
        return cuts
    held = [i for i, cut in enumerate(cuts) if held_out[cut.rows].all()]
    if len(held) == len(cuts):
        held = []
    held = held[:_COLUMNS]
    others = [i for i in range(len(cuts)) if i not in held]
    even = np.linspace(0, len(others) - 1, _COLUMNS - len(held)).round().astype(int)
    return [cuts[i] for i in sorted({*held, *(others[j] for j in even)})]


def _along(
    contender: Contender, dataset: Any, cuts: list[Cut], names: list[str]
) -> dict[str, list[np.ndarray]]:
    """Quantities of a model along each cut, its nuisance terms included."""
    theta_i, theta_r, phi = (
        np.concatenate(a) for a in zip(*(cut.path_angles() for cut in cuts), strict=True)
    )
    there = np.isfinite(theta_i)
    # each cut stands for the group and the wavelength of its first point
    rows = np.repeat([cut.rows[0] for cut in cuts], [cut.path_x.size for cut in cuts])[there]
    data = contender.result.data
    along = Observations(
        theta_i=theta_i[there],
        theta_r=theta_r[there],
        phi=phi[there],
        channels=(),
        values=np.empty((0, len(rows))),
        std=np.empty((0, len(rows))),
        illumination=data.illumination,
        std_known=False,
        group=dataset["group"].values[rows],
        wavelength=dataset["wavelength"].values[rows] if "wavelength" in dataset.coords else None,
    )
    channels = tuple(dict.fromkeys(channel for name in names for channel in channels_behind(name)))
    values = predict(contender.result.space, contender.result.unknowns, along, channels)
    ends = np.cumsum([cut.path_x.size for cut in cuts])[:-1]
    curves = {}
    for name in names:
        whole = np.full(theta_i.size, np.nan)
        whole[there] = quantity_of(name, values)
        curves[name] = np.split(whole, ends)
    return curves


def _measured(ax: Axes, points: Points, cut: Cut, name: str, held: np.ndarray) -> None:
    channel = points.channels[name]
    for chosen, face in ((~held, "black"), (held, "white")):
        rows = cut.rows[chosen]
        if not rows.size:
            continue
        std = channel.std[rows]
        ax.errorbar(
            cut.x[chosen], channel.measured[rows], yerr=std if np.isfinite(std).any() else None, fmt="o",
            color="black", markerfacecolor=face, markersize=4.0, elinewidth=0.8, zorder=5,
        )  # fmt: skip


def _models(ax: Axes, cut: Cut, curves: list[np.ndarray]) -> None:
    colours = [look.colour for look in looks_of(_IN_COLOUR)]
    for place in reversed(range(len(curves))):
        first = place < _IN_COLOUR
        ax.plot(
            cut.path_x, curves[place], color=colours[place] if first else _PALE, linewidth=1.5 if first else 0.9,
            linestyle=_STYLES[place % len(_STYLES)] if first else "-", zorder=4.0 - 0.1 * place if first else 2.0,
        )  # fmt: skip


#: So that models whose curves lie on one another are both seen.
_STYLES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (2, 1.5)), "-.", (0, (1, 1)), (0, (7, 2, 1, 2)))


def _limits(ax: Axes, measured: np.ndarray, name: str) -> None:
    """Scaled to the measurements: a model far off must not press them into a corner."""
    finite = measured[np.isfinite(measured)]
    if not finite.size:
        return
    if name == "intensity":
        scale_intensity(ax, measured)
        positive = finite[finite > 0.0]
        if positive.size:
            logarithmic = ax.get_yscale() == "log"
            # without a lower end of its own a model that falls to 0 would stretch the logarithmic axis
            bottom = (
                max(ax.get_ylim()[0], 0.5 * float(positive.min()))
                if logarithmic
                else min(0.0, float(finite.min()))
            )
            ax.set_ylim(bottom, (2.0 if logarithmic else 1.3) * float(positive.max()))
        return
    if name == "dolp":
        ax.set_ylim(0.0, min(1.05, max(1.5 * float(finite.max()), 0.02)))
    else:
        scale_signed(ax, name)


def _agreement(ax: Axes, report: Compared, points: Points, name: str) -> None:
    """Predicted against measured values of the models in colour, with the line of equality."""
    comparison = report.comparison
    held = comparison.held_out
    measured = points.channels[name].measured[held]
    colours = [look.colour for look in looks_of(_IN_COLOUR)]
    for place in reversed(range(min(_IN_COLOUR, len(comparison.ranking)))):
        modelled = _modelled(comparison.ranking[place].comparison, name)[held]
        ax.plot(
            measured, modelled, ".", color=colours[place], markersize=4.0, alpha=0.7, zorder=3.0 - 0.1 * place
        )
    known = measured[np.isfinite(measured)]
    ends = np.array([known.min(), known.max()]) if known.size else np.array([0.0, 1.0])
    ax.plot(ends, ends, color="black", linewidth=0.9, zorder=4)
    if name == "intensity":
        scale_intensity(ax, measured, measured)
    label = channel_label(name, points)
    ax.set_xlabel(f"measured {label}")
    ax.set_ylabel(f"predicted {label}")


def _modelled(table: xr.Dataset, name: str) -> np.ndarray:
    """A quantity of the model at the measured geometries."""
    if name in ("intensity", "dolp"):
        return table["I_modelled" if name == "intensity" else "dolp_modelled"].values
    columns = [str(n) for n in table if str(n).endswith("_modelled")]
    return polarised_quantities({n.removesuffix("_modelled"): table[n].values for n in columns})[
        name
    ].measured


def _handles(ranking: list[Contender], with_cuts: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    looks = looks_of(_IN_COLOUR)
    handles = []
    for place, (contender, look) in enumerate(zip(ranking, looks, strict=False)):
        style: dict[str, Any] = {"linestyle": _STYLES[place % len(_STYLES)]} if with_cuts else {
            "linestyle": "none", "marker": "."
        }  # fmt: skip
        handles.append(Line2D([], [], color=look.colour, label=contender.name, **style))
    if len(ranking) > _IN_COLOUR and with_cuts:
        handles.append(Line2D([], [], color=_PALE, label=f"the other {len(ranking) - _IN_COLOUR}"))
    if with_cuts:
        handles.append(
            Line2D([], [], color="black", marker="o", linestyle="none", label="measured (open: held out)")
        )
    else:
        handles.append(Line2D([], [], color="black", label="equal"))
    return handles
