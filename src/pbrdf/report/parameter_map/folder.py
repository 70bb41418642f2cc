"""The folder of pictures and words that a map leaves beside it."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.files.atomic import atomic_folder
from pbrdf.report.parameter_map.page import page_text
from pbrdf.report.parameter_map.shown_map import ShownMap
from pbrdf.report.parameter_map.subject import MapReport
from pbrdf.report.parameter_map.summary import MapSummary, print_map
from pbrdf.report.printing import printing_console

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["PAGE", "write_map_report"]

#: Name of the page in the folder.
PAGE = "index.html"
#: Width of the lines of summary.txt.
_WIDTH = 110


def write_map_report(
    report: MapReport, directory: Path, *, formats: Sequence[str] = ("png",), figures: bool = True
) -> tuple[MapSummary, list[Path]]:
    """Write the page, the figures and the summary of a map, all or nothing.

    Parameters
    ----------
    report
        What is reported on.
    directory
        The folder; made if it is missing.
    formats
        Of the figures; those of the page are PNG, which is always among them.
    figures
        Whether figures are drawn.

    Returns
    -------
    summary
        What the map says.
    files
        In the order of their importance to a reader.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    shown = ShownMap(report.dataset)
    summary = MapSummary.of(report.dataset, shown, report.labels)
    with atomic_folder(directory, fill=True) as temporary:
        pieces: dict[str, Markup] = {}
        names = ["summary.txt"]
        if figures:
            pieces, drawn = _draw(report, shown, temporary, list(dict.fromkeys(("png", *formats))))
            names += drawn
        (temporary / "summary.txt").write_text(_summary_text(report, summary), encoding="utf-8")
        (temporary / PAGE).write_text(page_text(report, summary, pieces, names), encoding="utf-8")
    return summary, [directory / name for name in (PAGE, *names)]


def _summary_text(report: MapReport, summary: MapSummary) -> str:
    text = io.StringIO()
    console = printing_console(file=text, width=_WIDTH, soft_wrap=False)
    console.print(f"{report.path.name}: {summary.model}", markup=False)
    print_map(summary, console)
    return text.getvalue()


def _draw(
    report: MapReport, shown: ShownMap, folder: Path, formats: Sequence[str]
) -> tuple[dict[str, Markup], list[str]]:
    """Draw and save the figures; returns them as pieces of the page by name, and the files."""
    from pbrdf.report.page import embedded_picture, figure
    from pbrdf.report.parameter_map.figure import (
        drawn_parameters,
        overview_figure,
        parameter_figure,
        quality_figure,
    )
    from pbrdf.report.reduction.gallery import safe_name
    from pbrdf.report.style import save_figure

    title = report.path.name
    wanted = [
        (
            "map",
            overview_figure(shown, title),
            "Maps of all parameters that vary.",
            "Every parameter that varies.",
        )
    ]
    for k in drawn_parameters(shown):
        label = shown.labels[k]
        wanted.append(
            (
                f"parameter_{safe_name(label.name)}",
                parameter_figure(shown, k, title),
                f"Map of {label.text}, of its standard error, and histogram.",
                f"{label.text}{': ' + label.description if label.description else ''}. Bar in the histogram: the "
                "median with the median of the pixels' standard errors.",
            )
        )
    wanted.append(
        (
            "quality",
            quality_figure(shown, title),
            "Maps of χ², state, optima, parameters at bounds and undetermined ones.",
            "Histogram: χ² per degree of freedom as found, and as it would be if the model were right and the "
            "uncertainties true.",
        )
    )
    pieces, names = {}, []
    for name, made, alternative, caption in wanted:
        files = [f"{name}.{kind}" for kind in formats]
        for file in files:
            save_figure(made, folder / file)
        pieces[name] = figure(embedded_picture(folder / f"{name}.png", alternative), caption, files)
        names += files
    return pieces, names
