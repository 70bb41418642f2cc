"""Figure of a plan: where it reads, and how well the parameters will be known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.dataset.panels import VIEWING_ANGLE, dress_hemisphere
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.instruments.goniometer.protocols import Protocol
    from pbrdf.planning.plan import Plan

__all__ = ["plan_figure"]


def plan_figure(plan: Plan, name: str, *, reference: str = "3 × 21") -> Figure:
    """Chosen geometries on the left, expected relative standard errors on the right, both beside the reference.

    Geometries of the plane of incidence are shown by their angles of incidence and view; out of it by the direction of
    the camera over the hemisphere, their colour the angle of incidence. Where a geometry is read more than once, a
    colour (in the plane) or the size of the mark (out of it) tells how often.

    Parameters
    ----------
    plan
        The plan.
    name
        What to call the model.
    reference
        What to call the protocol that it is compared with.
    """
    chosen = plan.candidates.subset(plan.counts > 0)
    times = plan.counts[plan.counts > 0]
    flat = (np.abs(np.sin(chosen.phi)) < 1e-9).all()
    with styled():
        figure = new_figure(11.0, 5.4)
        grid = figure.add_gridspec(1, 2, width_ratios=(1.25, 1.0))
        ax = figure.add_subplot(grid[0, 0], projection=None if flat else "polar")
        (_draw_plane if flat else _draw_hemisphere)(figure, ax, plan, chosen, times, reference)
        _draw_errors(figure.add_subplot(grid[0, 1]), plan, reference)
        figure.suptitle(
            f"{name}: {len(plan.protocol)} readings, {plan.criterion}-optimal; a reading tells as much as "
            f"{plan.gain:.3g} of the plan {reference}"
        )
    return figure


def _signed(protocol: Protocol) -> np.ndarray:
    """Viewing angle, negative on the source's side, degrees."""
    values: np.ndarray = np.rad2deg(protocol.theta_r) * np.where(np.cos(protocol.phi) < 0.0, -1.0, 1.0)
    return values


def _draw_plane(
    figure: Figure, ax: Axes, plan: Plan, chosen: Protocol, times: np.ndarray, reference: str
) -> None:
    ax.plot(
        _signed(plan.candidates), np.rad2deg(plan.candidates.theta_i), ".", color="#D0D0D0", markersize=2.0
    )
    ax.plot([], [], ".", color="#A0A0A0", label="candidates")
    ax.plot([0.0, 90.0], [0.0, 90.0], color=GREY, linewidth=0.8, linestyle=":", label="mirror direction")
    ax.plot(
        _signed(plan.reference), np.rad2deg(plan.reference.theta_i), "o", markersize=4.5, markerfacecolor="none",
        markeredgecolor=RED, markeredgewidth=0.9, label=f"plan {reference}",
    )  # fmt: skip
    x, y = _signed(chosen), np.rad2deg(chosen.theta_i)
    if times.max() == 1:
        ax.plot(x, y, "s", markersize=4.5, color=BLUE, label="this plan")
    else:
        marks = ax.scatter(
            x, y, c=times, cmap="viridis", vmin=1, s=40, marker="s", edgecolors="black", linewidths=0.5,
            zorder=3, label="this plan",
        )  # fmt: skip
        figure.colorbar(marks, ax=ax, label="readings", shrink=0.8)
    ax.set_xlim(-90.0, 90.0)
    ax.set_xticks(np.arange(-90, 91, 30))
    ax.set_ylim(0.0, 90.0)
    ax.set_xlabel(VIEWING_ANGLE)
    ax.set_ylabel("angle of incidence θi (°)")
    ax.set_title("geometries in the plane of incidence", fontsize=9.5)
    figure.legend(loc="outside lower left", ncols=4, frameon=False)


def _draw_hemisphere(
    figure: Figure, ax: Any, plan: Plan, chosen: Protocol, times: np.ndarray, reference: str
) -> None:
    dress_hemisphere(ax)
    ax.plot(
        plan.reference.phi, np.rad2deg(plan.reference.theta_r), "o", markersize=4.5, markerfacecolor="none",
        markeredgecolor=RED, markeredgewidth=0.9, label=f"plan {reference}",
    )  # fmt: skip
    marks = ax.scatter(
        chosen.phi, np.rad2deg(chosen.theta_r), c=np.rad2deg(chosen.theta_i), cmap="viridis", vmin=0.0, vmax=90.0,
        s=26.0 * times, marker="s", edgecolors="black", linewidths=0.4, zorder=3, label="this plan",
    )  # fmt: skip
    figure.colorbar(marks, ax=ax, label="angle of incidence θi (°)", shrink=0.8, pad=0.12)
    ax.set_title("directions of the camera, forward on the right", fontsize=9.5)
    figure.legend(loc="outside lower left", ncols=2, frameon=False)


def _draw_errors(ax: Axes, plan: Plan, reference: str) -> None:
    symbols = {p.name: p.symbol for p in plan.model.parameters}
    place = np.arange(len(plan.names))
    own, other = (100.0 * std / plan.sizes for std in (plan.std, plan.reference_std))
    ax.bar(place - 0.19, own, 0.36, color=BLUE, label="this plan")
    ax.bar(place + 0.19, other, 0.36, color="white", edgecolor=RED, hatch="///", label=f"plan {reference}")
    for x, a, b in zip(place, own, other, strict=True):
        ax.annotate(
            f"{b / a:.2g}×",
            (x, max(a, b)),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=9.0,
        )
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    low, high = min(own.min(), other.min()), max(own.max(), other.max())
    ax.set_ylim(0.5 * low, 2.0 * high)
    ax.set_xticks(place, [symbols[name] for name in plan.names])
    ax.grid(axis="x", visible=False)
    ax.set_ylabel("expected standard error (% of the guess)")
    ax.set_title(f"ratio: error of the plan {reference} over that of this plan", fontsize=9.5)
    ax.legend(frameon=False, loc="upper left")
