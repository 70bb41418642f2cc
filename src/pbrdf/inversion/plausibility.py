"""Whether a fitted model is physically plausible, and how far its data carry it.

A small residual does not make a model physical. Checked here: it must not reflect more than it receives, its
Mueller matrices must be those of a passive surface, its parameters should not stand at bounds, and predictions
beyond the measured directions are extrapolation. What the numbers mean: ``docs/validation.md``.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.verdict import Level, verdict
from pbrdf.models.base import Model
from pbrdf.models.realisability import least_coherency
from pbrdf.models.reflectance import directional_hemispherical_reflectance

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Finding", "Severity", "plausibility"]

#: Incidence angles at which the energy balance of a fit is checked, degrees.
INCIDENCES = tuple(range(0, 86, 5))
#: Directional-hemispherical reflectances up to this much above 1 count as 1: the accuracy of the integral.
ENERGY_TOLERANCE = 1e-3
#: Coherency eigenvalues down to this, in units of f00, count as 0: rounding.
COHERENCY_TOLERANCE = 1e-9
#: Facets tilted by at most this many σ from the mirror direction sample the lobe; fewer points than
#: LOBE_POINTS cannot show its height and its width.
LOBE_WIDTHS, LOBE_POINTS = 2.0, 3


class Severity(enum.StrEnum):
    """How serious a finding is."""

    OK = "ok"  # checked, nothing to object
    NOTE = "note"  # worth knowing
    WARNING = "warning"  # numbers that rest on little
    VIOLATION = "violation"  # no passive surface does this


@dataclass(frozen=True)
class Finding:
    """One result of :func:`plausibility`.

    Attributes
    ----------
    check
        ``"energy"``, ``"realisability"``, ``"parameters"``, ``"range"`` or ``"lobe"``.
    severity
        How serious it is.
    sentence
        What was found, in words.
    """

    check: str
    severity: Severity
    sentence: str


def plausibility(result: Optimum, dataset: xr.Dataset | None = None) -> list[Finding]:
    """Check a fit for what no residual shows.

    Parameters
    ----------
    result
        The fit.
    dataset
        The fitted data set. Its attributes say whether its values are on an absolute scale; without it those of
        ``result.comparison`` are asked. On an arbitrary scale the energy balance cannot be checked.

    Returns
    -------
    list of Finding
        The energy balance and realisability first, then parameters, lobe and measured range; never empty.
    """
    attributes = {**result.comparison.attrs, **(dataset.attrs if dataset is not None else {})}
    models = _models(result)
    return [
        _energy(result, models, attributes),
        _realisability(models),
        *_parameters(result, verdict(result).level),
        _lobe(result),
        *_range(result),
    ]


def _models(result: Optimum) -> dict[str, Model]:
    """Every model of the fit, by words that name its wavelength after a direction."""
    return {f", {nm:g} nm": model for nm, model in result.models.items()} or {"": result.model}


def _energy(result: Optimum, models: dict[str, Model], attributes: dict[Any, Any]) -> Finding:
    incidence = np.deg2rad(INCIDENCES)
    reflectances = {
        at: directional_hemispherical_reflectance(model, incidence) for at, model in models.items()
    }
    at, reflectance = max(reflectances.items(), key=lambda item: float(item[1].max()))
    worst = int(np.argmax(reflectance))
    where = f"at θ_i = {INCIDENCES[worst]}°{at}"
    largest = f"The model reflects at most {reflectance[worst]:.3g} of natural light ({where})"
    gain = any(term.nuisance and term.role == "gain" for term in result.space.terms)
    unknown = _unknown_scale(attributes)
    if not {"I", "m00"} & set(result.data.channels):
        unknown = "the data are ratios, which hold no scale; that of the model is that of its facets"
    if unknown and not gain:
        sentence = f"{largest}, which says nothing about energy: {unknown}."
        return Finding("energy", Severity.NOTE, sentence)
    above = np.max(list(reflectances.values()), axis=0) > 1.0 + ENERGY_TOLERANCE
    if gain:
        # the lobe has no free factor of its own: its height against Fresnel's reflectance is what fixes a gain
        sentence = f"{largest}; that rests on the fitted gain, which only the height of the lobe determines."
        return Finding("energy", Severity.WARNING if above.any() else Severity.NOTE, sentence)
    if not above.any():
        return Finding("energy", Severity.OK, f"{largest}: no more than it receives.")
    used = _used(result)
    measured = result.data.theta_i[used]
    inside = (incidence >= measured.min() - 1e-9) & (incidence <= measured.max() + 1e-9)
    if not (above & inside).any():
        sentence = f"{largest}, more than it receives, though only beyond the measured angles of incidence."
        return Finding("energy", Severity.WARNING, sentence)
    sentence = (
        f"{largest}, more than it receives: the data are not an absolute BRDF (then state --scale "
        'arbitrary, or the attribute scale = "arbitrary"), or the fit is wrong.'
    )
    return Finding("energy", Severity.VIOLATION, sentence)


def _unknown_scale(attributes: dict[Any, Any]) -> str:
    """Why the scale of the values is not absolute; empty if nothing says so."""
    quantity = attributes.get("quantity")
    if attributes.get("scale") == "arbitrary":
        return "the data are on an arbitrary scale"
    if quantity in ("radiance", "dn") and attributes.get("scale") != "absolute":
        kind = "digital numbers" if quantity == "dn" else "radiances"
        return f"the data are {kind}, proportional to the BRDF by an unknown factor"
    return ""


def _realisability(models: dict[str, Model]) -> Finding:
    (least, where), at = min((least_coherency(model), at) for at, model in models.items())
    if least >= -COHERENCY_TOLERANCE:
        sentence = "Every Mueller matrix on a grid over the hemisphere is that of a passive surface."
        return Finding("realisability", Severity.OK, sentence)
    i, r, phi = np.rad2deg(where)
    sentence = (
        f"The Mueller matrix at θ_i = {i:.0f}°, θ_r = {r:.0f}°, φ = {phi:.0f}°{at} is that of no passive surface: its "
        f"coherency matrix has the eigenvalue {least:.2g}·f00."
    )
    return Finding("realisability", Severity.VIOLATION, sentence)


def _parameters(result: Optimum, level: Level) -> list[Finding]:
    findings = []
    if level == Level.DOES_NOT:
        sentence = "The parameters are those of no sample, as the model does not describe the data."
        findings.append(Finding("parameters", Severity.WARNING, sentence))
    for name, estimate in result.estimates.items():
        value = estimate.parameter.shown(estimate.value)
        if estimate.verdict.startswith("at "):
            sentence = (
                f"{name} = {value} stands {estimate.verdict}: the data pull it further, and the other "
                "parameters make up for that."
            )
            findings.append(Finding("parameters", Severity.WARNING, sentence))
        elif estimate.verdict == "undetermined":
            sentence = f"{name} = {value} is not determined by these data."
            findings.append(Finding("parameters", Severity.WARNING, sentence))
    if not findings:
        sentence = "Every fitted parameter is determined and inside its bounds."
        findings.append(Finding("parameters", Severity.OK, sentence))
    return findings


def _lobe(result: Optimum) -> Finding:
    """Whether the specular lobe was measured: its height and width carry the parameters of the facets."""
    slope = float(result.model.lobe_width())
    tilt = _tilt(result)[_used(result)]
    count = int((np.tan(tilt) <= LOBE_WIDTHS * slope).sum())
    width = np.rad2deg(math.atan(LOBE_WIDTHS * slope))
    shaping = [p.symbol for p in result.model.parameters if p.fitted and p.part == "specular"]
    rest = f"{' and '.join(shaping) or 'the parameters of the lobe'} rest{'s' if len(shaping) == 1 else ''}"
    near = f"{LOBE_WIDTHS:g}σ ({width:.2g}° of facet tilt) of the mirror direction"
    if count == 0:
        sentence = (
            f"No fitted point lies within {near}: {rest} on the tail of the lobe or on the diffuse part, and "
            "the predicted peak is extrapolation."
        )
        return Finding("lobe", Severity.WARNING, sentence)
    if count < LOBE_POINTS:
        noun, verb = ("point", "lies") if count == 1 else ("points", "lie")
        sentence = f"Only {count} fitted {noun} {verb} within {near}: {rest} on them."
        return Finding("lobe", Severity.WARNING, sentence)
    return Finding("lobe", Severity.OK, f"The lobe was measured: {count} fitted points lie within {near}.")


def _range(result: Optimum) -> list[Finding]:
    data, used = result.data, _used(result)
    ranges = {
        "θ_i": np.rad2deg(data.theta_i[used]),
        "θ_r": np.rad2deg(data.theta_r[used]),
        "facet tilt": np.rad2deg(_tilt(result)[used]),
    }
    off_plane = np.rad2deg(np.arcsin(np.abs(np.sin(data.phi[used]))))
    azimuth = np.rad2deg(np.abs(np.arctan2(np.sin(data.phi[used]), np.cos(data.phi[used]))))
    shown = [f"{name} {values.min():.1f}–{values.max():.1f}°" for name, values in ranges.items()]
    if off_plane.max() < 1.0:
        shown.append("azimuth in the plane of incidence only")
        beyond = "Beyond that, and everywhere out of the plane of incidence, predictions are extrapolation."
    else:
        shown.append(f"|φ| {azimuth.min():.0f}–{azimuth.max():.0f}°")
        beyond = "Beyond that predictions are extrapolation."
    sentence = f"The fit rests on {int(used.sum())} geometries: {', '.join(shown)}. {beyond}"
    findings = [Finding("range", Severity.NOTE, sentence)]
    held = result.comparison["held_out"].values
    if held.any():
        columns = {
            "θ_i": np.rad2deg(result.comparison["theta_i"].values[held]),
            "θ_r": np.rad2deg(result.comparison["theta_r"].values[held]),
            "facet tilt": np.rad2deg(result.comparison["facet_tilt"].values[held]),
        }
        outside = {
            name: int(((v < ranges[name].min() - 0.05) | (v > ranges[name].max() + 0.05)).sum())
            for name, v in columns.items()
        }
        listed = [f"{count} in {name}" for name, count in outside.items() if count]
        total = int(held.sum())
        sentence = (
            f"Of the {total} held-out geometries some lie outside the fitted range: {', '.join(listed)}."
            if listed
            else f"The {total} held-out geometries lie inside the fitted ranges of θ_i, θ_r and facet tilt: "
            "they test interpolation."
        )
        findings.append(Finding("range", Severity.NOTE, sentence))
    return findings


def _used(result: Optimum) -> np.ndarray:
    """Geometries of the fitted data with at least one measured value, shape (G,)."""
    values: np.ndarray = np.isfinite(result.data.std).any(axis=0)
    return values


def _tilt(result: Optimum) -> np.ndarray:
    """Tilt of the mirror facet at the fitted geometries in radians, shape (G,)."""
    values: np.ndarray = result.comparison["facet_tilt"].values[~result.comparison["held_out"].values]
    return values
