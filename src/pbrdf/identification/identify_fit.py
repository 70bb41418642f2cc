"""Identification of a fit: by the data that it was made of, or by its parameters where these are all there is."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from pbrdf.errors import FitError
from pbrdf.identification.conformal import Calibration
from pbrdf.identification.fitted_parameters import (
    RECORD,
    FittedParameters,
    parameters_explained,
    read_fitted_parameters,
)
from pbrdf.identification.identify import (
    Identification,
    check_request,
    identification_of,
    identify_observations,
    unknown_gain,
)
from pbrdf.identification.library import Library
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.stored_result import FILE_NAME, load_fit

__all__ = ["fitted_data", "has_gain", "identify_fit", "open_fit", "require_no_treatment"]


def identify_fit(
    fit: FitResult | FittedParameters | str | os.PathLike[str],
    library: Library,
    *,
    confidence: float = 0.95,
    gain: bool | None = None,
    angle: float | None = None,
    noise: Noise | str | None = None,
    prior: Mapping[str, float] | None = None,
    calibration: Calibration | None = None,
) -> Identification:
    """Identify the material that was fitted.

    The fitted data are compared, not the fitted parameters: the materials may have other models than the fit, the
    gain and the angle may be open, and a misfit counts. Where the uncertainties of the data are only assumed, they are
    scaled to what the fit missed. Only where the data are not at hand the parameters are compared, with materials of
    the fit's model.

    Parameters
    ----------
    fit
        A fit, or the folder that ``pbrdf fit`` or :meth:`FitResult.save` wrote, or ``fit.nc`` or ``fit.json`` in it.
    library, confidence, angle, prior, calibration
        See :func:`pbrdf.identification.identify.identify`.
    gain
        Whether a common factor of the intensities is not known; None: where the fit had one, or the data set says so.
    noise
        Stated noise in place of the fit's, see :func:`pbrdf.fit`.

    Raises
    ------
    FitError, DataError
        As for :func:`pbrdf.identification.identify.identify`, if there is no fit in the folder, or if parameters are
        compared and gain, angle or noise are given or the materials are of another model.
    """
    if not isinstance(fit, (FitResult, FittedParameters)):
        fit = open_fit(fit)
    check_request(library, confidence)
    if isinstance(fit, FittedParameters):
        require_no_treatment(gain, angle, noise)
        return identification_of(
            parameters_explained(library.materials, fit),
            library,
            confidence=confidence,
            gain=False,
            angle=None,
            noise="what the fit says of its parameters' errors",
            prior=prior,
            calibration=calibration,
            data=None,
        )
    observed, words = fitted_data(fit, noise)
    found = identify_observations(
        observed,
        library,
        confidence=confidence,
        gain=has_gain(fit) if gain is None else gain,
        angle=angle,
        noise=words,
        prior=prior,
        calibration=calibration,
    )
    return replace(found, dataset=fit.dataset)


def open_fit(path: str | os.PathLike[str]) -> FitResult | FittedParameters:
    """A fit with its data, or where these are not there its parameters.

    Parameters
    ----------
    path
        The folder of the fit, or ``fit.nc`` or ``fit.json`` in it.

    Raises
    ------
    FitError, DataError
        If there is neither, or it cannot be read.
    """
    place = Path(path)
    if place.suffix.lower() == ".json":
        return read_fitted_parameters(place)
    if (place / RECORD).is_file() and not (place / FILE_NAME).is_file():
        return read_fitted_parameters(place / RECORD)
    return load_fit(place)


def fitted_data(fit: FitResult, noise: Noise | str | None = None) -> tuple[Observations, str]:
    """The data of a fit as they are compared, and in words where their uncertainties come from."""
    if noise is not None:
        stated = parse_noise(noise) if isinstance(noise, str) else noise
        return Observations.from_dataset(fit.dataset, stated), "stated"
    scale = fit.goodness.reduced_chi2
    if fit.std_known or not (math.isfinite(scale) and scale > 0.0):
        return fit.data, "of the fit"
    return (
        replace(fit.data, std=fit.data.std * math.sqrt(scale)),
        "assumed, scaled to what the fit missed",
    )


def has_gain(fit: FitResult) -> bool:
    """Whether the fit left a factor of the intensities open, or its data set does."""
    return unknown_gain(fit.dataset) or any(t.nuisance and t.role == "gain" for t in fit.space.terms)


def require_no_treatment(gain: bool | None, angle: float | None, noise: Noise | str | None) -> None:
    """Raise FitError where options of data are given for fitted parameters."""
    given = [
        name for name, value in (("gain", gain), ("angle", angle), ("noise", noise)) if value is not None
    ]
    if given:
        raise FitError(f"{', '.join(given)}: fitted parameters without their data need none: leave it out")
