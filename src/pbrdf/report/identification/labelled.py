"""Labelled measurements judged by a library as it is, together with what they were judged by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pbrdf.identification.confusion import Confusion
from pbrdf.identification.library import Library
from pbrdf.report.identification.subject import calibration_sentence, prior_in_words, scatter_sentence

__all__ = ["LabelledReport", "labels_rest_on"]


@dataclass(frozen=True)
class LabelledReport:
    """Labelled measurements that were judged.

    Attributes
    ----------
    table
        What they were taken for.
    name
        What to call the table of labels.
    materials
        The library, and ``library`` what to call it.
    library
        What to call the library.
    prior, settings, command
        As of :class:`pbrdf.report.identification.subject.Identified`.
    """

    table: Confusion
    name: str
    materials: Library
    library: str
    prior: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""


def labels_rest_on(report: LabelledReport) -> list[str]:
    """Sentences on what these numbers rest on."""
    lines = [
        "Judged by the library as it is, which is left unchanged.",
        calibration_sentence(report.materials, report.table.confidence),
        scatter_sentence(report.materials),
        prior_in_words(report.prior),
    ]
    if report.materials.calibration is not None:
        lines.insert(
            1,
            "If these measurements are among those that the library was calibrated with, they flatter it; the page of "
            "the calibration judges each by the others.",
        )
    return lines
