"""A comparison of models together with what it was made of, and its table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pbrdf.inversion.model_comparison import Comparison
from pbrdf.report.numbers import brief, per_cent

__all__ = ["Compared", "share", "table"]


@dataclass(frozen=True)
class Compared:
    """What is reported on.

    Attributes
    ----------
    comparison
        What was found.
    name
        What to call the data: a file or a bundled paint.
    settings
        How the comparison was asked for, in plain values.
    command
        The command line, where there was one.
    sha256
        That of the file; empty where the data came from elsewhere.
    """

    comparison: Comparison
    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""
    sha256: str = ""


def table(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the ranking as texts: the model first, the remarks last, numbers between."""
    both = comparison.polarised and comparison.with_intensity
    headings = ["model", "free", "held-out error", *(["of I", "of pol."] if both else [])]
    headings += ["behind the best", "AIC", "BIC", "remarks"]
    rows = []
    for contender in comparison.ranking:
        errors, behind = contender.errors, contender.behind
        row = [contender.name, str(contender.free), share(contender.score, contender.uncertainty)]
        if both:
            row += [share(errors.intensity_median), share(errors.polarisation_rms)]
        row.append("–" if contender is comparison.best else share(behind.difference, behind.uncertainty))
        row += [_criterion(contender.aic), _criterion(contender.bic), "; ".join(contender.remarks)]
        rows.append(row)
    return headings, rows


def share(value: float, uncertainty: float = math.nan) -> str:
    """A share as per cent, with its standard uncertainty where that is known."""
    if not (math.isfinite(uncertainty) and math.isfinite(value) and uncertainty > 0.0):
        return "0 %" if value == 0.0 else per_cent(value) if math.isfinite(value) else brief(value)
    digits = min(max(0, 1 - math.floor(math.log10(100.0 * uncertainty))), 3)
    return f"{100.0 * value:.{digits}f} ± {100.0 * uncertainty:.{digits}f} %".replace("-", "−")


def _criterion(value: float) -> str:
    return "–" if not math.isfinite(value) else f"{value:.1f}".replace("-", "−")
