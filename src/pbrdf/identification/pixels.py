"""What the pixels of a block say of each material: from fitted parameters, and from data.

Data of Stokes components or their ratios to I at geometries that all pixels share are compared by tables of the models'
signals (:mod:`pbrdf.identification.shared_geometry`). Where each pixel has its own geometries, for other quantities and
for stated covariances the models are evaluated, for all pixels of a block together.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import DIMENSION, VARIABLES
from pbrdf.errors import DataError, FitError
from pbrdf.identification.evidence import evidence
from pbrdf.identification.material import Material
from pbrdf.identification.parameter_evidence import parameter_evidence
from pbrdf.identification.shared_geometry import SharedGeometry
from pbrdf.inversion.noise import Noise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.parameter_map.block_stack import ANGLES, stack_of_block
from pbrdf.inversion.parameter_map.layout import PENDING, PixelStatus
from pbrdf.optics.stokes import STOKES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Likelihoods", "of_parameters", "of_stokes"]

#: Of a block: known pixels (B,), and of these log evidence (N, C), distance (N, C) and degrees of freedom (N,).
Likelihoods = Callable[[Any], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]

#: Variance of a parameter that the data do not determine, in units of the scatter between specimens.
UNDETERMINED = 1e8
#: What tables of signals hold.
_PLAIN = {*STOKES, *(f"{name}_over_I" for name in STOKES[1:])}


def of_parameters(dataset: xr.Dataset, dims: Sequence[str], materials: Sequence[Material]) -> Likelihoods:
    """Likelihoods of a map of parameters over ``dims``.

    Raises
    ------
    FitError
        If the map is of another model than the materials, or lacks a parameter that differs between specimens.
    DataError
        If a variable is missing.
    """
    space = materials[0].space
    names = [str(name) for name in dataset["parameter"].values]
    stated = _model(dataset)
    if stated is not None and stated != space.model.name:
        raise FitError(
            f"the map is of the model {stated}, the library's material {materials[0].name} of {space.model.name}"
        )
    if missing := [name for name in space.names if name not in names]:
        raise FitError(
            f"the map has no parameter {', '.join(missing)}, which differs between the specimens of "
            f"{materials[0].name}: fit with it free"
        )
    if "standard_error" not in dataset.variables:
        raise DataError("the map has no variable standard_error: it needs those of pbrdf.fit_map")
    order = [names.index(name) for name in space.names]
    unit = np.sqrt(np.mean([np.diag(m.covariance) for m in materials], axis=0))
    centre = space.to_parameters(np.mean([m.mean for m in materials], axis=0))
    rows, columns = np.tril_indices(len(order))
    off = rows != columns

    def likelihoods(block: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        def read(name: str, *front: str) -> np.ndarray:
            values = block[name].transpose(*front, *dims).values
            return values.reshape(*values.shape[: len(front)], -1)

        estimate, error = (read(name, "parameter")[order].T for name in ("estimate", "standard_error"))
        known = np.isfinite(estimate).any(axis=1)
        wanted = read("mask") != 0 if "mask" in block else np.ones(len(known), dtype=bool)
        if "status" in block:
            status = read("status")
            if (wanted & (status == PENDING)).any():
                raise DataError(
                    "this map is not complete: there are pixels that are not yet fitted (status -1), which are not the "
                    "same as those without data. Go on with `pbrdf map`, or leave them out by a variable mask"
                )
            known &= status == PixelStatus.CONVERGED
        known &= wanted
        estimate, error = estimate[known].astype(float), error[known].astype(float)
        limited = ~np.isfinite(estimate)
        if "flags" in block:
            limited |= read("flags", "parameter")[order].T[known] != 0
        estimate = np.where(np.isfinite(estimate), estimate, centre)
        spread = error / space.derivative(estimate)
        limited |= ~np.isfinite(spread) | (spread <= 0.0)
        spread = np.where(limited, np.sqrt(UNDETERMINED) * unit, spread)
        correlation = np.broadcast_to((~off).astype(float), (len(spread), len(rows))).copy()
        if "correlation" in block:
            whole = read("correlation", "parameter", "other")
            both = ~(limited[:, rows[off]] | limited[:, columns[off]])
            stated = np.array(
                [whole[order[i], order[j]] for i, j in zip(rows[off], columns[off], strict=True)]
            )
            correlation[:, off] = np.where(
                both, np.nan_to_num(stated.reshape(off.sum(), -1)[:, known].T), 0.0
            )
        unknowns = space.to_unknowns(estimate)
        covariance = correlation * spread[:, rows] * spread[:, columns]
        found, distance = parameter_evidence(materials, unknowns, covariance)
        return known, found, distance, (~limited).sum(axis=1)

    return likelihoods


def _model(dataset: xr.Dataset) -> str | None:
    """Name of the model that a map states."""
    text = dataset.attrs.get("model")
    if text is None:
        return None
    try:
        return str(json.loads(text)["model"])
    except (ValueError, TypeError, KeyError):
        return str(text)


def of_stokes(
    dataset: xr.Dataset,
    dims: Sequence[str],
    materials: Sequence[Material],
    gain: bool,
    noise: Noise | None,
    least: np.ndarray,
    temperature: float,
) -> Likelihoods:
    """Likelihoods of data over ``geometry`` and ``dims``; see :class:`SharedGeometry` for the last two.

    Raises
    ------
    DataError
        If the angles or the dimensions are not those of such data.
    """
    measured = [name for name in VARIABLES if name in dataset.data_vars]
    for name in ANGLES:
        if name not in dataset.variables:
            raise DataError(f"the data have no {name}")
        if DIMENSION not in dataset[name].dims or not set(dataset[name].dims) <= {DIMENSION, *dims}:
            raise DataError(
                f"{name} has the dimensions {dataset[name].dims}: it needs {DIMENSION}, or it and the image's"
            )
    for name in measured:
        if not set(dims) <= set(dataset[name].dims):
            raise DataError(
                f"{name} has the dimensions {dataset[name].dims}: it needs those of the image, {', '.join(dims)}"
            )
    if "mask" in dataset.variables and set(dataset["mask"].dims) != set(dims):
        raise DataError(
            f"mask has the dimensions {dataset['mask'].dims}: it needs those of the image, {', '.join(dims)}"
        )
    plain = set(measured) <= _PLAIN
    tables: dict[tuple[str, ...], SharedGeometry] = {}

    def likelihoods(block: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        stack = stack_of_block(block, dims, noise=noise)
        known = np.zeros(math.prod(block.sizes[d] for d in dims), dtype=bool)
        if stack is not None:
            known = stack.count > 0
        if "mask" in block.variables:
            known &= block["mask"].transpose(*dims).values.ravel() != 0
        if stack is None or not known.any():
            return known, np.empty((0, len(materials))), np.empty((0, len(materials))), np.empty(0)
        if not known.all():
            stack = stack.take(known)
        channels = stack.channels
        if plain and stack.whitening is None and stack.theta_i.shape[1] == 1:
            if channels not in tables:
                like = Observations(
                    theta_i=stack.theta_i[:, 0],
                    theta_r=stack.theta_r[:, 0],
                    phi=stack.phi[:, 0],
                    channels=channels,
                    values=stack.values[..., 0],
                    std=stack.std[..., 0],
                    illumination=stack.illumination,
                    std_known=True,
                )
                tables[channels] = SharedGeometry.of(
                    materials, like, gain=gain, least=least, temperature=temperature
                )
            return known, *tables[channels].evidence(stack.values, stack.std)
        found = evidence(materials, stack, gain=gain)
        return known, found.log_evidence, found.distance, found.degrees_of_freedom

    return likelihoods
