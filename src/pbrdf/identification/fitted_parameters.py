"""A fit of which only the parameters are at hand: ``fit.json`` of a folder of ``pbrdf fit`` without its ``fit.nc``.

Estimates and standard errors are compared in closed form (:mod:`pbrdf.identification.parameter_evidence`), as those of
a pixel of a map are. That needs materials of the fit's model, and takes the likelihood of the data for a normal
distribution of the parameters; where the data are at hand they count instead.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError, FitError, ModelError
from pbrdf.files.text import read_bytes, utf8
from pbrdf.identification.evidence import Evidence
from pbrdf.identification.identify import arbitrary_scale
from pbrdf.identification.material import Material
from pbrdf.identification.pixels import of_parameters
from pbrdf.models import load_model
from pbrdf.models.base import Model

__all__ = ["RECORD", "FittedParameters", "parameters_explained", "read_fitted_parameters"]

#: Name of the file in the folder of a fit.
RECORD = "fit.json"


@dataclass(frozen=True)
class FittedParameters:
    """Estimates of a fit without the data; P free parameters.

    Attributes
    ----------
    model
        With the estimates and what was fixed.
    names
        Free parameters.
    estimate, standard_error
        In the parameters' own units, angles in radians, shape (P,); NaN for the error of what is on a bound or not
        determined.
    correlation
        Shape (P, P); 0 where there is none.
    data
        What the fit calls its data.
    arbitrary
        Whether a factor of the intensities was not known, and the fit had none.
    simulated
        Whether a model produced the data.
    """

    model: Model
    names: tuple[str, ...]
    estimate: np.ndarray
    standard_error: np.ndarray
    correlation: np.ndarray
    data: str = ""
    arbitrary: bool = False
    simulated: bool = False


def read_fitted_parameters(path: Path) -> FittedParameters:
    """Read ``fit.json`` of a fit.

    Raises
    ------
    DataError
        If the file cannot be read, or holds no estimates with standard errors.
    ModelError
        If it is of a model that is not known here.
    FitError
        If the fit stands at no minimum.
    """
    try:
        record = json.loads(utf8(path, read_bytes(path)))
    except ValueError as error:
        raise DataError(f"{path}: not JSON, so not the record of a fit: {error}") from error
    if not isinstance(record, dict) or "model" not in record:
        raise DataError(f"{path}: this is not the record of a fit ({RECORD} in a folder of `pbrdf fit`)")
    if "estimates" not in record:
        raise DataError(
            f"{path}: a model without standard errors: nothing says how well its parameters are known. Give the folder "
            f"of the fit, or its {RECORD}"
        )
    if not record.get("settled", True):
        raise FitError(f"{path}: the fit stands at no minimum: fit again with more starts")
    try:
        return _fitted(record)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise DataError(f"{path}: the record of the fit is damaged: {reason}") from error


def _fitted(record: Mapping[str, Any]) -> FittedParameters:
    estimates = {name: e for name, e in record["estimates"].items() if e["verdict"] != "fixed"}
    names = tuple(estimates)
    factor = np.array([math.pi / 180.0 if e["unit"] == "degree" else 1.0 for e in estimates.values()])
    numbers = [
        [math.nan if e[key] is None else float(e[key]) for e in estimates.values()]
        for key in ("value", "standard_error")
    ]
    stated = record["correlation"]
    places = [names.index(name) for name in stated["parameters"]]
    correlation = np.eye(len(names))
    correlation[np.ix_(places, places)] = np.array(stated["matrix"], dtype=float).reshape(
        len(places), len(places)
    )
    estimate, error = np.array(numbers) * factor
    determined = np.array([e["verdict"] == "determined" for e in estimates.values()])
    data = record["data"]
    return FittedParameters(
        model=load_model(record["model"]),
        names=names,
        estimate=estimate,
        standard_error=np.where(determined, error, math.nan),
        correlation=np.nan_to_num(correlation),
        data=str(data["name"]),
        arbitrary=arbitrary_scale(data.get("quantity"), data.get("scale"))
        and "gain" not in [name.partition("[")[0] for name in names],
        simulated=bool(data.get("simulated")),
    )


def parameters_explained(materials: Sequence[Material], fitted: FittedParameters) -> Evidence:
    """How well materials explain fitted parameters, as one measurement.

    Raises
    ------
    FitError
        If a material is of another model, has other options or a parameter that was not free in the fit, or the scale
        of the data was arbitrary.
    """
    import xarray as xr

    _require_like(materials, fitted)
    over = ("parameter", "pixel")
    one = xr.Dataset(
        {
            "estimate": (over, fitted.estimate[:, None]),
            "standard_error": (over, fitted.standard_error[:, None]),
            "correlation": (("parameter", "other", "pixel"), fitted.correlation[..., None]),
        },
        coords={"parameter": list(fitted.names), "other": list(fitted.names)},
    )
    _, log_evidence, distance, freedom = of_parameters(one, ["pixel"], materials)(one)
    if not freedom[0]:
        raise FitError("the fit determines none of the parameters that differ between specimens")
    values = tuple(_most_likely(material, fitted)[None] for material in materials)
    return Evidence(log_evidence.astype(float), distance.astype(float), freedom, values)


def _require_like(materials: Sequence[Material], fitted: FittedParameters) -> None:
    if fitted.arbitrary:
        raise FitError(
            "the scale of the fitted data is arbitrary, and the parameters hold it: identify the data, which are "
            "compared up to a gain, or fit with --nuisance gain"
        )
    for material in materials:
        space = material.space
        if space.model is not type(fitted.model):
            raise FitError(
                f"the fit is of the model {fitted.model.name}, the material {material.name} of {space.model.name}: "
                "without its data it can be compared with materials of its own model only"
            )
        options = {name: choices[0] for name, choices in space.model.options.items()} | dict(space.options)
        if options != dict(fitted.model.chosen):
            raise FitError(
                f"the fit is of {fitted.model.name} with {_stated(fitted.model.chosen)}, the material {material.name} "
                f"with {_stated(options)}: without its data they cannot be compared"
            )
        if missing := [name for name in space.names if name not in fitted.names]:
            raise FitError(
                f"the fit has no free parameter {', '.join(missing)}, which differs between the specimens of "
                f"{material.name}: fit with it free"
            )


def _stated(options: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {choice}" for name, choice in options.items()) or "no options"


def _most_likely(material: Material, fitted: FittedParameters) -> np.ndarray:
    """Parameters of the most likely specimen: the mean of N(μ, Σ) given the estimates, shape (P,)."""
    space = material.space
    order = [fitted.names.index(name) for name in space.names]
    spread = fitted.standard_error[order] / space.derivative(fitted.estimate[order])
    known = np.flatnonzero(np.isfinite(spread) & (spread > 0.0))
    rows = np.array(order)[known]
    error = fitted.correlation[np.ix_(rows, rows)] * np.outer(spread[known], spread[known])
    off = space.to_unknowns(fitted.estimate[order])[known] - material.mean[known]
    sigma = material.covariance
    gained = sigma[:, known] @ np.linalg.solve(sigma[np.ix_(known, known)] + error, off)
    return space.to_parameters(material.mean + gained)
