"""Whether the data contradict the conventions that they were read by.

A file that does not say where φ = 0 lies, what Q > 0 means, whether its values carry the cosine of the viewing angle or
are per cent is read by an assumption, and one that says may be wrong. Each reading is one change of the data; the same
model fitted to the changed data tells by its χ² whether they make more sense that way.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data import conventions
from pbrdf.data.schema import COVARIANCE
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.suggestions import TIME
from pbrdf.inversion.trials import Clock, Suggestion, some_of, trial, trial_arguments
from pbrdf.inversion.verdict import Level

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["contradicted_conventions", "readings"]

#: χ² falls to this share or less where the data contradict a convention …
CONTRADICTED = 0.5
#: … and the verdict becomes a better one, or χ² falls to this share.
PLAINLY = 0.1
_BETTER = {Level.NOT_CONVERGED: -1, Level.DOES_NOT: 0, Level.IN_PART: 1, Level.DESCRIBES: 2}
_RADIOMETRIC = ("I", "Q", "U", "V", "mueller")


def contradicted_conventions(
    dataset: xr.Dataset,
    result: FitResult,
    fit_arguments: Mapping[str, Any],
    *,
    until: float | None = None,
) -> list[Suggestion]:
    """Other readings of the data under which the model fits them far better.

    Parameters
    ----------
    dataset, result
        The data and the fit that does not describe them.
    fit_arguments
        Arguments of that fit, as for :func:`pbrdf.fit`.
    until
        When to stop, by :func:`time.monotonic`; None stops after :data:`~pbrdf.inversion.suggestions.TIME` seconds.

    Returns
    -------
    list of Suggestion
        The reading of the least χ² first; empty where none is contradicted.
    """
    clock = Clock(time.monotonic() + TIME if until is None else until)
    used = some_of(dataset)
    some = dataset.isel(geometry=used)
    arguments = trial_arguments(result, fit_arguments, used)
    before = trial(some, clock, **arguments)
    if before is None:
        return []
    found = []
    for option, words, change in readings(some):
        if not clock.allows():
            break
        after = trial(change(some), clock, **arguments)
        if after is None:
            continue
        share = after.goodness.chi2 / before.goodness.chi2 if before.goodness.chi2 > 0.0 else math.inf
        better = _BETTER[after.verdict().level] > _BETTER[before.verdict().level]
        if share <= CONTRADICTED and (better or share <= PLAINLY):
            found.append(_suggestion(option, words, before, after))
    return sorted(found, key=lambda s: s.chi2_after)


def _suggestion(option: str, words: str, before: FitResult, after: FitResult) -> Suggestion:
    errors = [r.fitted["all"].intensity_median for r in (before, after)]
    chi2 = [r.goodness.chi2 for r in (before, after)]
    sentence = (
        f"The data contradict the way they were read: {words}, the same model fits them with χ² {chi2[1]:.4g} "
        f"instead of {chi2[0]:.4g}; read them with {option}."
    )
    return Suggestion(option, errors[0], errors[1], chi2[0], chi2[1], sentence)


def readings(dataset: xr.Dataset) -> Iterator[tuple[str, str, Callable[[xr.Dataset], xr.Dataset]]]:
    """Other readings that make a difference to these data: option, words after "the data fit better", change.

    Those of conventions that were assumed come first.
    """
    assumed = " ".join(dataset.attrs.get("assumptions", ()))
    found = []
    if (dataset["theta_r"].values > 0.0).any():
        stated = "azimuth" not in assumed and "phi = 0" not in assumed
        option = "theta_r of the other sign" if "no azimuth" in assumed else "--azimuth forward=180"
        option += " (or forward=0 if that was stated)" if stated else ""
        found.append((stated, option, "with forward at the other end of the azimuth", _azimuth))
    if any(name in dataset for name in ("Q", "U", "aolp", "mueller")):
        stated = "Q > 0" not in assumed
        option = "--stokes s-p" + (" (or p-s if that was stated)" if stated else "")
        found.append((stated, option, "with Q and U of the other sign", _stokes))
    if "I" in dataset or "mueller" in dataset:
        found.append((True, "--cosine-weighted", "divided by cos θ_r", _divided_by_cosine))
        found.append((True, "--not-cosine-weighted", "multiplied by cos θ_r", _multiplied_by_cosine))
    if "dolp" in dataset and float(np.nanmax(dataset["dolp"].values, initial=0.0)) > 0.0:
        found.append((True, "DoLP divided by 100", "with DoLP taken as per cent", _dolp_in_percent))
    if dataset.attrs.get("quantity") == "reflectance_factor" and dataset.attrs.get("scale") != "arbitrary":
        found.append((True, "values divided by 100", "taken as per cent", _values_in_percent))
    for _, option, words, change in sorted(found, key=lambda item: item[0]):
        yield option, words, change


def _azimuth(dataset: xr.Dataset) -> xr.Dataset:
    turned = conventions.azimuth_forward_pi_to_zero(dataset["phi"].values)
    return dataset.assign_coords(phi=("geometry", turned, dataset["phi"].attrs))


def _stokes(dataset: xr.Dataset) -> xr.Dataset:
    changed = dataset.copy()
    for name in ("Q", "U"):
        if name in changed:
            changed[name] = -changed[name]
    if "aolp" in changed:
        changed["aolp"] = (changed["aolp"].dims, conventions.aolp_swap_sp(changed["aolp"].values))
    if "mueller" in changed:
        changed["mueller"] = (changed["mueller"].dims, conventions.mueller_swap_sp(changed["mueller"].values))
    if COVARIANCE in changed:
        swapped = conventions.covariance_swap_sp(changed[COVARIANCE].values)
        changed[COVARIANCE] = (changed[COVARIANCE].dims, swapped)
    changed.attrs["illumination"] = conventions.stokes_swap_sp(dataset.attrs["illumination"]).tolist()
    return changed


def _scaled(dataset: xr.Dataset, factor: np.ndarray) -> xr.Dataset:
    """Values and their uncertainties times a factor for each geometry."""
    changed = dataset.copy()
    for name in _RADIOMETRIC:
        for column in (name, f"{name}_std"):
            if column in changed:
                shape = (-1,) + (1,) * (changed[column].ndim - 1)
                changed[column] = (changed[column].dims, changed[column].values * factor.reshape(shape))
    if COVARIANCE in changed:
        values = changed[COVARIANCE].values * factor[:, None, None] ** 2
        changed[COVARIANCE] = (changed[COVARIANCE].dims, values)
    return changed


def _divided_by_cosine(dataset: xr.Dataset) -> xr.Dataset:
    return _scaled(dataset, 1.0 / np.cos(dataset["theta_r"].values))


def _multiplied_by_cosine(dataset: xr.Dataset) -> xr.Dataset:
    return _scaled(dataset, np.cos(dataset["theta_r"].values))


def _values_in_percent(dataset: xr.Dataset) -> xr.Dataset:
    return _scaled(dataset, np.full(dataset.sizes["geometry"], 0.01))


def _dolp_in_percent(dataset: xr.Dataset) -> xr.Dataset:
    changed = dataset.copy()
    for column in ("dolp", "dolp_std"):
        if column in changed:
            changed[column] = changed[column] / 100.0
    return changed
