"""A calibration together with what it was made of, its table, and the sentences that say what it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pbrdf.identification.cross_check import Judged
from pbrdf.identification.library import Library
from pbrdf.report.identification.subject import cautions_on, fewest_needed, joined, scatter_sentence
from pbrdf.report.numbers import brief

__all__ = [
    "CALIBRATION_HEADINGS",
    "Calibrated",
    "calibrated_sentence",
    "calibration_rests_on",
    "calibration_rows",
    "level_of_calibration",
]

CALIBRATION_HEADINGS = ("material", "measurements", "told as itself", "as another", "as none", "in the set")


@dataclass(frozen=True)
class Calibrated:
    """A calibration of a library.

    Attributes
    ----------
    library
        With its new calibration.
    judged
        The labelled measurements, each judged with a calibration of the others.
    confidence
        Of the sets that are shown.
    name
        What to call the table of labels.
    written
        Where the calibrated library was written.
    settings, command
        As of :class:`pbrdf.report.identification.subject.Identified`.
    """

    library: Library
    judged: Judged
    confidence: float
    name: str
    written: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""


def _held(report: Calibrated) -> float:
    """Part of the sets that hold the true material."""
    judged = report.judged
    return float(
        (judged.p_value[np.arange(len(judged.truth)), judged.truth] > 1.0 - report.confidence).mean()
    )


def level_of_calibration(report: Calibrated) -> str:
    """Whether sets held what they promise but for chance, in the words that give a verdict its colour."""
    error = math.sqrt(report.confidence * (1.0 - report.confidence) / len(report.judged.truth))
    return "describes" if _held(report) >= report.confidence - 2.0 * error else "not"


def calibrated_sentence(report: Calibrated) -> str:
    """What the calibration is worth, in one sentence."""
    judged = report.judged
    return (
        f"of {len(judged.truth)} labelled measurements the {100.0 * report.confidence:g} % set held the true material "
        f"for {100.0 * _held(report):.1f} %; the most probable was right for {100.0 * judged.accuracy:.1f} %; expected "
        f"calibration error {judged.reliability.error:.3f}"
    )


def calibration_rows(report: Calibrated) -> list[list[str]]:
    """Materials as texts below :data:`CALIBRATION_HEADINGS`."""
    matrix = report.judged.confusion(report.confidence)
    coverage = report.judged.coverage(report.confidence)
    rows = []
    for c, name in enumerate(report.judged.names):
        total, own, none = int(matrix[c].sum()), int(matrix[c, c]), int(matrix[c, -1])
        held = f"{100.0 * coverage[c]:.0f} %" if math.isfinite(coverage[c]) else "–"
        rows.append([name, str(total), str(own), str(total - own - none), str(none), held])
    return rows


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
    needed = fewest_needed(report.confidence)
    counts = dict(zip(calibration.names, map(len, calibration.scores), strict=True))
    if bare := [name for name, count in counts.items() if not count]:
        lines.append(f"No measurements of {joined(bare, 'and')}: for these the χ² of a linear model counts.")
    if few := [f"{name} ({count})" for name, count in counts.items() if 0 < count < needed]:
        lines.append(
            f"Too few of {joined(few, 'and')}: with less than {needed} a set at {100.0 * report.confidence:g} % holds "
            "a material always, whatever was measured."
        )
    return lines
