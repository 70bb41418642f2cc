"""Which of a library's materials a measurement shows: a set at a stated confidence, probabilities, or none of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import NORMALISED, is_ratio, with_group
from pbrdf.data.validation import validate
from pbrdf.errors import FitError
from pbrdf.identification.conformal import Calibration, nominal, probabilities
from pbrdf.identification.evidence import Evidence, evidence
from pbrdf.identification.library import Library
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.observations import Observations
from pbrdf.presentation import presenter_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Candidate",
    "Identification",
    "arbitrary_scale",
    "check_request",
    "identification_of",
    "identify",
    "identify_observations",
    "shares",
    "unknown_gain",
]


#: p-value by χ² below which chance is no explanation any more: a measurement is then none of the material's.
FAR = 1e-3


@dataclass(frozen=True)
class Candidate:
    """One material as a candidate for a measurement.

    Attributes
    ----------
    name
        Of the material.
    probability
        That it is this one, given that it is one of the library.
    p_value
        How often a measurement of this material is as unlike it as this one.
    distance
        Squared Mahalanobis distance of the measurement from what the material's specimens give.
    values
        Most likely parameters of the specimen by name.
    accepted
        Whether it belongs to the set.
    """

    name: str
    probability: float
    p_value: float
    distance: float
    values: dict[str, float]
    accepted: bool


@dataclass(frozen=True, repr=False)
class Identification:
    """What a measurement says about the materials of a library.

    ``print(identification)`` shows what the command ``pbrdf identify`` prints; a notebook shows a table.

    Attributes
    ----------
    candidates
        All materials, the most probable first.
    confidence
        Of the set.
    degrees_of_freedom
        Of the χ² that the distances follow.
    gain
        Whether a common factor of the intensities was taken as not known.
    angle
        Standard deviation of the offset of the sample's angle in radians; None for none.
    noise
        Where the uncertainties come from, in words.
    calibration
        In words, what the p-values rest on.
    data
        The measurement as it was compared; None where fitted parameters were.
    library
        The library, with the calibration that was used.
    temperature
        What logarithms of likelihoods were divided by.
    prior
        How common the materials were taken to be, by name; empty for all alike.
    dataset
        The data set that was identified, None where there is none.
    """

    candidates: tuple[Candidate, ...]
    confidence: float
    degrees_of_freedom: int
    gain: bool
    angle: float | None
    noise: str
    calibration: str
    data: Observations | None = field(repr=False)
    library: Library = field(repr=False)
    temperature: float = 1.0
    prior: Mapping[str, float] = field(default_factory=dict)
    dataset: xr.Dataset | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        names = ", ".join(self.materials) or "none of these"
        return (
            f"<Identification: {names} at {100.0 * self.confidence:g} %, {len(self.candidates)} candidates>"
        )

    def __str__(self) -> str:
        return self.summary().rstrip()

    def _repr_html_(self) -> str:
        return str(presenter_of("identification").html(self))

    def summary(self) -> str:
        """What ``pbrdf identify`` prints: the set, the candidates, what the answer rests on."""
        return str(presenter_of("identification").summary(self))

    @property
    def materials(self) -> list[str]:
        """The set: names of the materials that the measurement may show at the stated confidence, may be empty."""
        return [candidate.name for candidate in self.candidates if candidate.accepted]

    @property
    def none_of_these(self) -> bool:
        """Whether the measurement is like none of the library's materials."""
        return not self.materials

    @property
    def far_from_all(self) -> bool:
        """Whether it is so unlike every material that probabilities among them say nothing of the sample.

        They add up to 1 whatever was measured. Where even the likeliest specimen of every material is beyond chance,
        their ratios are those of the tails of normal distributions, at which nobody has ever looked.
        """
        distance = np.array([[candidate.distance for candidate in self.candidates]])
        by_chance = nominal(distance, np.array([self.degrees_of_freedom]))
        return self.none_of_these and bool((by_chance < FAR).all())

    def __getitem__(self, name: str) -> Candidate:
        for candidate in self.candidates:
            if candidate.name == name:
                return candidate
        raise KeyError(name)


def unknown_gain(dataset: xr.Dataset) -> bool:
    """Whether a factor of the intensities is not known: their scale is arbitrary, or they are radiances or counts."""
    return arbitrary_scale(dataset.attrs["quantity"], dataset.attrs.get("scale"))


def arbitrary_scale(quantity: str | None, scale: str | None) -> bool:
    """Whether data of this quantity, with what is stated of their scale, have an unknown factor."""
    if quantity == NORMALISED:
        return False
    if scale is not None:
        return scale == "arbitrary"
    return quantity in ("radiance", "dn")


def identify(
    dataset: xr.Dataset,
    library: Library,
    *,
    confidence: float = 0.95,
    gain: bool | None = None,
    angle: float | None = None,
    noise: Noise | str | None = None,
    prior: Mapping[str, float] | None = None,
    calibration: Calibration | None = None,
) -> Identification:
    """Identify the material of a measurement.

    Parameters
    ----------
    dataset
        Data set of the project's schema, any geometries.
    library
        The materials.
    confidence
        How often the set is to hold the true material, 0 to 1.
    gain
        Whether a common factor of the intensities is not known; None takes what the data set says of its scale.
    angle
        Standard deviation of an offset of the sample's angle in radians (in the plane of incidence); None for none.
    noise
        Stated noise, see :func:`pbrdf.fit`.
    prior
        How common the materials are, by name; those left out share what is left of 1. None: all alike.
    calibration
        Of measurements like this one; None takes the library's, and where it has none, the χ² of a linear model.

    Raises
    ------
    FitError, DataError
        If the library is empty, an option is none, or the data are not valid.
    """
    validate(dataset)
    dataset = with_group(dataset)
    if isinstance(noise, str):
        noise = parse_noise(noise)
    observed = Observations.from_dataset(dataset, noise)
    found = identify_observations(
        observed,
        library,
        confidence=confidence,
        gain=unknown_gain(dataset) if gain is None else gain,
        angle=angle,
        noise="stated" if noise is not None else "of the data set" if observed.std_known else "assumed",
        prior=prior,
        calibration=calibration,
    )
    return replace(found, dataset=dataset)


def identify_observations(
    observed: Observations,
    library: Library,
    *,
    confidence: float,
    gain: bool,
    angle: float | None,
    noise: str,
    prior: Mapping[str, float] | None,
    calibration: Calibration | None,
) -> Identification:
    """Identify the material of plain arrays; ``noise`` in words, all else as for :func:`identify`."""
    check_request(library, confidence)
    gain = gain and not all(is_ratio(channel) for channel in observed.channels)
    return identification_of(
        evidence(library.materials, [observed], gain=gain, angle=angle),
        library,
        confidence=confidence,
        gain=gain,
        angle=angle,
        noise=noise,
        prior=prior,
        calibration=calibration,
        data=observed,
    )


def identification_of(
    found: Evidence,
    library: Library,
    *,
    confidence: float,
    gain: bool,
    angle: float | None,
    noise: str,
    prior: Mapping[str, float] | None,
    calibration: Calibration | None,
    data: Observations | None,
) -> Identification:
    """Set and probabilities from what one measurement says of each material; all else as :func:`identify` has it."""
    used = calibration or library.calibration
    words = "χ² of a linear model with Gaussian scatter; no calibration"
    if used is not None:
        words = used.measurements or "labelled measurements"
    return Identification(
        candidates=_candidates(found, library, confidence, shares(library, prior), used),
        confidence=confidence,
        degrees_of_freedom=int(found.degrees_of_freedom[0]),
        gain=gain,
        angle=angle,
        noise=noise,
        calibration=words,
        data=data,
        library=library if calibration is None else replace(library, calibration=calibration),
        temperature=1.0 if used is None else used.temperature,
        prior=dict(prior or {}),
    )


def check_request(library: Library, confidence: float) -> None:
    """Raise FitError if the library is empty or the confidence is none."""
    if not library.materials:
        raise FitError("the library has no material: add one first (`pbrdf library add NAME FIT`)")
    if not 0.0 < confidence < 1.0:
        raise FitError(f"confidence={confidence:g}: give a number between 0 and 1, like 0.95")


def shares(library: Library, prior: Mapping[str, float] | None) -> np.ndarray:
    """Prior probabilities from those stated by name, shape (C,); raises FitError where they are none."""
    count = len(library.materials)
    if not prior:
        return np.full(count, 1.0 / count)
    for name, share in prior.items():
        _ = library[name]
        if not 0.0 <= share <= 1.0:
            raise FitError(f"prior: {name}={share:g} must be within 0 … 1")
    stated = sum(prior.values())
    others = count - len(prior)
    if stated > 1.0 + 1e-9 or (others == 0 and abs(stated - 1.0) > 1e-6):
        raise FitError(f"prior: the shares add up to {stated:g}, they must add up to 1")
    rest = max(1.0 - stated, 0.0) / others if others else 0.0
    return np.array([prior.get(name, rest) for name in library.names])


def _candidates(
    found: Evidence, library: Library, confidence: float, prior: np.ndarray, calibration: Calibration | None
) -> tuple[Candidate, ...]:
    temperature = 1.0 if calibration is None else calibration.temperature
    share = probabilities(found.log_evidence, prior, temperature)[0]
    p = nominal(found.distance, found.degrees_of_freedom)
    if calibration is not None:
        p = calibration.p_values(p)
    made = [
        Candidate(
            name=material.name,
            probability=float(share[c]),
            p_value=float(p[0, c]),
            distance=float(found.distance[0, c]),
            values={
                **material.space.fixed,
                **dict(zip(material.space.names, map(float, found.values[c][0]), strict=True)),
            },
            accepted=bool(p[0, c] > 1.0 - confidence),
        )
        for c, material in enumerate(library.materials)
    ]
    return tuple(sorted(made, key=lambda candidate: -candidate.probability))
