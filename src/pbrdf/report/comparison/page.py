"""A comparison of models as one page: verdict, ranking, curves, what each assumption costs, where the best fails."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.inversion.model_comparison import DESCRIBES, IN_PART, Comparison
from pbrdf.models.parameters import shown_unit
from pbrdf.report.comparison.subject import Compared, share
from pbrdf.report.comparison.subject import table as ranking_table
from pbrdf.report.dataset.describe import cautions, columns_in_words, describe
from pbrdf.report.numbers import brief, per_cent, with_error
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

__all__ = ["page_text"]

#: Packages whose versions change numbers.
_PACKAGES = ("numpy", "scipy", "drjit")


class _Verdict:
    """The first sentence of a comparison as the page shows it."""

    def __init__(self, comparison: Comparison) -> None:
        score = comparison.best.score
        self.level = "describes" if score <= DESCRIBES else "in part" if score <= IN_PART else "does not"
        self.sentence, *others = comparison.sentences()
        self.reasons: Sequence[str] = others[:1] if len(comparison.ranking) > 1 else []


def page_text(report: Compared, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page as HTML.

    Parameters
    ----------
    report
        What is reported on.
    figures
        Pieces of the page by name, ``"curves"`` and ``"ranking"``; those that are absent were not drawn.
    files
        Names of the files beside the page.
    """
    comparison = report.comparison

    def drawn(name: str) -> list[Markup]:
        return [figures[name]] if name in figures else []

    undrawn = (
        [] if figures else [paragraph("No figures were drawn: the comparison was run with --no-figures.")]
    )
    simulated = bool(comparison.dataset.attrs.get("simulated"))
    return render_page(
        f"{Path(report.name).name}: {len(comparison.ranking)} models compared",
        [
            Section("What was measured", list(_measured(report))),
            Section("Which model predicts best", [*_ranking(comparison), *drawn("ranking"), *undrawn]),
            Section("Every model over the measurements", [*drawn("curves"), *_best(comparison)]),
            Section("What each assumption costs", list(_steps(comparison))),
            Section("Where the best one fails", list(_fails(comparison))),
            Section("How it was compared, and how to repeat it", list(_repeat(report, files))),
        ],
        banner="Simulated data, not measured." if simulated else "",
        verdict=_Verdict(comparison),
        footer=f"Written by pbrdf {__version__}. This page needs nothing but itself.",
        navigation=True,
    )


def _measured(report: Compared) -> Iterator[Markup]:
    dataset = report.comparison.dataset
    yield bullets(describe(dataset))
    if columns := columns_in_words(dataset):
        yield paragraph(f"Columns of the file: {'; '.join(columns)}.")
    if warnings := cautions(dataset):
        yield paragraph("Assumed when the file was read, or left out of it:")
        yield bullets(warnings)


def _ranking(comparison: Comparison) -> Iterator[Markup]:
    headings, rows = ranking_table(comparison)
    classes = ["" if not c.behind.apart else "fixed" for c in comparison.ranking]
    yield table(
        f"Held-out error: {comparison.score_in_words}, with its standard uncertainty. Those in full "
        "colour cannot be told apart from the best.",
        headings,
        rows,
        numeric=range(1, len(headings) - 1),
        classes=classes,
    )
    if comparison.failures:
        yield paragraph("Not compared:")
        yield bullets(f"{failure.rung.name}: {failure.reason}" for failure in comparison.failures)


def _best(comparison: Comparison) -> Iterator[Markup]:
    best = comparison.best
    rows = []
    for name, e in best.result.estimates.items():
        factor, unit = shown_unit(e.parameter)
        rows.append(
            [name, e.parameter.description, with_error(factor * e.value, factor * e.std), unit, e.verdict]
        )
    yield table(
        f"Parameters of {best.name}, fitted to {best.result.goodness.data} values. The error is one standard error.",
        ["parameter", "meaning", "value ± standard error", "unit", "verdict"],
        rows,
        numeric=[2],
        classes=["" if row[-1] == "determined" else "doubtful" for row in rows],
    )


def _steps(comparison: Comparison) -> Iterator[Markup]:
    rows, classes = [], []
    for step in comparison.steps:
        if step.simple not in comparison or step.rich not in comparison:
            continue
        paired = comparison.paired(step.simple, step.rich)
        said = "cannot be told"
        if paired.apart:
            said = "the assumption costs" if paired.difference > 0.0 else "freeing it misleads"
        scores = (per_cent(comparison[name].score) for name in (step.simple, step.rich))
        rows.append([step.assumption, step.rich, *scores, share(paired.difference, paired.uncertainty), said])
        classes.append("" if paired.apart else "fixed")
    if not rows:
        yield paragraph("No two of the models differ in one assumption alone.")
        return
    yield table(
        "Held-out error with an assumption and without it, and the paired difference with its standard uncertainty.",
        ["assumption", "in", "with it", "without", "difference", "what the data say"],
        rows,
        numeric=[2, 3, 4],
        classes=classes,
    )


def _fails(comparison: Comparison) -> Iterator[Markup]:
    regions = comparison.regions()
    if not regions:
        yield paragraph("No intensity was measured.")
        return
    yield table(
        f"Errors of the intensity that {comparison.best.name} predicts, relative to the measured one.",
        ["where", "geometries", "median size", "median with its sign"],
        [
            [name, str(count), per_cent(size), ("+" if bias > 0.0 else "") + per_cent(bias).replace("-", "−")]
            for name, count, size, bias in regions
        ],
        numeric=[1, 2, 3],
    )


def _repeat(report: Compared, files: Sequence[str]) -> Iterator[Markup]:
    comparison = report.comparison
    yield paragraph(comparison.sentences()[-1])
    if report.command:
        yield command(report.command)
    data = [
        report.name,
        f"SHA-256 {report.sha256}" if report.sha256 else "not read from a single file: no SHA-256",
    ]
    rows: list[tuple[str, Sequence[str]]] = [
        ("Data", data),
        ("Noise", [comparison.best.result.noise]),
        ("Versions", [versions(_PACKAGES)]),
        (
            "Time",
            [
                f"{brief(sum(c.seconds for c in comparison.ranking), 3)} s for {len(comparison.ranking)} models"
            ],
        ),
    ]
    settings = [
        f"{k.replace('_', ' ')}: {v}" for k, v in report.settings.items() if v not in (None, [], {}, ())
    ]
    if settings:
        rows.append(("Settings", ["; ".join(settings)]))
    yield terms(rows)
    yield file_list(files)
