"""The folder that a comparison of models leaves behind."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.files.atomic import atomic_folder
from pbrdf.inversion.model_comparison import Comparison, Contender
from pbrdf.models.parameters import shown_unit
from pbrdf.report.comparison.page import page_text
from pbrdf.report.comparison.subject import Compared
from pbrdf.report.comparison.summary import summary_text
from pbrdf.report.numbers import plain
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["comparison_record", "write_comparison"]

_CSV_COLUMNS = (
    "rank", "model", "free", "score", "score_std", "behind_best", "behind_best_std", "told_apart",
    "intensity_median_error", "polarisation_rms_error", "aic", "bic", "seconds", "remarks",
)  # fmt: skip


#: What each figure shows, for those who do not see it, and how to read it.
_CAPTIONS = {
    "ranking": (
        "Held-out error of every model with its uncertainty.",
        "Bars: one standard uncertainty. Differences are known better than the errors themselves: all models predict "
        "the same geometries.",
    ),
    "curves": (
        "Curves of every model over what was measured in the plane of incidence.",
        "Points: measured, open ones held out. The six models that predict best have a colour; the others are grey.",
    ),
}


def write_comparison(report: Compared, directory: Path, *, figure_format: str | None = "png") -> list[Path]:
    """Write the ranking, all numbers, the best model and the figures of a comparison, all or nothing.

    Parameters
    ----------
    report
        What is reported on.
    directory
        The folder; made if it is missing.
    figure_format
        ``"png"``, ``"pdf"`` or ``"svg"``; None draws nothing.

    Returns
    -------
    list of Path
        The files, in the order of their importance to a reader.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    comparison = report.comparison
    names = ["index.html", "summary.txt", "comparison.csv", "comparison.json", "best-model.json"]
    pieces: dict[str, Markup] = {}
    with atomic_folder(directory, fill=True) as temporary:
        (temporary / "summary.txt").write_text(summary_text(report), encoding="utf-8")
        with (temporary / "comparison.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(_CSV_COLUMNS)
            table.writerows(_csv_rows(comparison))
        record = json.dumps(comparison_record(report), indent=2, ensure_ascii=False, allow_nan=False)
        (temporary / "comparison.json").write_text(record + "\n", encoding="utf-8")
        comparison.best.result.model.to_json(temporary / "best-model.json")
        if figure_format is not None:
            from pbrdf.report.comparison.figure import curves_figure, ranking_figure
            from pbrdf.report.inline_svg import inline_svg
            from pbrdf.report.page import figure
            from pbrdf.report.style import save_figure

            for name, draw in (("ranking", ranking_figure), ("curves", curves_figure)):
                made = draw(report)
                drawn = f"{name}.{figure_format}"
                picture = temporary / drawn if figure_format == "png" else None
                names.append(drawn)
                shown, caption = _CAPTIONS[name]
                alternative = f"{shown} {comparison.sentences()[0]}"
                pieces[name] = figure(inline_svg(made, alternative, name, picture), caption, [drawn])
                if picture is None:
                    save_figure(made, temporary / drawn)
        page = page_text(report, pieces, names[1:])
        (temporary / "index.html").write_text(page, encoding="utf-8")
    return [directory / name for name in names]


def comparison_record(report: Compared) -> dict[str, Any]:
    """Everything a program may want to know of a comparison, in types that JSON has (NaN as None)."""
    comparison = report.comparison
    record = {
        "pbrdf": __version__,
        "data": report.name,
        "settings": dict(report.settings),
        "score": comparison.score_in_words,
        "held_out": {
            "by": comparison.by,
            "geometries": int(comparison.held_out.sum()),
            "folds": comparison.folds[1],
            "units": comparison.units,
        },
        "ranking": [_contender(c) for c in comparison.ranking],
        "steps": [
            {**asdict(step), **asdict(comparison.paired(step.simple, step.rich))}
            for step in comparison.steps
            if step.simple in comparison and step.rich in comparison
        ],
        "failures": [{"model": f.rung.name, "reason": f.reason} for f in comparison.failures],
        "regions_of_the_best": [
            dict(zip(("region", "geometries", "median_error", "median_signed_error"), region, strict=True))
            for region in comparison.regions()
        ],
        "sentences": comparison.sentences(),
    }
    return plain(record)  # type: ignore[return-value]


def _contender(contender: Contender) -> dict[str, Any]:
    rung, errors = contender.rung, contender.errors
    estimates = {}
    for name, estimate in contender.result.estimates.items():
        factor, unit = shown_unit(estimate.parameter)
        estimates[name] = {
            "value": factor * estimate.value,
            "standard_error": factor * estimate.std,
            "unit": "degree" if unit == "°" else unit,
            "verdict": estimate.verdict,
        }
    return {
        "model": contender.name,
        "class": rung.cls.name,
        "options": dict(contender.result.model.chosen),
        "fixed": dict(rung.fix),
        "nuisances": list(rung.nuisances),
        "loss": rung.loss,
        "free": contender.free,
        "score": contender.score,
        "score_std": contender.uncertainty,
        "behind_best": {**asdict(contender.behind), "told_apart": contender.behind.apart},
        "intensity_median_error": errors.intensity_median,
        "polarisation_rms_error": errors.polarisation_rms,
        "aic": contender.aic,
        "bic": contender.bic,
        "chi2": contender.result.goodness.chi2,
        "data": contender.result.goodness.data,
        "seconds": contender.seconds,
        "estimates": estimates,
        "remarks": list(contender.remarks),
    }


def _csv_rows(comparison: Comparison) -> list[list[Any]]:
    rows: list[list[Any]] = []
    for rank, c in enumerate(comparison.ranking, 1):
        errors = c.errors
        numbers: list[Any] = [c.score, c.uncertainty, c.behind.difference, c.behind.uncertainty]
        numbers += [
            int(c.behind.apart),
            errors.intensity_median,
            errors.polarisation_rms,
            c.aic,
            c.bic,
            c.seconds,
        ]
        shown = ["" if isinstance(v, float) and not math.isfinite(v) else v for v in numbers]
        rows.append([rank, c.name, c.free, *shown, "; ".join(c.remarks)])
    for failure in comparison.failures:
        rows.append(["", failure.rung.name, *[""] * 11, f"failed: {failure.reason}"])
    return rows
