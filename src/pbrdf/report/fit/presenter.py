"""A fit as it shows itself in Python: its text, its table in a notebook, its figure, its folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.files.atomic import require_writable_folder
from pbrdf.inversion.estimates import Estimate
from pbrdf.inversion.holdout import Prediction
from pbrdf.inversion.result import FitResult
from pbrdf.models.parameters import shown_unit
from pbrdf.report.fit.checks import run_checks
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.fit.folder import parse_formats, write_report
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import summary_text, value_in_words, verdict_in_words
from pbrdf.report.notebook import notebook_html, title_of
from pbrdf.report.numbers import brief, per_cent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure", "html", "save", "summary"]


def summary(result: FitResult, *, verbose: bool = False) -> str:
    """What ``pbrdf fit`` prints, with the checks that it makes for every fit."""
    return summary_text(_report(result), verbose=verbose)


def html(result: FitResult) -> str:
    """A table of the parameters, and in a line each how well they describe and predict the data."""
    verdict = result.verdict()
    described = verdict.level.usable
    rows = [_row(name, estimate, described) for name, estimate in result.estimates.items()]
    lines = [f"{result.model.name} fitted to {result.goodness.data} values of {title_of(result.dataset)}"]
    lines += _errors("fitted", result.fitted) + _errors("held out, predicted", result.predicted)
    headings = ("parameter", "value", "unit", "verdict", "meaning")
    return notebook_html(verdict.sentence, headings, rows, [*lines, *result.notes])


def figure(result: FitResult) -> Figure:
    """Measured points with the fitted model."""
    return fit_figure(_report(result, checked=False))


def save(result: FitResult, folder: Path, figure_format: str = "png") -> list[Path]:
    """Write the folder of ``pbrdf fit``."""
    parse_formats(figure_format)
    require_writable_folder(folder)
    return write_report(_report(result), folder, figure_format=figure_format)


def _report(result: FitResult, *, checked: bool = True) -> Report:
    checks = run_checks(result, result.dataset) if checked else None
    return Report(result, result.dataset, title_of(result.dataset), checks=checks)


def _errors(what: str, by_region: dict[str, Prediction]) -> list[str]:
    """One sentence on the errors of the intensity and the degree of polarisation."""
    if "all" not in by_region:
        return []
    errors = by_region["all"]
    parts = []
    if math.isfinite(errors.intensity_median):
        parts.append(f"median error of the intensity {per_cent(errors.intensity_median)}")
    if math.isfinite(errors.dolp_rms):
        parts.append(f"rms error of the degree of linear polarisation {brief(errors.dolp_rms, 2)}")
    if math.isfinite(errors.ratio_rms):
        parts.append(f"rms error of the ratios {brief(errors.ratio_rms, 2)}")
    return [f"{what}: {', '.join(parts)}"] if parts else []


def _row(name: str, estimate: Estimate, described: bool) -> list[str]:
    _, unit = shown_unit(estimate.parameter)
    return [
        name,
        value_in_words(estimate),
        unit,
        verdict_in_words(estimate, described=described),
        estimate.parameter.description,
    ]
