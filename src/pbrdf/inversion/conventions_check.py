"""Whether the data contradict the conventions that they were read by.

A file that does not say where φ = 0 lies, what Q > 0 means, which of its angles is whose, whether its values carry a
cosine or are per cent is read by an assumption, and one that says may be wrong. Each reading is one change of the data;
the same model fitted to the changed data tells by its χ² whether they make more sense that way.
"""

from __future__ import annotations

import math
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data import conventions
from pbrdf.data.origin import origin_of
from pbrdf.data.schema import COVARIANCE, RATIOS
from pbrdf.inversion.noise import NoiseModel
from pbrdf.inversion.plausibility import Finding, Severity
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.trials import Clock, Suggestion, some_of, trial, trial_arguments
from pbrdf.inversion.verdict import Level
from pbrdf.optics.stokes import STOKES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["contradicted_conventions", "misfit", "readings"]

#: A reduced χ² above this is large, where the uncertainties are stated.
LARGE = 3.0
#: χ² falls to this share or less where the data contradict a convention …
CONTRADICTED = 0.5
#: … and the verdict becomes a better one, or χ² falls to this share.
PLAINLY = 0.1
#: Time for all trials, seconds: some 5 of work, on a machine that does other things too.
TIME = 25.0
#: A reading that leaves this share of χ², by which the model describes the data, is the right one: no more are tried.
_FOUND = 0.02
#: Geometries of a trial at most, and its starts: another reading has its optimum elsewhere.
_GEOMETRIES, _STARTS = 120, 8
#: Zenith angles below this many radians, all of them, may be degrees of radians.
_SMALL = math.radians(math.pi)
_BETTER = {Level.NOT_CONVERGED: -1, Level.DOES_NOT: 0, Level.IN_PART: 1, Level.DESCRIBES: 2}
_Change = Callable[["xr.Dataset"], "xr.Dataset"]
#: Whether the convention was stated, the option, words after "the data fit better", the change.
_Reading = tuple[bool, str, str, _Change]
_RADIOMETRIC = ("I", "Q", "U", "V", "mueller")
_SIGNED = ("Q", "U", "Q_over_I", "U_over_I")
_MATRICES = ("mueller", "mueller_over_m00")
_SHARES = tuple(name for name in RATIOS if name != "aolp")


def misfit(result: FitResult, findings: Sequence[Finding]) -> bool:
    """Whether something is wrong enough with a fit to doubt how its data were read.

    The model does not describe them, or reflects more than it receives, or χ² is far above what the stated
    uncertainties allow.
    """
    return (
        result.verdict().level != Level.DESCRIBES
        or any(finding.severity == Severity.VIOLATION for finding in findings)
        or (result.data.std_known and result.goodness.reduced_chi2 > LARGE)
    )


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
        When to stop, by :func:`time.monotonic`; None stops after :data:`TIME` seconds.

    Returns
    -------
    list of Suggestion
        The reading of the least χ² first; empty where none is contradicted.
    """
    clock = Clock(time.monotonic() + TIME if until is None else until)
    used = some_of(dataset, most=_GEOMETRIES)
    some = dataset.isel(geometry=used)
    arguments = {**trial_arguments(result, fit_arguments, used), "starts": _STARTS}
    before = trial(some, clock, **arguments)
    if before is None:
        return []
    found = []
    for option, words, change in readings(some):
        if not clock.allows():
            break
        if change is _ratios_in_percent and arguments.get("noise") is not None:
            continue  # a stated noise would not shrink with the values
        after = trial(change(some), clock, **arguments)
        if after is None:
            continue
        share = after.goodness.chi2 / before.goodness.chi2 if before.goodness.chi2 > 0.0 else math.inf
        better = _BETTER[after.verdict().level] > _BETTER[before.verdict().level]
        if share <= CONTRADICTED and (better or share <= PLAINLY):
            found.append(_suggestion(option, words, before, after))
        if share <= _FOUND and after.verdict().level == Level.DESCRIBES:
            break
    return sorted(found, key=lambda s: s.chi2_after)


def _suggestion(option: str, words: str, before: FitResult, after: FitResult) -> Suggestion:
    errors = [r.fitted["all"].intensity_median for r in (before, after)]
    chi2 = [r.goodness.chi2 for r in (before, after)]
    sentence = (
        f"The data contradict the way they were read: {words}, the same model fits them with χ² {chi2[1]:.4g} "
        f"instead of {chi2[0]:.4g}; read them with {option}."
    )
    return Suggestion(option, errors[0], errors[1], chi2[0], chi2[1], sentence)


def readings(dataset: xr.Dataset) -> Iterator[tuple[str, str, _Change]]:
    """Other readings that make a difference to these data: option, words after "the data fit better", change.

    Those of conventions that were assumed come first.
    """
    assumed = " ".join(dataset.attrs.get("assumptions", ()))
    found: list[_Reading] = []
    if (dataset["theta_r"].values > 0.0).any():
        stated = "azimuth" not in assumed and "phi = 0" not in assumed
        option = "--azimuth forward=180" + (" (or forward=0 if that was stated)" if stated else "")
        found.append((stated, option, "with forward at the other end of the azimuth", _azimuth))
    if any(name in dataset for name in (*_SIGNED, *_MATRICES, "aolp")):
        stated = "Q > 0" not in assumed
        option = "--stokes s-p" + (" (or p-s if that was stated)" if stated else "")
        found.append((stated, option, "with Q and U of the other sign", _stokes))
    for q, u in (("Q", "U"), ("Q_over_I", "U_over_I")):
        if q in dataset and u in dataset:
            option = _column_options(dataset, {q: u, u: q}) or f"{q} and {u} exchanged in the file"
            found.append((True, option, f"with {q} and {u} exchanged", _exchanged(q, u)))
            option = "the sign of U or of phi changed in the file"
            found.append((True, option, "with the azimuth counted the other way", _mirrored))
    if "Q" in dataset and "U" in dataset and COVARIANCE not in dataset:
        option = (
            _column_options(dataset, {"Q_over_I": "Q", "U_over_I": "U"}) or "Q and U as Q_over_I and U_over_I"
        )
        found.append((True, option, "with Q and U taken as Q/I and U/I", _normalised))
    theta_i, theta_r = dataset["theta_i"].values, dataset["theta_r"].values
    if max(theta_i.max(), theta_r.max()) < _SMALL:
        found.append((False, "--angles radians", "with angles in radians", _in_radians))
    option = (
        _column_options(dataset, {"theta_i": "theta_r", "theta_r": "theta_i"}) or "both exchanged in the file"
    )
    found.append((True, option, "with θ_i and θ_r exchanged", _exchanged("theta_i", "theta_r")))
    if "I" in dataset or "mueller" in dataset:
        found.append((True, "--cosine-weighted", "divided by cos θ_r", _divided_by_cosine))
        found.append((True, "--not-cosine-weighted", "multiplied by cos θ_r", _multiplied_by_cosine))
        if dataset.attrs.get("scale") != "arbitrary":
            found += _scales(dataset)
    for names in (("theta_r",), ("theta_i",), ("theta_i", "theta_r")):
        if all((dataset[name].values > 0.0).all() for name in names):
            whose = " and ".join(names)
            option = f"{whose} as 90° minus the elevation in the file"
            found.append((True, option, f"with {whose} taken as elevation", _elevation(names)))
    ratios = [name for name in _SHARES if name in dataset and np.nan_to_num(dataset[name].values).any()]
    if ratios:
        what = "DoLP" if ratios == ["dolp"] else "the ratios"
        option = _unit_options(dataset, ratios) or f"{what} divided by 100 in the file"
        found.append((True, option, f"with {what} taken as per cent", _ratios_in_percent))
    for _, option, words, change in sorted(found, key=lambda item: item[0]):
        yield option, words, change


def _column_options(dataset: xr.Dataset, taken: Mapping[str, str]) -> str:
    """Options that take variables from the columns of others; empty where the file has no such columns."""
    origin = origin_of(dataset)
    columns = origin.columns if origin is not None else {}
    if any(source not in columns for source in taken.values()):
        return ""
    return " ".join(f"--column {shlex.quote(f'{name}={columns[source]}')}" for name, source in taken.items())


def _unit_options(dataset: xr.Dataset, names: Sequence[str]) -> str:
    """Options by which variables are per cent; empty where the file has no columns of them."""
    origin = origin_of(dataset)
    columns = origin.columns if origin is not None else {}
    return " ".join(f"--unit {name}=%" for name in names) if all(name in columns for name in names) else ""


def _scales(dataset: xr.Dataset) -> Iterator[_Reading]:
    """Readings of another quantity or unit, where the scale of the values means something."""
    quantity = dataset.attrs.get("quantity")
    if quantity in ("brdf", "reflectance_factor"):
        measured = [name for name in _RADIOMETRIC if name in dataset]
        # a BRDF has no unit in per cent
        option = _unit_options(dataset, measured) if quantity == "reflectance_factor" else ""
        yield True, option or "values divided by 100 in the file", "taken as per cent", _times(0.01)
        yield True, "--quantity radiance", "divided by cos θ_i", _divided_by_source_cosine
    if quantity == "brdf":
        yield True, "--quantity reflectance_factor", "divided by π", _times(1.0 / math.pi)
        yield True, "values multiplied by π in the file", "multiplied by π", _times(math.pi)
    if quantity == "reflectance_factor":
        yield True, "--quantity brdf", "multiplied by π", _times(math.pi)


def _azimuth(dataset: xr.Dataset) -> xr.Dataset:
    turned = conventions.azimuth_forward_pi_to_zero(dataset["phi"].values)
    return dataset.assign_coords(phi=("geometry", turned, dataset["phi"].attrs))


def _stokes(dataset: xr.Dataset) -> xr.Dataset:
    changed = dataset.copy()
    for name in _SIGNED:
        if name in changed:
            changed[name] = -changed[name]
    if "aolp" in changed:
        changed["aolp"] = (changed["aolp"].dims, conventions.aolp_swap_sp(changed["aolp"].values))
    for name in _MATRICES:
        if name in changed:
            changed[name] = (changed[name].dims, conventions.mueller_swap_sp(changed[name].values))
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


def _divided_by_source_cosine(dataset: xr.Dataset) -> xr.Dataset:
    return _scaled(dataset, 1.0 / np.cos(dataset["theta_i"].values))


def _times(factor: float) -> _Change:
    return lambda dataset: _scaled(dataset, np.full(dataset.sizes["geometry"], factor))


def _exchanged(first: str, second: str) -> _Change:
    """Two variables exchanged, their uncertainties with them."""

    def change(dataset: xr.Dataset) -> xr.Dataset:
        changed = dataset.copy()
        for suffix in ("", "_std"):
            a, b = first + suffix, second + suffix
            if a in dataset.variables and b in dataset.variables:
                changed[a], changed[b] = dataset[b].copy(), dataset[a].copy()
        if COVARIANCE in changed and first in STOKES:
            order = [{first: second, second: first}.get(name, name) for name in STOKES]
            index = [STOKES.index(name) for name in order]
            values = changed[COVARIANCE].values[:, index][:, :, index]
            changed[COVARIANCE] = (changed[COVARIANCE].dims, values)
        return changed

    return change


def _mirrored(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.assign_coords(phi=("geometry", -dataset["phi"].values, dataset["phi"].attrs))


def _normalised(dataset: xr.Dataset) -> xr.Dataset:
    changed = dataset.copy()
    for name in ("Q", "U", "Q_std", "U_std"):
        if name in dataset:
            changed[name] = dataset[name] * dataset["I"]
    return changed


def _in_radians(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.assign_coords(
        {name: ("geometry", np.rad2deg(dataset[name].values)) for name in ("theta_i", "theta_r", "phi")}
    )


def _elevation(names: Sequence[str]) -> _Change:
    def change(dataset: xr.Dataset) -> xr.Dataset:
        turned = {name: ("geometry", 0.5 * math.pi - dataset[name].values) for name in names}
        return dataset.assign_coords(turned)

    return change


def _ratios_in_percent(dataset: xr.Dataset) -> xr.Dataset:
    """Ratios over 100 with their uncertainties, also those that a fit assumes: else weights alone would lower χ²."""
    changed = dataset.copy()
    nothing = np.full(dataset.sizes["geometry"], np.nan)
    for name in _SHARES:
        if name not in changed:
            continue
        values = changed[name]
        intensity = dataset["I"].values if "I" in dataset else nothing
        assumed = NoiseModel().standard_uncertainty(name, intensity, np.ones(len(nothing)))
        std = np.broadcast_to(assumed.reshape((-1,) + (1,) * (values.ndim - 1)), values.shape)
        if f"{name}_std" in changed:
            stated = changed[f"{name}_std"].values
            std = np.where(np.isnan(stated), std, stated)
        changed[f"{name}_std"] = (values.dims, std / 100.0)
        changed[name] = values / 100.0
    if "mueller_over_m00" in changed:
        own = changed["mueller_over_m00"].values.copy()
        own[:, 0, 0] = dataset["mueller_over_m00"].values[:, 0, 0]  # 1, whatever the others are in
        changed["mueller_over_m00"] = (changed["mueller_over_m00"].dims, own)
    return changed
