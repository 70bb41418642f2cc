"""What was identified, together with what it was made of, its table, and the sentences that say what it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.identify import Candidate, Identification
from pbrdf.identification.library import Library
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.identification.library_summary import scatter_in_words
from pbrdf.report.numbers import brief, per_cent

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.fitted_parameters import FittedParameters
    from pbrdf.identification.telling_apart import NextMeasurement

__all__ = [
    "HEADINGS",
    "Identified",
    "calibration_sentence",
    "joined",
    "level_of",
    "nearest_rejected",
    "p_value_in_words",
    "prior_in_words",
    "probability_in_words",
    "rests_on",
    "rows_of",
    "scatter_sentence",
    "sentence",
]

HEADINGS = ("material", "probability", "p-value", "in the set", "scatter between specimens")
#: Wavelengths that differ by more are not the same, nm.
_OTHER_WAVELENGTH = 5.0
#: A probability below this, or above one less this, is only said to be beyond it.
_EXTREME = 1e-3
#: A p-value below this is only said to be below it.
_SMALLEST = 1e-3


@dataclass(frozen=True)
class Identified:
    """A measurement that was identified.

    Attributes
    ----------
    found
        What was found.
    dataset
        The measurement; None where only fitted parameters were at hand.
    name
        What to call it: a file, a folder or a bundled paint.
    library
        What to call the library.
    prior
        How common the materials were taken to be, by name; empty for all alike.
    settings
        How it was asked for, in plain values.
    command
        The command line, where there was one.
    sha256
        That of the file; empty where the data came from elsewhere.
    next_measurement
        Which reading would tell the remaining candidates apart; None where there is nothing to tell or none was asked
        for.
    fitted
        The fitted parameters that were compared in place of data.
    """

    found: Identification
    dataset: xr.Dataset | None
    name: str
    library: str
    prior: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: str = ""
    sha256: str = ""
    next_measurement: NextMeasurement | None = None
    fitted: FittedParameters | None = None

    @property
    def title(self) -> str:
        """What to call it in a heading."""
        return Path(self.name).name if self.dataset is None else short_name(self.name, self.dataset)

    @property
    def simulated(self) -> bool:
        """Whether a model produced the data."""
        if self.dataset is None:
            return self.fitted is not None and self.fitted.simulated
        return bool(self.dataset.attrs.get("simulated"))


def sentence(found: Identification) -> str:
    """What the measurement shows, in one sentence."""
    names, at = found.materials, f"{100.0 * found.confidence:g} %"
    if not names:
        best = max(found.candidates, key=lambda candidate: candidate.p_value)
        return (
            f"none of these: unlike every material of the library at {at}; the least unlike is {best.name} "
            f"(p-value {p_value_in_words(best.p_value)})"
        )
    if len(names) == 1:
        return f"{names[0]}: the only material in the {at} set"
    return f"{joined(names, 'or')}: at {at} the measurement does not tell them apart"


def level_of(found: Identification) -> str:
    """How much was told, in the words that give a verdict its colour."""
    return {0: "not", 1: "describes"}.get(len(found.materials), "in part")


def nearest_rejected(found: Identification) -> Candidate | None:
    """The material outside of the set that is least unlike the measurement; None if all are inside."""
    outside = [candidate for candidate in found.candidates if not candidate.accepted]
    return min(outside, key=lambda candidate: (-candidate.p_value, candidate.distance), default=None)


def rows_of(found: Identification) -> list[list[str]]:
    """The candidates as texts below :data:`HEADINGS`."""
    return [
        [
            candidate.name,
            probability_in_words(candidate.probability),
            p_value_in_words(candidate.p_value),
            "yes" if candidate.accepted else "no",
            scatter_in_words(found.library[candidate.name]),
        ]
        for candidate in found.candidates
    ]


def probability_in_words(probability: float) -> str:
    """``93.2 %``, and no 100 % that nobody can know."""
    if not math.isfinite(probability):
        return "–"
    if probability > 1.0 - _EXTREME:
        return "> 99.9 %"
    if probability < _EXTREME:
        return "< 0.1 %"
    return f"{100.0 * probability:.1f} %"


def p_value_in_words(p_value: float) -> str:
    """With two digits; what is very small is only said to be."""
    return brief(p_value, 2) if p_value >= _SMALLEST else f"< {_SMALLEST:g}"


def rests_on(report: Identified) -> list[str]:
    """Sentences on what the answer rests on."""
    found = report.found
    lines = [calibration_sentence(found.library), scatter_sentence(found.library)]
    if found.data is None:
        lines.append(
            "From fitted parameters, as the data were not at hand: what the fit says of their errors counts as it "
            "stands, and a misfit of its model is not seen."
        )
        return [*lines, prior_in_words(report.prior)]
    if all("_over_" in name or name == "dolp" for name in found.data.channels):
        lines.append("Gain: the data are ratios, which no gain touches.")
    elif found.gain:
        lines.append("Gain: a common factor of the intensities was taken as not known, and integrated over.")
    else:
        lines.append("Gain: known; the intensities count as absolute.")
    if found.angle is not None:
        lines.append(
            f"Angle: an offset of the sample of {brief(math.degrees(found.angle), 2)}° (one standard deviation) was "
            "integrated over."
        )
    lines.append(
        f"Noise: {found.noise}"
        + (
            "; nothing stated it, and p-values are as good as the assumption."
            if found.noise == "assumed"
            else "."
        )
    )
    lines.append(prior_in_words(report.prior))
    lines += _other_wavelength(report)
    return lines


def calibration_sentence(library: Library) -> str:
    """What makes the sets hold what they promise."""
    if library.calibration is None:
        return (
            "Sets: not calibrated. They hold the true material as often as they say if specimens scatter as the "
            "library says and the noise is right (χ²); `pbrdf identify --calibrate` makes sure."
        )
    words = library.calibration.measurements or "labelled measurements"
    total = sum(map(len, library.calibration.scores))
    bare = [
        name
        for name, own in zip(library.calibration.names, library.calibration.scores, strict=True)
        if not len(own)
    ]
    without = f"; none of {joined(bare, 'or')}, for which χ² counts" if bare else ""
    return f"Sets: calibrated with {total} measurements of known materials ({words}{without})."


def scatter_sentence(library: Library) -> str:
    """Where the scatter between specimens comes from."""
    assumed = [m.name for m in library.materials if m.scatter == "assumed"]
    if not assumed:
        return "Scatter between specimens: estimated for every material."
    if len(assumed) == len(library.materials):
        return "Scatter between specimens: assumed for every material; nobody measured how specimens differ."
    return (
        f"Scatter between specimens: assumed for {joined(assumed, 'and')} (nobody measured how specimens differ), "
        "estimated for the others."
    )


def prior_in_words(prior: Mapping[str, float]) -> str:
    """What probabilities count on."""
    before = "all materials alike beforehand"
    if prior:
        stated = ", ".join(f"{name} {per_cent(share)}" for name, share in prior.items())
        before = f"beforehand {stated}, the others share the rest"
    return f"Probabilities: given that it is a material of the library, {before}."


def _other_wavelength(report: Identified) -> list[str]:
    if report.dataset is None or "wavelength" not in report.dataset.coords:
        return []
    own = report.dataset["wavelength"].values
    own = own[np.isfinite(own)]
    if not own.size:
        return []
    low, high = float(own.min()), float(own.max())
    others = [
        f"{m.name} ({m.wavelength:g} nm)"
        for m in report.found.library.materials
        if m.wavelength < low - _OTHER_WAVELENGTH or m.wavelength > high + _OTHER_WAVELENGTH
    ]
    if not others:
        return []
    span = f"{low:g} nm" if high - low < 1e-6 else f"{low:g} … {high:g} nm"
    return [f"Caution: the data are of {span}, other than {joined(others, 'and')}."]


def joined(names: Sequence[str], word: str) -> str:
    """``a, b or c``"""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"
