"""A comparison of models as it shows itself in Python: its text, its table in a notebook, its figure, its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.files.atomic import require_writable_folder
from pbrdf.inversion.model_comparison import Comparison
from pbrdf.report.comparison.figure import ranking_figure
from pbrdf.report.comparison.folder import write_comparison
from pbrdf.report.comparison.subject import Compared, table
from pbrdf.report.comparison.summary import summary_text
from pbrdf.report.notebook import notebook_html, title_of
from pbrdf.report.style import check_figure_format

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure", "html", "save", "summary"]


def summary(comparison: Comparison) -> str:
    """What ``pbrdf compare`` prints."""
    return summary_text(_report(comparison))


def html(comparison: Comparison) -> str:
    """The verdict, a table of the ranking, and a line each on what the assumptions cost and what failed."""
    verdict, *others = comparison.sentences()
    others += [f"Not compared: {failure.rung.name}: {failure.reason}" for failure in comparison.failures]
    return notebook_html(verdict, *table(comparison), others)


def figure(comparison: Comparison) -> Figure:
    """The held-out error of every model with its uncertainty."""
    return ranking_figure(_report(comparison))


def save(comparison: Comparison, folder: Path, figure_format: str = "png") -> list[Path]:
    """Write the folder of ``pbrdf compare``."""
    check_figure_format(figure_format)
    require_writable_folder(folder)
    return write_comparison(_report(comparison), folder, figure_format=figure_format)


def _report(comparison: Comparison) -> Compared:
    return Compared(comparison, title_of(comparison.dataset))
