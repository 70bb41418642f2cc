"""Identification as one page: of a measurement, of a map, and of a calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.report.dataset.describe import cautions, columns_in_words, describe
from pbrdf.report.identification.calibrated import Calibrated, calibration_rests_on
from pbrdf.report.identification.classified import (
    CLASS_HEADINGS,
    Classified,
    class_rows,
    classes_rest_on,
    classes_sentence,
)
from pbrdf.report.identification.confusion_table import (
    confusion_headings,
    confusion_rows,
    confusion_sentence,
    level_of_sets,
)
from pbrdf.report.identification.labelled import LabelledReport, labels_rest_on
from pbrdf.report.identification.next_reading import NEXT_HEADINGS, next_rows, next_sentence
from pbrdf.report.identification.subject import (
    CAUTION,
    HEADINGS,
    Identified,
    level_of,
    ranked,
    rests_on,
    rows_of,
    sentence,
)
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

    from pbrdf.identification.confusion import Confusion

__all__ = ["calibration_page", "classes_page", "labelled_page", "page_text"]

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
    first = "the least unlike" if found.far_from_all else "the most probable"
    candidates = table(
        f"Materials of the library, {first} first. The {at} set holds the true one in {at} of such "
        "measurements; the p-value says how many measurements of a material are as unlike it as this one.",
        HEADINGS,
        rows_of(found),
        numeric=[1, 2],
        classes=["" if candidate.accepted else "fixed" for candidate in ranked(found)],
    )
    return render_page(
        f"{Path(report.name).name}: which material is it?",
        [
            Section("Candidates", [candidates]),
            _shown(report, figures),
            *_next(report, figures),
            Section("What it rests on", [bullets(_grounds(rests_on(report)))]),
            _measured(report),
            _repeat(
                report,
                files,
                [("Data", [report.name, *_digest(report.sha256)]), ("Library", [report.library])],
            ),
        ],
        banner="Simulated data, not measured." if report.simulated else "",
        verdict=_Verdict(level_of(found), sentence(found), _doubts(rests_on(report))),
        footer=_footer(),
        navigation=True,
    )


def _shown(report: Identified, figures: Mapping[str, Markup]) -> Section:
    """The measurement beside the candidates."""
    if report.dataset is None:
        return Section("The fit over what specimens have", _drawn(figures, "parameters"))
    return Section("The data over what specimens would show", _drawn(figures, "bands"))


def _measured(report: Identified) -> Section:
    """What was identified."""
    if report.dataset is None:
        fitted = report.fitted
        told = [] if fitted is None else [f"{fitted.model!r}, fitted to {fitted.data}"]
        return Section("What was fitted", [bullets(["Parameters of a fit without its data", *told])])
    measured = [bullets(describe(report.dataset))]
    if columns := columns_in_words(report.dataset):
        measured.append(paragraph(f"Columns of the file: {'; '.join(columns)}."))
    if warnings := cautions(report.dataset):
        measured += [paragraph("Assumed when the file was read, or left out of it:"), bullets(warnings)]
    return Section("What was measured", measured)


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
    pieces = [
        paragraph(next_sentence(found, len(report.found.materials))),
        *_drawn(figures, "next"),
        readings,
    ]
    return [Section("Which measurement would tell them apart", pieces)]


def classes_page(report: Classified, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of a map of materials as HTML; as :func:`page_text`."""
    without = {count.name: count for count in report.counts}["none of these"].share
    pixels = table(
        "Pixels by the most probable material of their set; shares are of the measured pixels.",
        CLASS_HEADINGS,
        class_rows(report),
        numeric=[1, 2, 3],
    )
    return render_page(
        f"{Path(report.name).name}: which material is where?",
        [
            Section("Materials and how sure they are", [*_drawn(figures, "classes"), pixels]),
            *_against_labels(report, figures),
            Section("What it rests on", [bullets(_grounds(classes_rest_on(report)))]),
            _repeat(report, files, [("Map", [report.name]), ("Library", [report.library])]),
        ],
        banner="Simulated data, not measured." if report.simulated else "",
        verdict=_Verdict(
            "describes" if without < 0.5 else "in part",
            classes_sentence(report),
            _doubts(classes_rest_on(report)),
        ),
        footer=_footer(),
        navigation=True,
    )


def calibration_page(report: Calibrated, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of a calibration as HTML; as :func:`page_text`."""
    return render_page(
        f"{Path(report.name).name}: calibration of {Path(report.written).name}",
        [
            *_judged(report.table, "measurements", figures),
            Section("What it rests on", [bullets(calibration_rests_on(report))]),
            _repeat(report, files, [("Labels", [report.name]), ("Calibrated library", [report.written])]),
        ],
        verdict=_Verdict(level_of_sets(report.table), confusion_sentence(report.table, "measurements")),
        footer=_footer(),
        navigation=True,
    )


def labelled_page(report: LabelledReport, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page of labelled measurements as HTML; as :func:`page_text`."""
    return render_page(
        f"{Path(report.name).name}: judged by {Path(report.library).name}",
        [
            *_judged(report.table, "measurements", figures),
            Section("What it rests on", [bullets(labels_rest_on(report))]),
            _repeat(report, files, [("Labels", [report.name]), ("Library", [report.library])]),
        ],
        verdict=_Verdict(level_of_sets(report.table), confusion_sentence(report.table, "measurements")),
        footer=_footer(),
        navigation=True,
    )


def _doubts(sentences: Sequence[str]) -> list[str]:
    """Those that the answer is not to be read without."""
    return [line for line in sentences if line.startswith(CAUTION)]


def _grounds(sentences: Sequence[str]) -> list[str]:
    """The others."""
    return [line for line in sentences if not line.startswith(CAUTION)]


def _judged(found: Confusion, what: str, figures: Mapping[str, Markup]) -> list[Section]:
    """What was told as which, and whether probabilities are honest."""
    headings = confusion_headings(what)
    counts = table(
        f"Labelled {what} by material: what they were told as, and how many of the {100.0 * found.confidence:g} % sets "
        "hold the true material.",
        headings,
        confusion_rows(found),
        numeric=range(1, len(headings)),
    )
    sections = [Section("Which material was told as which", [counts, *_drawn(figures, "confusion")])]
    if found.reliability is not None:
        sections.append(Section("Whether probabilities are honest", _drawn(figures, "reliability")))
    return sections


def _against_labels(report: Classified, figures: Mapping[str, Markup]) -> list[Section]:
    """What pixels of known materials were taken for, where there are labels."""
    if report.labelled is None:
        return []
    first, *others = _judged(report.labelled, "pixels", figures)
    told = paragraph(f"{report.labels}: {confusion_sentence(report.labelled, 'pixels')}.")
    return [Section(first.title, [told, *first.parts]), *others]


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
