"""A map of parameters as one page: what came out, with which error, how far to trust it, how to repeat it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from pbrdf.report.numbers import brief, per_cent
from pbrdf.report.page import (
    Section,
    bullets,
    command,
    file_list,
    in_words,
    paragraph,
    render_page,
    table,
    terms,
    versions,
)
from pbrdf.report.parameter_map.subject import MapReport
from pbrdf.report.parameter_map.summary import MapSummary, counted, parameter_rows, part_headings, part_rows
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["page_text"]

#: Packages whose versions change numbers.
_PACKAGES = ("numpy", "drjit", "xarray", "zarr")


def page_text(
    report: MapReport, summary: MapSummary, figures: Mapping[str, Markup], files: Sequence[str]
) -> str:
    """The page as HTML.

    Parameters
    ----------
    report, summary
        What is reported on, and what it says.
    figures
        Pieces of the page by name: ``"map"``, ``"quality"``, and one for each parameter drawn.
    files
        Names of the files beside the page.
    """
    own = [piece for name, piece in figures.items() if name not in ("map", "quality")]
    undrawn = [] if figures else [paragraph("No figures were drawn: --no-figures.")]
    return render_page(
        f"{report.path.name}: {summary.model.partition(' ')[0] or 'a model'} fitted to every pixel",
        [
            Section("What came out", [*_found(summary), *_drawn(figures, "map"), *undrawn]),
            *([Section("Each parameter", own)] if own else []),
            Section("How far to trust it", [*_trust(summary), *_drawn(figures, "quality")]),
            Section("How to read and repeat it", list(_repeat(report, summary, files))),
        ],
        lead=_size(report),
        banner="Simulated data, not measured." if report.simulated else "",
        verdict=summary,
        footer=f"Written by pbrdf {__version__}. This page needs nothing but itself.",
        navigation=True,
    )


def _drawn(figures: Mapping[str, Markup], name: str) -> list[Markup]:
    return [figures[name]] if name in figures else []


def _size(report: MapReport) -> str:
    status = report.dataset["status"]
    return f"{' × '.join(f'{status.sizes[d]} ({d})' for d in status.dims)} pixels"


def _found(summary: MapSummary) -> Iterator[Markup]:
    described = {p.label.text: p.label.description for p in summary.parameters}
    rows = [[row[0], described[row[0]], *row[1:]] for row in parameter_rows(summary)]
    yield table(
        "Parameters over the pixels that determine them. Spread: half the range of the middle 68 %, which for normal "
        "scatter is its standard deviation; standard error: the median of the pixels' own. A spread no larger than the "
        "standard error is noise.",
        [
            "parameter",
            "meaning",
            "median",
            "spread",
            "standard error",
            "unit",
            "at a bound",
            "undetermined",
        ],
        rows,
        numeric=(2, 3, 4, 6, 7),
        classes=["fixed" if p.same else "" for p in summary.parameters],
    )
    if summary.parts:
        headings = part_headings(summary)
        yield table(
            "Parts of the sample that the labels tell apart: pixels with a result, and medians of the parameters over "
            "those that determine them.",
            headings,
            list(part_rows(summary)),
            numeric=range(1, len(headings)),
        )
    if summary.sampled():
        yield paragraph(summary.sampled())


def _trust(summary: MapSummary) -> Iterator[Markup]:
    yield table(
        "All pixels by the state of their fit.",
        ["state", "pixels", "share"],
        [
            [name.replace("_", " "), counted(count), per_cent(count / max(summary.total, 1))]
            for name, count in summary.states.items()
            if count
        ],
        numeric=(1, 2),
    )
    rows = [
        ("χ²", [f"per degree of freedom: median {brief(summary.reduced_chi2, 3)}"]),
        (
            "Optima",
            [summary.optima_in_words()],
        ),
    ]
    if summary.noise:
        rows.append(("Noise", [summary.noise]))
    yield terms(rows)


def _repeat(report: MapReport, summary: MapSummary, files: Sequence[str]) -> Iterator[Markup]:
    if report.command:
        yield command(report.command)
    rows: list[tuple[str, Sequence[str]]] = [("Model", [summary.model])]
    if summary.held:
        rows.append(("Held", summary.held))
    if report.sources:
        rows.append(("Data", list(report.sources)))
    rows.append(("Versions", [versions(_PACKAGES)]))
    settings = [
        f"{name.replace('_', ' ')}: {in_words(value)}"
        for name, value in report.settings.items()
        if value not in (None, [], {}, (), "", False)
    ]
    if settings:
        rows.append(("Settings", ["; ".join(settings)]))
    yield terms(rows)
    first = next((p.label.name for p in summary.parameters), "")
    yield paragraph("In Python:")
    opened = f'xr.open_zarr("{report.path.name}", consolidated=False)'
    if report.path.suffix == ".nc":
        opened = f'xr.open_dataset("{report.path.name}")'
    yield command(
        f"import xarray as xr\nfound = {opened}\n"
        f'good = found["status"] == 0  # converged\n'
        f'found["estimate"].sel(parameter="{first}").where(good).plot()'
    )
    if files:
        yield file_list(files)
    yield bullets(
        [
            f"Estimates and errors are stored in the units of the model ({_units(summary)}).",
            "Attributes of status and flags say what their numbers mean: flag_values, flag_masks, flag_meanings.",
        ]
    )


def _units(summary: MapSummary) -> str:
    degrees = [p.label.name for p in summary.parameters if p.label.unit == "°"]
    return f"angles in radians: {', '.join(degrees)}" if degrees else "those of the table"
