"""What a reader of a fit's numbers must know, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.observations import Observations
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.solver import Solution, Status

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["notes_on"]


def notes_on(
    result: FitResult, dataset: xr.Dataset, data: Observations, solution: Solution, best: int
) -> list[str]:
    """Sentences on a fit: ``best`` is the number of its best start, ``data`` what was fitted."""
    notes = list(result.space.sources.values())
    if "wavelength" in dataset.coords:
        wavelengths = np.unique(dataset["wavelength"].values)
        by_wavelength = any(term.split == "wavelength" for term in result.space.terms)
        if np.isfinite(wavelengths).sum() > 1 and not by_wavelength:
            amplitude = next((p.name for p in result.model.parameters if p.amplitude), "a parameter")
            notes.append(
                f"One set of parameters was fitted to {len(wavelengths)} wavelengths at once; select one, or let "
                f"{amplitude} be free for each, if the colour of the coating matters."
            )
    if not result.settled:
        notes.append(_not_converged(Status(solution.status[best])))
    scale = dataset.attrs.get("scale")
    unknown = scale == "arbitrary" or (
        dataset.attrs["quantity"] in ("radiance", "dn") and scale != "absolute"
    )
    if unknown and not any(term.nuisance and term.role == "gain" for term in result.space.terms):
        notes.append(
            "The data are on an arbitrary scale and no gain was fitted: the height of the lobe, and what rests on it, "
            "was compared with an absolute one; add the nuisance gain (--nuisance gain), or state --scale absolute."
        )
    undetermined = [n for n, e in result.estimates.items() if e.verdict == "undetermined"]
    if undetermined:
        notes.append(
            f"These data do not determine {', '.join(undetermined)}: the value shown is one of many that fit as "
            "well; measure what it depends on, or fix it."
        )
    if not data.polarised:
        notes.append(
            "No polarisation was measured: the parameters and the model's DoLP rest on the intensity alone."
        )
    if not {"I", "m00"} & set(data.channels):
        notes.append(
            "No intensity was measured, only ratios: they set the diffuse part against the specular one, whose height "
            "the model knows, and every absolute value rests on that."
        )
    for name, e in result.estimates.items():
        if e.verdict.startswith("at "):
            bound = e.lower if "lower" in e.verdict else e.upper
            notes.append(
                f"{name} stands {e.verdict} ({e.parameter.shown(bound, 'g')}); its standard error is not defined there."
            )
    rivals = [o for o in result.optima[1:] if o.chi2 <= result.optima[0].chi2 + 4.0]
    if rivals:
        notes.append(
            f"{len(rivals)} other optimum(s) fit nearly as well (χ² within 4): the solution is not unique."
        )
    reduced = result.goodness.reduced_chi2
    if data.std_known and reduced > 2.0 and result.settled:
        notes.append(
            f"Reduced χ² is {reduced:.3g}: the model departs from the data by more than their stated uncertainty, and "
            f"the standard errors are too small by a factor of about {reduced**0.5:.2g}."
        )
    return notes


def _not_converged(status: Status) -> str:
    if status == Status.ITERATIONS:
        return "The best start was still under way when its steps were used up: allow more with --iterations."
    return (
        "The best start found no way down and stands at no minimum: try more --starts, narrower --bounds, or fewer "
        "free parameters (--fix, fewer --nuisance terms)."
    )
