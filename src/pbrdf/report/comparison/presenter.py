"""A comparison of models as it shows itself in Python: its text, its table in a notebook, its figure, its folder."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.errors import PbrdfError
from pbrdf.files.atomic import require_writable_folder
from pbrdf.inversion.model_comparison import Comparison
from pbrdf.report.comparison.figure import ranking_figure
from pbrdf.report.comparison.folder import write_comparison
from pbrdf.report.comparison.subject import Compared, table
from pbrdf.report.comparison.summary import summary_text
from pbrdf.report.style import FIGURE_FORMATS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure", "html", "save", "summary"]

#: What data without a title are called.
_UNNAMED = "data"


def summary(comparison: Comparison) -> str:
    """What ``pbrdf compare`` prints."""
    return summary_text(_report(comparison))


def html(comparison: Comparison) -> str:
    """The verdict, a table of the ranking, and a line each on what the assumptions cost and what failed."""
    verdict, *others = comparison.sentences()
    others += [f"Not compared: {failure.rung.name}: {failure.reason}" for failure in comparison.failures]
    headings, rows = table(comparison)
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    lines = "".join(f"<p>{escape(line)}</p>" for line in others)
    return (
        f"<div><p>{escape(verdict)}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{lines}</div>"
    )


def figure(comparison: Comparison) -> Figure:
    """The held-out error of every model with its uncertainty."""
    return ranking_figure(_report(comparison))


def save(comparison: Comparison, folder: Path, figure_format: str = "png") -> list[Path]:
    """Write the folder of ``pbrdf compare``."""
    if figure_format not in FIGURE_FORMATS:
        raise PbrdfError(f"figure_format {figure_format!r}: choose one of {', '.join(FIGURE_FORMATS)}")
    require_writable_folder(folder)
    return write_comparison(_report(comparison), folder, figure_format=figure_format)


def _report(comparison: Comparison) -> Compared:
    return Compared(comparison, str(comparison.dataset.attrs.get("title") or _UNNAMED))
