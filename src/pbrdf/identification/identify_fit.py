"""Identification of a fit: by the data that it was made of."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace

from pbrdf.identification.conformal import Calibration
from pbrdf.identification.identify import Identification, identify_observations, unknown_gain
from pbrdf.identification.library import Library
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.stored_result import load_fit

__all__ = ["identify_fit"]


def identify_fit(
    fit: FitResult | str | os.PathLike[str],
    library: Library,
    *,
    confidence: float = 0.95,
    gain: bool | None = None,
    angle: float | None = None,
    prior: Mapping[str, float] | None = None,
    calibration: Calibration | None = None,
) -> Identification:
    """Identify the material that was fitted.

    The fitted data are compared, not the fitted parameters: the materials may have other models than the fit. Where the
    uncertainties of the data are only assumed, they are scaled to what the fit missed.

    Parameters
    ----------
    fit
        A fit, or the folder that ``pbrdf fit`` or :meth:`FitResult.save` wrote.
    library, confidence, angle, prior, calibration
        See :func:`pbrdf.identification.identify.identify`.
    gain
        Whether a common factor of the intensities is not known; None: where the fit had one, or the data set says so.

    Raises
    ------
    FitError, DataError
        As for :func:`pbrdf.identification.identify.identify`, or if there is no fit in the folder.
    """
    if not isinstance(fit, FitResult):
        fit = load_fit(fit)
    observed, noise = fit.data, "of the fit"
    scale = fit.goodness.reduced_chi2
    if not fit.std_known and math.isfinite(scale) and scale > 0.0:
        observed = replace(observed, std=observed.std * math.sqrt(scale))
        noise = "assumed, scaled to what the fit missed"
    if gain is None:
        gain = unknown_gain(fit.dataset) or any(t.nuisance and t.role == "gain" for t in fit.space.terms)
    found = identify_observations(
        observed,
        library,
        confidence=confidence,
        gain=gain,
        angle=angle,
        noise=noise,
        prior=prior,
        calibration=calibration,
    )
    return replace(found, dataset=fit.dataset)
