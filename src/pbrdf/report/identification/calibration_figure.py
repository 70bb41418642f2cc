"""Figures of labelled measurements: reliability of the probabilities, and which material was told as which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.conformal import Reliability
from pbrdf.identification.confusion import Confusion
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["confusion_figure", "reliability_figure"]


def reliability_figure(found: Reliability, title: str, what: str = "measurements") -> Figure:
    """How often the most probable material is the true one, by its probability; below, how many there are of ``what``.

    Bars of the points are the standard errors of so many trials. On the diagonal probabilities are honest.
    """
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
            f"expected calibration error {found.error:.3f}, accuracy {100.0 * found.right:.1f} %",
            fontsize=10.0,
        )
        width = np.diff(found.edges)
        lower.bar(
            found.edges[:-1], found.count, width, align="edge", color=BLUE, alpha=0.75, edgecolor="white"
        )
        lower.set_ylabel(what)
        lower.set_xlabel("probability of the most probable material")
        lower.locator_params(axis="y", integer=True)
        figure.suptitle(title)
    return figure


def confusion_figure(table: Confusion, title: str) -> Figure:
    """Rows: what it was; columns: the most probable material of the set, or none of these."""
    matrix = table.counts
    share = matrix / matrix.sum(axis=1, keepdims=True)
    rows, columns = list(table.truth), list(table.taken_for)
    longest = max(map(len, [*rows, *columns]))
    with styled():
        width, height = 0.62 * len(columns), 0.62 * len(rows)
        figure = new_figure(width + 0.075 * longest + 1.9, height + 0.06 * longest + 1.4)
        ax = figure.add_subplot()
        ax.grid(visible=False)
        ax.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="equal")
        for (row, column), count in np.ndenumerate(matrix):
            if count:
                dark = share[row, column] > 0.55
                ax.text(
                    column,
                    row,
                    _short(count),
                    ha="center",
                    va="center",
                    fontsize=9.5,
                    color="white" if dark else "#202020",
                )
        right: Any = ax.secondary_yaxis("right")
        right.set_yticks(range(len(rows)), [f"{100.0 * part:.0f} %" for part in table.coverage], fontsize=9.0)
        right.tick_params(length=0)
        right.set_ylabel(f"sets that are right ({100.0 * table.confidence:g} % promised)", fontsize=9.0)
        for spine in (*ax.spines.values(), *right.spines.values()):
            spine.set_visible(False)
        ax.axvline(len(columns) - 1.5, color=GREY, linewidth=1.0)
        if (known := int((~table.strangers).sum())) < len(rows):
            ax.axhline(known - 0.5, color=GREY, linewidth=1.0)
        ax.set_xticks(range(len(columns)), columns, rotation=35.0, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(len(rows)), rows)
        ax.tick_params(length=0)
        ax.set_ylabel("material")
        ax.set_xlabel("told as")
        ax.set_title(title)
    return figure


def _short(count: int) -> str:
    """A count that fits in a cell."""
    return str(count) if count < 10_000 else f"{count / 1000:.0f} 000"
