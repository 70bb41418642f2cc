"""A calibration together with what it was made of, and the sentences that say what it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pbrdf.identification.confusion import Confusion
from pbrdf.identification.library import Library
from pbrdf.report.identification.subject import cautions_on, fewest_needed, scatter_sentence
from pbrdf.report.numbers import brief
from pbrdf.wording import joined

__all__ = ["Calibrated", "calibration_rests_on"]


@dataclass(frozen=True)
class Calibrated:
    """A calibration of a library.

    Attributes
    ----------
    library
        With its new calibration.
    table
        What the labelled measurements were taken for, each judged with a calibration of the others.
    name
        What to call the table of labels.
    written
        Where the calibrated library was written.
    settings, command
        As of :class:`pbrdf.report.identification.subject.Identified`.
    """

    library: Library
    table: Confusion
    name: str
    written: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""


def calibration_rests_on(report: Calibrated) -> list[str]:
    """Sentences on what these numbers rest on."""
    calibration = report.library.calibration
    assert calibration is not None
    lines = [
        *cautions_on(report.library),
        "Each measurement was judged with a calibration of the others, so that none flatters itself. The promise holds "
        "for measurements like these: the same instrument, noise, geometries and treatment of gain and angle.",
        f"Temperature: {brief(calibration.temperature, 3)} (logarithms of likelihoods are divided by it; 1 if they "
        "were right as they are).",
        scatter_sentence(report.library),
    ]
    needed = fewest_needed(report.table.confidence)
    counts = dict(zip(calibration.names, map(len, calibration.scores), strict=True))
    if bare := [name for name, count in counts.items() if not count]:
        lines.append(f"No measurements of {joined(bare, 'and')}: for these the χ² of a linear model counts.")
    if few := [f"{name} ({count})" for name, count in counts.items() if 0 < count < needed]:
        lines.append(
            f"Too few of {joined(few, 'and')}: with less than {needed} a set at {100.0 * report.table.confidence:g} % "
            "holds a material always, whatever was measured."
        )
    return lines
