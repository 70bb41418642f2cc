"""Identification as one page: of a measurement, of a map, and of a calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.report.dataset.describe import cautions, columns_in_words, describe
from pbrdf.report.identification.calibrated import (
    CALIBRATION_HEADINGS,
    Calibrated,
    calibrated_sentence,
    calibration_rests_on,
    calibration_rows,
    level_of_calibration,
)
from pbrdf.report.identification.classified import (
    CLASS_HEADINGS,
    Classified,
    class_rows,
    classes_rest_on,
    classes_sentence,
)
from pbrdf.report.identification.next_reading import NEXT_HEADINGS, next_rows, next_sentence
from pbrdf.report.identification.subject import HEADINGS, Identified, level_of, rests_on, rows_of, sentence
from pbrdf.report.page import (
    Section,
    bullets,
    command,
    file_list,
    paragraph,
    render_page,
    table,
    terms,
    versions,
)
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["calibration_page", "classes_page", "page_text"]

#: Packages whose versions change numbers.
_PACKAGES = ("numpy", "scipy", "drjit")
_UNDRAWN = "No figures were drawn: --no-figures was given."


@dataclass(frozen=True)
class _Verdict:
    level: str
    sentence: str
    reasons: Sequence[str] = field(default_factory=list)


def page_text(report: Identified, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of a measurement as HTML.

    Parameters
    ----------
    report
        What is reported on.
    figures
        Pieces of the page by name; those that are absent were not drawn.
    files
        Names of the files beside the page.
    """
    found = report.found
    at = f"{100.0 * found.confidence:g} %"
    candidates = table(
        f"Materials of the library, the most probable first. The {at} set holds the true one in {at} of such "
        "measurements; the p-value says how many measurements of a material are as unlike it as this one.",
        HEADINGS,
        rows_of(found),
        numeric=[1, 2],
        classes=["" if candidate.accepted else "fixed" for candidate in found.candidates],
    )
    measured = [bullets(describe(report.dataset))]
    if columns := columns_in_words(report.dataset):
        measured.append(paragraph(f"Columns of the file: {'; '.join(columns)}."))
    if warnings := cautions(report.dataset):
        measured += [paragraph("Assumed when the file was read, or left out of it:"), bullets(warnings)]
    return render_page(
        f"{Path(report.name).name}: which material is it?",
        [
            Section("Candidates", [candidates]),
            Section("The data over what specimens would show", _drawn(figures, "bands")),
            *_next(report, figures),
            Section("What it rests on", [bullets(rests_on(report))]),
            Section("What was measured", measured),
            _repeat(
                report,
                files,
                [("Data", [report.name, *_digest(report.sha256)]), ("Library", [report.library])],
            ),
        ],
        banner="Simulated data, not measured." if report.dataset.attrs.get("simulated") else "",
        verdict=_Verdict(level_of(found), sentence(found)),
        footer=_footer(),
        navigation=True,
    )


def _next(report: Identified, figures: Mapping[str, Markup]) -> list[Section]:
    """What to measure next, where there is something to tell apart."""
    found = report.next_measurement
    if found is None:
        return []
    readings = table(
        "Geometries that differ by 5° or more, the best first: expected information on the material of one reading "
        "more, how often the most probable material is then the true one, and how many candidates are left in the set.",
        NEXT_HEADINGS,
        next_rows(found),
        numeric=range(len(NEXT_HEADINGS)),
    )
    pieces = [paragraph(next_sentence(found)), *_drawn(figures, "next"), readings]
    return [Section("Which measurement would tell them apart", pieces)]


def classes_page(report: Classified, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of a map of materials as HTML; as :func:`page_text`."""
    without = {count.name: count for count in report.counts}["none of these"].share
    pixels = table(
        "Pixels by the most probable material of their set.",
        CLASS_HEADINGS,
        class_rows(report),
        numeric=[1, 2, 3],
    )
    return render_page(
        f"{Path(report.name).name}: which material is where?",
        [
            Section("Materials and how sure they are", [*_drawn(figures, "classes"), pixels]),
            Section("What it rests on", [bullets(classes_rest_on(report))]),
            _repeat(report, files, [("Map", [report.name]), ("Library", [report.library])]),
        ],
        banner="Simulated data, not measured." if report.simulated else "",
        verdict=_Verdict("describes" if without < 0.5 else "in part", classes_sentence(report)),
        footer=_footer(),
        navigation=True,
    )


def calibration_page(report: Calibrated, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of a calibration as HTML; as :func:`page_text`."""
    counts = table(
        f"Labelled measurements by material: what they were told as, and how many of the "
        f"{100.0 * report.confidence:g} % sets hold the true material.",
        CALIBRATION_HEADINGS,
        calibration_rows(report),
        numeric=range(1, len(CALIBRATION_HEADINGS)),
    )
    return render_page(
        f"{Path(report.name).name}: calibration of {Path(report.written).name}",
        [
            Section("Which material was told as which", [counts, *_drawn(figures, "confusion")]),
            Section("Whether probabilities are honest", _drawn(figures, "reliability")),
            Section("What it rests on", [bullets(calibration_rests_on(report))]),
            _repeat(report, files, [("Labels", [report.name]), ("Calibrated library", [report.written])]),
        ],
        verdict=_Verdict(level_of_calibration(report), calibrated_sentence(report)),
        footer=_footer(),
        navigation=True,
    )


def _drawn(figures: Mapping[str, Markup], name: str) -> list[Markup]:
    return [figures[name]] if name in figures else [paragraph(_UNDRAWN)]


def _digest(sha256: str) -> list[str]:
    return [f"SHA-256 {sha256}"] if sha256 else []


def _footer() -> str:
    return f"Written by pbrdf {__version__}. This page needs nothing but itself."


def _repeat(report: Any, files: Sequence[str], rows: list[tuple[str, Sequence[str]]]) -> Section:
    rows.append(("Versions", [versions(_PACKAGES)]))
    given = [f"{k.replace('_', ' ')}: {v}" for k, v in report.settings.items() if v not in (None, [], {}, ())]
    if given:
        rows.append(("Settings", ["; ".join(given)]))
    return Section(
        "How to repeat it",
        [
            *([command(report.command)] if report.command else []),
            terms(rows),
            file_list(files),
        ],
    )
