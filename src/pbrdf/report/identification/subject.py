"""What was identified, together with what it was made of, its table, and the sentences that say what it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.identify import Candidate, Identification
from pbrdf.identification.library import Library
from pbrdf.identification.material import Material
from pbrdf.identification.specimen_fits import relative_noise
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.identification.library_summary import scatter_in_words
from pbrdf.report.numbers import brief, per_cent
from pbrdf.wording import joined

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.fitted_parameters import FittedParameters
    from pbrdf.identification.telling_apart import NextMeasurement

__all__ = [
    "CAUTION",
    "HEADINGS",
    "Identified",
    "calibration_sentence",
    "cautions_on",
    "fewest_needed",
    "level_of",
    "nearest_rejected",
    "p_value_in_words",
    "prior_in_words",
    "probability_in_words",
    "ranked",
    "rests_on",
    "rows_of",
    "scatter_sentence",
    "sentence",
    "shown_probability",
]

#: How sentences begin without which an answer is not to be read.
CAUTION = "Caution: "
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
    best = nearest_rejected(found)
    if not names and best is not None:
        size = f"p-value {p_value_in_words(best.p_value)}"
        if found.far_from_all:
            times = _times(best.distance / max(found.degrees_of_freedom, 1))
            size = f"which misses by {brief(times, 2)} times what noise and scatter explain"
        return f"none of these: unlike every material of the library at {at}; the least unlike is {best.name} ({size})"
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


def ranked(found: Identification) -> list[Candidate]:
    """The candidates, the most probable first; where probabilities say nothing, the least unlike."""
    if found.far_from_all:
        return sorted(found.candidates, key=lambda candidate: candidate.distance)
    return list(found.candidates)


def shown_probability(found: Identification, candidate: Candidate) -> float:
    """Probability of a candidate; NaN where probabilities say nothing."""
    return math.nan if found.far_from_all else candidate.probability


def rows_of(found: Identification) -> list[list[str]]:
    """The candidates as texts below :data:`HEADINGS`."""
    return [
        [
            candidate.name,
            probability_in_words(shown_probability(found, candidate)),
            p_value_in_words(candidate.p_value),
            "yes" if candidate.accepted else "no",
            scatter_in_words(found.library[candidate.name]),
        ]
        for candidate in ranked(found)
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
    lines = cautions_on(found.library, None if found.data is None else relative_noise(found.data))
    lines += _other_wavelength(report)
    lines.append(f"Library: {library_in_words(report.library, found.library)}.")
    lines += [calibration_sentence(found.library, found.confidence), scatter_sentence(found.library)]
    if found.data is None:
        lines.append(
            "From fitted parameters, as the data were not at hand: what the fit says of their errors counts as it "
            "stands, and a misfit of its model is not seen."
        )
        return [*lines, _probabilities(report)]
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
    return [*lines, _probabilities(report)]


def _probabilities(report: Identified) -> str:
    """What probabilities count on, or that they say nothing."""
    if report.found.far_from_all:
        return "Probabilities: none. They would say which material it is if it is one of these, and it is unlike all."
    return prior_in_words(report.prior)


def library_in_words(name: str, library: Library) -> str:
    """``paints.json, 3 materials``"""
    count = len(library.materials)
    return f"{name}, {count} material{'' if count == 1 else 's'}"


def cautions_on(library: Library, noise: float | None = math.nan) -> list[str]:
    """Sentences on materials whose own fits are in doubt.

    Parameters
    ----------
    library
        The materials.
    noise
        Uncertainty of what is compared, relative to the intensity; NaN where it is not known, None where nobody can
        state it.
    """
    lines = []
    missed = [m for m in library.materials if m.fits.misfits(math.nan if noise is None else noise)]
    if missed:
        listed = joined([misfit_in_words(m) for m in missed], "and")
        largest = max((m.fits.missed for m in missed if math.isfinite(m.fits.missed)), default=math.nan)
        stated = ""
        if noise is not None and math.isfinite(largest):
            stated = f", or state noise that covers it (`--noise {_stated(largest)}`)"
        sets = (
            "sets are calibrated and hold all the same, probabilities may not"
            if library.calibration is not None
            else "a wrong material may be named, or none"
        )
        lines.append(
            f"{CAUTION}the library's model misses its own specimens of {listed}. That counts here as if it told "
            f"materials apart: {sets}. Find a model that describes them (`pbrdf compare DATA`, then "
            f"`pbrdf library add NAME DATA --model MODEL`){stated}."
        )
    doubted = [m.name for m in library.materials if m.fits.cautions]
    if doubted:
        lines.append(
            f"{CAUTION}the fits behind {joined(doubted, 'and')} are not sound in every respect: "
            f"`pbrdf library show` says why."
        )
    return lines


def _stated(noise: float) -> str:
    """A relative noise as the option that gives it, whose absolute part is as large where the intensity is usual."""
    return f"{math.ceil(100.0 * noise / math.sqrt(2.0) - 1e-6)}%"


def misfit_in_words(material: Material) -> str:
    """``white (by 5.2 times their uncertainty, 12 % of the intensity)``"""
    fits = material.fits
    size = "" if math.isnan(fits.missed) else f", {per_cent(fits.missed)} of the signal"
    return f"{material.name} (by {brief(_times(fits.reduced_chi2), 2)} times their uncertainty{size})"


def _times(by_degree: float) -> float:
    """χ² by degree of freedom as how many times larger misfits are than chance has them (rms)."""
    return math.sqrt(max(by_degree, 0.0))


def fewest_needed(confidence: float) -> int:
    """Measurements of a material below which a calibration can exclude nothing at this confidence."""
    return math.ceil(round(1.0 / (1.0 - confidence), 9)) - 1


def calibration_sentence(library: Library, confidence: float) -> str:
    """What makes the sets hold what they promise, and which materials they can never leave out."""
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
    needed = fewest_needed(confidence)
    few = [
        f"{name} ({len(own)})"
        for name, own in zip(library.calibration.names, library.calibration.scores, strict=True)
        if 0 < len(own) < needed
    ]
    always = ""
    if few:
        always = (
            f" The set holds {joined(few, 'and')} whatever was measured: it takes {needed} measurements of a material "
            f"to leave it out at {100.0 * confidence:g} %; calibrate with more, or ask for less confidence."
        )
    return f"Sets: calibrated with {total} measurements of known materials ({words}{without}).{always}"


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
    return [f"{CAUTION}the data are of {span}, other than {joined(others, 'and')}."]
