"""Measurements whose materials are known: a library is calibrated with them, or judged by them as it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.validation import validate
from pbrdf.errors import FitError
from pbrdf.identification.conformal import calibrate, nominal, probabilities
from pbrdf.identification.confusion import Confusion, table_of
from pbrdf.identification.evidence import evidence
from pbrdf.identification.fitted_parameters import FittedParameters, parameters_explained
from pbrdf.identification.identify import check_request, shares, unknown_gain
from pbrdf.identification.identify_fit import fitted_data, has_gain, require_no_treatment
from pbrdf.identification.library import Library
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.result import FitResult

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Labelled", "calibrate_library", "judge_labelled", "labelled_evidence"]

#: A material's name, and a data set, a fit, or parameters of a fit of one of its specimens.
Labelled = tuple[str, "xr.Dataset | FitResult | FittedParameters"]


def calibrate_library(
    library: Library,
    labelled: Sequence[Labelled],
    *,
    gain: bool | None = None,
    angle: float | None = None,
    noise: Noise | str | None = None,
    measurements: str = "",
) -> Library:
    """The library with a calibration by measurements whose materials are known.

    Parameters
    ----------
    library
        The materials.
    labelled
        Pairs of a material's name and a data set, or a fit.
    gain, angle, noise
        As for :func:`pbrdf.identify`: the calibration holds for measurements that are treated alike.
    measurements
        Where they come from, in words.

    Raises
    ------
    FitError
        If a label is none of the library's materials, or there are no measurements.
    """
    truth = np.array([library.names.index(library[name].name) for name, _ in labelled], dtype=int)
    found = labelled_evidence(library, labelled, gain=gain, angle=angle, noise=noise)
    return Library(library.materials, calibrate(library.names, *found, truth, measurements))


def judge_labelled(
    library: Library,
    labelled: Sequence[Labelled],
    *,
    confidence: float = 0.95,
    gain: bool | None = None,
    angle: float | None = None,
    noise: Noise | str | None = None,
    prior: Mapping[str, float] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Confusion:
    """What measurements of known materials are taken for, with the library and its calibration as they are.

    Parameters
    ----------
    library, confidence, gain, angle, noise, prior
        See :func:`pbrdf.identify`.
    labelled
        As of :func:`calibrate_library`; a name that the library has not got is an unknown material, whose set is right
        if it is empty.
    progress
        Called with the number of finished measurements and of all.

    Raises
    ------
    FitError, DataError
        As for :func:`pbrdf.identify`, or if there are no measurements.
    """
    check_request(library, confidence)
    share = shares(library, prior)
    log_evidence, scores = labelled_evidence(
        library, labelled, gain=gain, angle=angle, noise=noise, progress=progress
    )
    used = library.calibration
    probability = probabilities(log_evidence, share, 1.0 if used is None else used.temperature)
    p_value = scores if used is None else used.p_values(scores)
    strangers = list(dict.fromkeys(name for name, _ in labelled if name not in library.names))
    labels = [*library.names, *strangers]
    truth = np.array([labels.index(name) for name, _ in labelled])
    return table_of(library.names, truth, probability, p_value > 1.0 - confidence, confidence, strangers)


def labelled_evidence(
    library: Library,
    labelled: Sequence[Labelled],
    *,
    gain: bool | None = None,
    angle: float | None = None,
    noise: Noise | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """How well each material explains measurements.

    Parameters
    ----------
    library, labelled, gain, angle, noise
        See :func:`calibrate_library`.
    progress
        Called with the number of finished measurements and of all.

    Returns
    -------
    log_evidence, scores
        Shape (B, C) each, as of :func:`pbrdf.identification.conformal.calibrate`.

    Raises
    ------
    FitError, DataError
        If there are no measurements, or one is not valid.
    """
    if not labelled:
        raise FitError("there are no labelled measurements")
    if isinstance(noise, str):
        noise = parse_noise(noise)
    log_evidence = np.empty((len(labelled), len(library.materials)))
    scores, done = np.empty_like(log_evidence), 0
    # those of one form are looked at together
    alike: dict[Any, list[tuple[int, Observations]]] = {}
    for number, (_, measured) in enumerate(labelled):
        if isinstance(measured, FittedParameters):
            require_no_treatment(gain, angle, noise)
            found = parameters_explained(library.materials, measured)
            log_evidence[number] = found.log_evidence[0]
            scores[number] = nominal(found.distance, found.degrees_of_freedom)[0]
            done += 1
            continue
        observed, free = _compared(measured, gain, noise)
        form = observed.channels, observed.values.shape, observed.illumination, free
        alike.setdefault(form, []).append((number, observed))
    for (*_, free), members in alike.items():
        at = [number for number, _ in members]
        found = evidence(library.materials, [one for _, one in members], gain=free, angle=angle)
        log_evidence[at] = found.log_evidence
        scores[at] = nominal(found.distance, found.degrees_of_freedom)
        done += len(members)
        if progress is not None:
            progress(done, len(labelled))
    return log_evidence, scores


def _compared(
    measured: xr.Dataset | FitResult, gain: bool | None, noise: Noise | None
) -> tuple[Observations, bool]:
    """The data as they are compared, and whether a factor of them is not known."""
    if isinstance(measured, FitResult):
        return fitted_data(measured, noise)[0], has_gain(measured) if gain is None else gain
    validate(measured)
    return Observations.from_dataset(measured, noise), unknown_gain(measured) if gain is None else gain
