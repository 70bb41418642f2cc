"""Figures of a calibration: reliability of the probabilities, and which material was told as which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.cross_check import Judged
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["confusion_figure", "reliability_figure"]


def reliability_figure(judged: Judged, title: str) -> Figure:
    """How often the most probable material is the true one, by its probability; below, how many measurements.

    Bars of the points are the standard errors of so many trials. On the diagonal probabilities are honest.
    """
    found = judged.reliability
    with styled():
        figure = new_figure(5.6, 5.6)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
        upper.plot([0.0, 1.0], [0.0, 1.0], color=GREY, linestyle=":", label="honest")
        filled = found.count > 0
        confidence, accuracy, count = found.confidence[filled], found.accuracy[filled], found.count[filled]
        # Laplace's rule of succession keeps a bar where all trials agree
        share = (accuracy * count + 1.0) / (count + 2.0)
        error = np.sqrt(share * (1.0 - share) / (count + 2.0))
        upper.vlines(confidence, confidence, accuracy, color=RED, linewidth=1.0, alpha=0.6, label="gap")
        upper.errorbar(
            confidence, accuracy, yerr=error, fmt="o", color=BLUE, capsize=2.5, elinewidth=1.0, label="found"
        )
        upper.set_ylim(-0.02, 1.05)
        upper.set_xlim(0.0, 1.02)
        upper.set_aspect("auto")
        upper.set_ylabel("part that is right")
        upper.legend(frameon=False, loc="upper left")
        upper.set_title(
            f"expected calibration error {found.error:.3f}, accuracy {100.0 * judged.accuracy:.1f} %",
            fontsize=10.0,
        )
        width = np.diff(found.edges)
        lower.bar(
            found.edges[:-1], found.count, width, align="edge", color=BLUE, alpha=0.75, edgecolor="white"
        )
        lower.set_ylabel("measurements")
        lower.set_xlabel("probability of the most probable material")
        lower.locator_params(axis="y", integer=True)
        figure.suptitle(title)
    return figure


def confusion_figure(judged: Judged, confidence: float, title: str) -> Figure:
    """Rows: what it was; columns: the most probable material of the set, or none of these."""
    matrix = judged.confusion(confidence)
    total = matrix.sum(axis=1, keepdims=True)
    share = matrix / np.maximum(total, 1)
    names = list(judged.names)
    longest = max(map(len, names))
    with styled():
        size = 0.62 * len(names)
        figure = new_figure(size + 0.62 + 0.075 * longest + 1.9, size + 0.06 * longest + 1.4)
        ax = figure.add_subplot()
        ax.grid(visible=False)
        ax.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="equal")
        for (row, column), count in np.ndenumerate(matrix):
            if count:
                dark = share[row, column] > 0.55
                ax.text(
                    column,
                    row,
                    str(count),
                    ha="center",
                    va="center",
                    fontsize=9.5,
                    color="white" if dark else "#202020",
                )
        right: Any = ax.secondary_yaxis("right")
        coverage = judged.coverage(confidence)
        right.set_yticks(
            range(len(names)),
            [f"{100.0 * c:.0f} %" if np.isfinite(c) else "–" for c in coverage],
            fontsize=9.0,
        )
        right.tick_params(length=0)
        right.set_ylabel(f"sets that hold it ({100.0 * confidence:g} % promised)", fontsize=9.0)
        for spine in (*ax.spines.values(), *right.spines.values()):
            spine.set_visible(False)
        ax.axvline(len(names) - 0.5, color=GREY, linewidth=1.0)
        ax.set_xticks(
            range(len(names) + 1),
            [*names, "none of these"],
            rotation=35.0,
            ha="right",
            rotation_mode="anchor",
        )
        ax.set_yticks(range(len(names)), names)
        ax.tick_params(length=0)
        ax.set_ylabel("material")
        ax.set_xlabel("told as")
        ax.set_title(title)
    return figure
