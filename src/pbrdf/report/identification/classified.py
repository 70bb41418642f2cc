"""A map of materials together with what it was made of, its table, and the sentences that say what it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pbrdf.identification.confusion import Confusion
from pbrdf.identification.library import Library
from pbrdf.inversion.noise import NoiseModel, parse_noise
from pbrdf.report.identification.class_figure import ClassCount, class_counts
from pbrdf.report.identification.subject import (
    calibration_sentence,
    cautions_on,
    library_in_words,
    prior_in_words,
    probability_in_words,
    scatter_sentence,
)
from pbrdf.report.numbers import brief, per_cent
from pbrdf.wording import joined

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CLASS_HEADINGS", "Classified", "class_rows", "classes_rest_on", "classes_sentence"]

CLASS_HEADINGS = ("material", "pixels", "share of measured", "median probability")


@dataclass(frozen=True)
class Classified:
    """A map of materials.

    Attributes
    ----------
    found
        As :func:`pbrdf.identify_map` gives it.
    name
        What to call the map it was made of.
    materials
        The library, and ``library`` what to call it.
    library
        What to call the library.
    gain
        Whether each pixel's intensities were taken with a factor that is not known; None for a map of parameters.
    simulated
        Whether a model produced the data of the map.
    prior, settings, command
        As of :class:`pbrdf.report.identification.subject.Identified`.
    labelled
        What pixels of known materials were taken for; None where no labels were given.
    labels
        What to call the labels.
    """

    found: xr.Dataset
    name: str
    materials: Library
    library: str
    gain: bool | None = None
    simulated: bool = False
    prior: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""
    labelled: Confusion | None = None
    labels: str = ""

    @cached_property
    def counts(self) -> list[ClassCount]:
        """Pixels by material, then none of these and not measured."""
        return class_counts(self.found)

    @property
    def confidence(self) -> float:
        """Of the sets."""
        return float(self.found.attrs["confidence"])


def classes_sentence(report: Classified) -> str:
    """What the map shows, in one sentence."""
    *materials, none, without = report.counts
    measured = sum(count.pixels for count in (*materials, none))
    if not measured:
        return "no pixel was measured"
    seen = sorted((c for c in materials if c.pixels), key=lambda count: -count.pixels)
    parts = [f"{count.name} {per_cent(count.share)}" for count in seen[:5]]
    if len(seen) > 5:
        parts.append(f"{len(seen) - 5} others")
    parts.append(f"none of these {per_cent(none.share)}")
    left = f"; {without.pixels} more were not measured" if without.pixels else ""
    return f"of {measured} measured pixels {joined(parts, 'and')}{left}"


def class_rows(report: Classified) -> list[list[str]]:
    """The classes as texts below :data:`CLASS_HEADINGS`."""
    return [
        [
            count.name,
            str(count.pixels),
            per_cent(count.share),
            probability_in_words(count.confidence),
        ]
        for count in report.counts
    ]


def _noise(report: Classified) -> float | None:
    """Noise that was stated, relative to the intensity; None for fitted parameters, whose errors nobody states."""
    if report.gain is None:
        return None
    stated = report.settings.get("noise")
    noise = None if stated is None else parse_noise(stated)
    return math.hypot(noise.relative, noise.absolute) if isinstance(noise, NoiseModel) else math.nan


def classes_rest_on(report: Classified) -> list[str]:
    """Sentences on what the map rests on."""
    lines = [
        *cautions_on(report.materials, _noise(report)),
        f"Library: {library_in_words(report.library, report.materials)}.",
        f"Each pixel by itself; its set at {100.0 * report.confidence:g} % misses the true material in "
        f"{100.0 * (1.0 - report.confidence):.3g} % of the pixels even where all is right: these are none of these, or "
        "another material.",
        calibration_sentence(report.materials, report.confidence),
        scatter_sentence(report.materials),
    ]
    if report.gain is None:
        lines.append("From fitted parameters: what the fit says of their errors counts as it stands.")
    elif report.gain:
        lines.append(
            "Gain: a common factor of each pixel's intensities was taken as not known, and integrated over."
        )
    else:
        lines.append("Gain: known; the intensities count as absolute.")
    if report.gain is not None:
        stated = report.settings.get("noise") is not None
        lines.append(f"Noise: {'stated' if stated else 'of the data, or assumed where these state none'}.")
    lines.append(prior_in_words(report.prior))
    smoothing = float(report.found.attrs.get("smoothing", 0.0))
    if smoothing:
        lines.append(
            f"Smoothed over neighbours ({brief(smoothing, 3)} pixels) before likelihoods became probabilities: fine "
            "detail is lost, and neighbours count as one material."
        )
    return lines
