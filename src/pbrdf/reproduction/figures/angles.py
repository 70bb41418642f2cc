"""The paper's figures 5 and 7: intensity and degree of polarisation of all samples against the sample's angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.report.style import GREY, looks_of, panels, styled
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.paper import SIMULATED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["ANGLE", "dop_figure", "intensity_figure", "position_handles"]

ANGLE = "Angle_S_I = 90° − θi (°)"
#: A sample whose intensities span a larger ratio has a logarithmic axis.
_LOGARITHMIC_FROM = 100.0
_PANEL = (3.3, 2.5)
#: Step of the curves, degrees: narrow enough for the lobe of the smoothest sample.
_STEP = 0.05


def intensity_figure(samples: Sequence[Sample], positions: Sequence[float]) -> Figure:
    """Figure 5: intensity in digital numbers, simulated measurement and fitted model.

    Parameters
    ----------
    samples
        The inverted samples.
    positions
        Bistatic angles of the camera positions, radians.
    """
    return _figure(samples, positions, "Figure 5: intensity", intensity=True)


def dop_figure(samples: Sequence[Sample], positions: Sequence[float]) -> Figure:
    """Figure 7: degree of polarisation; parameters as of :func:`intensity_figure`."""
    return _figure(samples, positions, "Figure 7: degree of polarisation", intensity=False)


def position_handles(positions: Sequence[float], *, lines: bool) -> list[Line2D]:
    """Entries of a legend: the camera positions, the last one predicted, and what points and lines are."""
    from matplotlib.lines import Line2D

    handles = []
    last = len(positions)
    for number, (look, psi) in enumerate(zip(looks_of(last), positions, strict=True), start=1):
        held = number == last
        handles.append(
            Line2D(
                [],
                [],
                color=look.colour,
                marker=look.marker,
                markerfacecolor="white" if held else look.colour,
                linestyle=("--" if held else "-") if lines else "none",
                label=f"position {number}: Ψ = {np.rad2deg(psi):g}°" + (" (predicted)" if held else ""),
            )
        )
    if lines:
        handles.append(
            Line2D([], [], color=GREY, marker="o", linestyle="none", label="simulated measurement")
        )
        handles.append(Line2D([], [], color=GREY, label="fitted model"))
    return handles


def _figure(samples: Sequence[Sample], positions: Sequence[float], title: str, *, intensity: bool) -> Figure:
    columns = min(3, len(samples))
    rows = -(-len(samples) // columns)
    with styled():
        figure, axes = panels(
            rows, columns, _PANEL, f"{title}. {SIMULATED}", position_handles(positions, lines=True)
        )
        for sample, ax in zip(samples, axes.ravel(), strict=False):
            _panel(ax, sample, positions, intensity)
        for ax in axes.ravel()[len(samples) :]:
            ax.remove()
        return figure


def _panel(ax: Axes, sample: Sample, positions: Sequence[float], intensity: bool) -> None:
    measured = sample.intensity if intensity else sample.dolp
    for number, (look, psi) in enumerate(zip(looks_of(len(positions)), positions, strict=True), start=1):
        there = sample.position == number
        if not there.any():
            continue
        held = bool(sample.held_out[there].all())
        angle = sample.angle[there]
        path = np.unique(np.concatenate([np.arange(angle.min(), angle.max(), np.deg2rad(_STEP)), angle]))
        curve = sample.curve(psi, path)[0 if intensity else 1]
        ax.plot(
            np.rad2deg(path),
            curve,
            color=look.colour,
            linestyle="--" if held else "-",
            linewidth=1.1,
            zorder=2,
        )
        ax.plot(
            np.rad2deg(angle),
            measured[there],
            look.marker,
            color=look.colour,
            markerfacecolor="white" if held else look.colour,
            markersize=4.0,
            zorder=3,
        )
    ax.set_title(f"({'abcdefgh'[sample.number - 1]}) {sample.label}", fontsize=10)
    ax.set_xlabel(ANGLE)
    ax.set_xticks(np.arange(0, 91, 15))
    if not intensity:
        ax.set_ylabel("degree of polarisation")
        ax.set_ylim(0.0, 1.0)
        beyond = int(((measured < 0.0) | (measured > 1.0)).sum())
        if beyond:
            ax.annotate(
                f"noise: {beyond} point{'s' if beyond > 1 else ''} outside",
                (0.03, 0.92),
                xycoords="axes fraction",
                fontsize=8.5,
            )
        return
    positive = measured[measured > 0.0]
    if positive.size and positive.max() > _LOGARITHMIC_FROM * np.quantile(positive, 0.1):
        ax.set_yscale("log")
        ax.set_ylabel("intensity (DN), logarithmic")
    else:
        ax.set_ylabel("intensity (DN)")
        ax.set_ylim(bottom=0.0)
