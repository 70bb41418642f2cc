"""The paper's figures 6 and 8: how the errors of sample 3 are distributed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.report.style import GREY, looks_of, panels, styled
from pbrdf.reproduction import paper
from pbrdf.reproduction.experiment.errors import error_numbers
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.figures.angles import ANGLE, position_handles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["dop_error_figure", "intensity_error_figure"]

_PANEL = (4.4, 2.9)
_BINS = 21


def intensity_error_figure(sample: Sample, positions: Sequence[float]) -> Figure:
    """Figure 6: errors of the intensity, digital numbers, against the angle and as a histogram.

    Parameters
    ----------
    sample
        The inverted sample; in the paper sample 3.
    positions
        Bistatic angles of the camera positions, radians.
    """
    numbers, _ = error_numbers(sample)
    error = sample.modelled_intensity - sample.intensity
    found = (
        f"here: standard deviation {numbers.std:.3g} DN, largest {numbers.largest:+.3g} DN ({numbers.share:+.1%}) "
        f"at position {numbers.position}"
    )
    theirs = (
        f"paper (measured): {paper.INTENSITY_STD:g} DN, largest about {paper.INTENSITY_MAX:.0%} at position 3"
    )
    title = f"Figure 6: errors of the intensity, {sample.label}"
    return _figure(sample, positions, error, title, "model − measurement (DN)", found, theirs)


def dop_error_figure(sample: Sample, positions: Sequence[float]) -> Figure:
    """Figure 8: errors of the degree of polarisation; parameters as of :func:`intensity_error_figure`."""
    _, numbers = error_numbers(sample)
    error = sample.modelled_dolp - sample.dolp
    found = f"here: standard deviation {numbers.std:.4f}, largest {numbers.largest:+.3f} at position {numbers.position}"
    theirs = f"paper (measured): standard deviation {paper.DOP_STD:g}, largest where the DoP is near 0"
    title = f"Figure 8: errors of the degree of polarisation, {sample.label}"
    return _figure(sample, positions, error, title, "model − measurement", found, theirs)


def _figure(
    sample: Sample,
    positions: Sequence[float],
    error: np.ndarray,
    title: str,
    label: str,
    found: str,
    theirs: str,
) -> Figure:
    with styled():
        figure, axes = panels(
            1,
            2,
            _PANEL,
            f"{title}. {paper.SIMULATED}\n{found}; {theirs}".replace("-", "−").replace("%", " %"),
            position_handles(positions, lines=False),
        )
        figure.texts[0].set_fontsize(10.0)
        _against_angle(axes[0, 0], sample, positions, error)
        axes[0, 0].set_ylabel(label)
        _histogram(axes[0, 1], sample, positions, error)
        axes[0, 1].set_xlabel(label)
        return figure


def _against_angle(ax: Axes, sample: Sample, positions: Sequence[float], error: np.ndarray) -> None:
    ax.axhline(0.0, color="black", linewidth=0.8)
    std = float(np.nanstd(error))
    ax.axhspan(-std, std, color=GREY, alpha=0.15, linewidth=0)
    for number, look in enumerate(looks_of(len(positions)), start=1):
        there = sample.position == number
        held = bool(sample.held_out[there].all())
        ax.plot(
            np.rad2deg(sample.angle[there]),
            error[there],
            look.marker,
            color=look.colour,
            markerfacecolor="white" if held else look.colour,
        )
    ax.set_xlabel(ANGLE)
    ax.set_xticks(np.arange(0, 91, 15))
    ax.set_title("against the angle (band: ± one standard deviation)", fontsize=10)


def _histogram(ax: Axes, sample: Sample, positions: Sequence[float], error: np.ndarray) -> None:
    reach = float(np.nanmax(np.abs(error))) or 1.0
    edges = np.linspace(-reach, reach, _BINS + 1).tolist()
    looks = looks_of(len(positions))
    by_position = [error[(sample.position == n) & np.isfinite(error)] for n in range(1, len(positions) + 1)]
    ax.hist(
        by_position,
        edges,
        stacked=True,
        color=[look.colour for look in looks],
        edgecolor="white",
        linewidth=0.5,
    )
    ax.set_ylabel("number of points")
    ax.set_title("all points, by position", fontsize=10)
