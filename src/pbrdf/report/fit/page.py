"""A fit as one page: what was measured and fitted, how sure, what it predicts, where it fails, how to repeat it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import written
from pbrdf.inversion.erroranalysis import ErrorStatistics, error_analysis
from pbrdf.inversion.holdout import Prediction
from pbrdf.inversion.verdict import Verdict
from pbrdf.models.parameters import shown_unit
from pbrdf.report.dataset.describe import cautions, columns_in_words, describe
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import (
    correlation_in_words,
    goodness_in_words,
    optima_in_words,
    value_in_words,
    verdict_in_words,
)
from pbrdf.report.numbers import brief, per_cent
from pbrdf.report.page import (
    Section,
    bullets,
    command,
    file_list,
    in_words,
    paragraph,
    render_page,
    subheading,
    table,
    terms,
    versions,
)
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["page_text"]

#: Where each figure of :mod:`pbrdf.report.fit.pictures` stands.
_PLACES = {
    "fitted": ("figure", "polarisation"),
    "sure": ("contours", "starts"),
    "fails": ("hemisphere",),
}
#: Geometries that are named as those that the model misses most.
_WORST = 8
#: Packages whose versions change numbers.
_PACKAGES = ("numpy", "scipy", "drjit")


def page_text(report: Report, figures: Mapping[str, Markup], files: Sequence[str]) -> str:
    """The page as HTML.

    Parameters
    ----------
    report
        What is reported on.
    figures
        Pieces of the page by the name of the picture, see :func:`pbrdf.report.fit.pictures.pictures`; those that are
        absent were not drawn.
    files
        Names of the files beside the page.
    """

    def drawn(place: str) -> list[Markup]:
        return [figures[name] for name in _PLACES[place] if name in figures]

    result, verdict = report.result, report.result.verdict()
    advice = [] if report.checks is None else report.checks.advice()
    simulated = bool(report.dataset.attrs.get("simulated"))
    return render_page(
        f"{Path(report.name).name}: {result.model.name} fitted",
        [
            Section("What was measured", list(_measured(report))),
            Section("What was fitted", [*_fitted(report, verdict), *drawn("fitted"), *_undrawn(figures)]),
            Section("How sure it is", [*_sure(report), *drawn("sure")]),
            Section("How it predicts what it has not seen", list(_predicted(report))),
            Section("Where it fails", [*_fails(report), *drawn("fails")]),
            *([Section("What to try next", [bullets(advice)])] if advice else []),
            Section("How to repeat it", list(_repeat(report, files))),
        ],
        banner="Simulated data, not measured." if simulated else "",
        verdict=verdict,
        footer=f"Written by pbrdf {__version__}. This page needs nothing but itself.",
        navigation=True,
    )


def _undrawn(figures: Mapping[str, Markup]) -> list[Markup]:
    return [] if figures else [paragraph("No figures were drawn: the fit was run with --no-figures.")]


def _measured(report: Report) -> Iterator[Markup]:
    yield bullets(describe(report.dataset))
    if columns := columns_in_words(report.dataset):
        yield paragraph(f"Columns of the file: {'; '.join(columns)}.")
    if warnings := cautions(report.dataset):
        yield paragraph("Assumed when the file was read, or left out of it:")
        yield bullets(warnings)


def _fitted(report: Report, verdict: Verdict) -> Iterator[Markup]:
    result = report.result
    options = [f"{name} = {choice}" for name, choice in result.model.chosen.items()]
    held = int(result.comparison["held_out"].values.sum())
    total = result.comparison.sizes["geometry"]
    rows = [
        ("Model", [result.model.name + (f" ({', '.join(options)})" if options else "")]),
        ("Fitted to", [f"{total - held} of {total} geometries, {result.goodness.data} measured values"]),
        ("Noise", [result.noise]),
    ]
    if sources := list(result.space.sources.values()):
        rows.append(("Held", sources))
    if len(result.stages) > 1:
        rows.append(("Steps", [f"{stage.name}: {stage.points} geometries" for stage in result.stages]))
    rows.append(("Goodness", goodness_in_words(result)))
    yield terms(rows)
    yield _parameter_table(report, verdict)


def _parameter_table(report: Report, verdict: Verdict) -> Markup:
    rows, classes = [], []
    described = verdict.level.usable
    for e in report.result.estimates.values():
        p = e.parameter
        factor, unit = shown_unit(p)
        limits = (
            "" if e.verdict == "fixed" else f"{brief(factor * e.lower, 3)} … {brief(factor * e.upper, 3)}"
        )
        label = p.name if p.symbol == p.name else f"{p.symbol} ({p.name})"
        words = verdict_in_words(e, described=described)
        rows.append([label, p.description, value_in_words(e), unit, limits, words])
        sure = "" if described else "doubtful"
        classes.append({"determined": sure, "fixed": "fixed"}.get(e.verdict, "doubtful"))
    return table(
        "Parameters. The error is one standard error.",
        ["parameter", "meaning", "value ± standard error", "unit", "bounds", "what the data say"],
        rows,
        numeric=[2, 4],
        classes=classes,
    )


def _sure(report: Report) -> Iterator[Markup]:
    result, checks = report.result, report.checks
    rows = [("Starts", optima_in_words(result)), ("Correlation", correlation_in_words(result))]
    if checks is not None:
        rows.insert(0, ("Determined", list(checks.identifiability.sentences)))
        objections = [f.sentence for f in checks.plausibility if f.severity != "ok"]
        rows.append(("Plausible", objections or ["nothing to object"]))
    yield terms(rows)
    names = [str(n) for n in result.correlation["parameter"].values]
    if len(names) > 1:
        yield table(
            "Correlation of the parameters that lie on no bound.",
            ["", *names],
            [
                [name, *(f"{r:+.2f}".replace("-", "−") for r in row)]
                for name, row in zip(names, result.correlation.values, strict=True)
            ],
            numeric=range(1, len(names) + 1),
        )
    if checks is not None and (checks.profile is not None or checks.bootstrap is not None):
        yield _interval_table(report)
        notes = [*(checks.profile.notes if checks.profile else ())]
        notes += checks.bootstrap.notes if checks.bootstrap else ()
        if notes:
            yield bullets(notes)


def _interval_table(report: Report) -> Markup:
    checks, estimates = report.checks, report.result.estimates
    assert checks is not None
    headings = ["parameter", "± 1.96 standard errors"]
    if checks.profile is not None:
        headings.append(f"profile, {checks.profile.level:.0%}".replace("%", " %"))
    if checks.bootstrap is not None:
        headings.append(f"bootstrap, {checks.bootstrap.level:.0%}".replace("%", " %"))
    rows = []
    for name, e in estimates.items():
        if e.verdict == "fixed":
            continue
        factor, _ = shown_unit(e.parameter)
        ends = [(e.value - 1.96 * e.std, e.value + 1.96 * e.std)]
        if checks.profile is not None:
            found = checks.profile.intervals.get(name)
            ends.append((math.nan, math.nan) if found is None else (found.lower, found.upper))
        if checks.bootstrap is not None:
            low, high = checks.bootstrap.percentiles.sel(parameter=name).values
            ends.append((float(low), float(high)))
        rows.append([name, *(f"{brief(factor * a)} … {brief(factor * b)}" for a, b in ends)])
    return table("Intervals of the free parameters.", headings, rows, numeric=range(1, len(headings)))


def _predicted(report: Report) -> Iterator[Markup]:
    result, checks = report.result, report.checks
    if result.predicted:
        held = int(result.comparison["held_out"].values.sum())
        yield paragraph(
            f"Held out: {result.hold_out}, {held} geometries. They were not fitted; the model predicts them."
        )
        yield _error_table("Errors, model − measured, of what was held out.", result.predicted)
    if checks is not None and checks.cross_validation is not None:
        yield bullets(checks.cross_validation.sentences())
    elif not result.predicted:
        yield paragraph(
            "Nothing was held out, so this fit shows how well the model follows the data, not how well it predicts. "
            "Run it with --hold-out or --cross-validate to learn that."
        )


def _error_table(caption: str, by_region: Mapping[str, Prediction]) -> Markup:
    intensity = any(math.isfinite(p.intensity_rms) for p in by_region.values())
    polarised = any(math.isfinite(p.dolp_rms) for p in by_region.values())
    ratios = any(math.isfinite(p.ratio_rms) for p in by_region.values())
    headings = ["region", "geometries", *(["intensity: median", "rms", "largest"] if intensity else [])]
    headings += ["DoLP: rms", "largest"] if polarised else []
    headings += ["ratios: rms", "largest"] if ratios else []
    rows = []
    for region, p in by_region.items():
        row = [region, str(p.count)]
        if intensity:
            row += map(per_cent, (p.intensity_median, p.intensity_rms, p.intensity_max))
        row += [brief(p.dolp_rms, 2), brief(p.dolp_max, 2)] if polarised else []
        rows.append(row + ([brief(p.ratio_rms, 2), brief(p.ratio_max, 2)] if ratios else []))
    return table(caption, headings, rows, numeric=range(1, len(headings)))


def _fails(report: Report) -> Iterator[Markup]:
    result = report.result
    yield _error_table("Errors, model − measured, of what was fitted.", result.fitted)
    analysis = report.checks.errors if report.checks is not None else error_analysis(result)
    # those on single groups stand in the table
    yield bullets(s for s in analysis.sentences() if not s.startswith("Group "))
    polarised = analysis.dolp.count > 0
    intensity = analysis.relative.count > 0
    if len(analysis.groups) > 1 and (intensity or polarised):
        headings = ["group"]
        headings += ["intensity: mean", "standard deviation", "largest", "at"] if intensity else []
        headings += ["DoLP: mean", "largest", "at"] if polarised else []
        rows, classes = [], []
        for g in analysis.groups:
            cells = [g.group + (" (held out)" if g.held_out else "")]
            cells += _statistics(g.relative, per_cent) if intensity else []
            if polarised:
                mean, _, largest, where = _statistics(g.dolp, lambda v: brief(v, 2))
                cells += [mean, largest, where]
            rows.append(cells)
            classes.append("held" if g.held_out else "")
        yield table(
            "Errors, model − measured, by group"
            + ("; of the intensity relative to the measured one." if intensity else "."),
            headings,
            rows,
            numeric=[i for i, heading in enumerate(headings) if heading not in ("group", "at")],
            classes=classes,
        )
    yield subheading("The geometries that it misses most")
    yield _worst_table(report)


def _statistics(s: ErrorStatistics, text: Callable[[float], str]) -> list[str]:
    """Mean, standard deviation and largest error, and where that is."""
    values = [text(v).replace("-", "−") for v in (s.mean, s.std, s.largest)]
    return [*values, "" if s.worst is None else s.worst.where]


def _worst_table(report: Report) -> Markup:
    """The geometries with the largest residuals, in units of what the fit took for their uncertainty."""
    comparison, channels = report.result.comparison, report.result.data.channels
    pulls = np.stack([comparison[f"{c}_residual"].values / comparison[f"{c}_std"].values for c in channels])
    size = np.nan_to_num(np.abs(pulls)).max(axis=0)
    rows = []
    for at in np.argsort(-size, kind="stable")[:_WORST]:
        channel = channels[int(np.nanargmax(np.nan_to_num(np.abs(pulls[:, at]))))]
        angles = [
            f"{round(math.degrees(float(comparison[name].values[at])), 2):g}°"
            for name in ("theta_i", "theta_r", "phi")
        ]
        measured, modelled = (
            float(comparison[f"{channel}_{kind}"].values[at]) for kind in ("measured", "modelled")
        )
        wavelength = (
            [f"{float(comparison['wavelength'].values[at]):g} nm"]
            if "wavelength" in comparison.coords
            else []
        )
        rows.append(
            [
                str(comparison["group"].values[at]),
                *angles,
                *wavelength,
                written(channel),
                brief(measured, 3),
                brief(modelled, 3),
                brief(float(size[at]), 3),
            ]
        )
    headings = ["group", "θi", "θr", "φ", *(["wavelength"] if "wavelength" in comparison.coords else [])]
    headings += ["quantity", "measured", "modelled", "standard uncertainties apart"]
    return table(
        "Largest differences in units of the uncertainty that the fit took.",
        headings,
        rows,
        numeric=[i for i, h in enumerate(headings) if h not in ("group", "quantity")],
    )


def _repeat(report: Report, files: Sequence[str]) -> Iterator[Markup]:
    if report.command:
        yield command(report.command)
    rows: list[tuple[str, Sequence[str]]] = []
    source = str(report.dataset.attrs.get("source", ""))
    data = [report.name, *([source] if source not in ("", Path(report.name).name) else [])]
    data.append(f"SHA-256 {report.sha256}" if report.sha256 else "not read from a single file: no SHA-256")
    rows.append(("Data", data))
    rows.append(("Versions", [versions(_PACKAGES)]))
    if settings := list(_settings(report.settings)):
        rows.append(("Settings", ["; ".join(settings)]))
    yield terms(rows)
    if files:
        yield file_list(files)
    yield paragraph(
        "In Python, pbrdf.load_fit(folder) brings this fit back, number by number; pbrdf.load_model reads model.json."
    )


def _settings(settings: Mapping[str, object]) -> Iterator[str]:
    for name, value in settings.items():
        if value not in (None, [], {}, ()):
            yield f"{name.replace('_', ' ')}: {in_words(value)}"
