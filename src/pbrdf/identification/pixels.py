"""What the pixels of a block say of each material: from fitted parameters, and from data.

Data of Stokes components or their ratios to I at geometries that all pixels share are compared by tables of the models'
signals (:mod:`pbrdf.identification.shared_geometry`). Where each pixel has its own geometries the models are evaluated
for all pixels of a block together; other quantities and stated covariances are read pixel by pixel.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import COVARIANCE, DIMENSION, NORMALISED, VARIABLES, is_ratio, std_name
from pbrdf.errors import DataError, FitError
from pbrdf.identification.evidence import evidence
from pbrdf.identification.material import Material
from pbrdf.identification.parameter_evidence import parameter_evidence
from pbrdf.identification.shared_geometry import SharedGeometry
from pbrdf.inversion.noise import InstrumentNoise, Noise, NoiseModel
from pbrdf.inversion.observations import Observations
from pbrdf.optics.stokes import STOKES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Likelihoods", "of_parameters", "of_stokes"]

#: Of a block: known pixels (B,), and of these log evidence (N, C), distance (N, C) and degrees of freedom (N,).
Likelihoods = Callable[[Any], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]

#: Variance of a parameter that the data do not determine, in units of the scatter between specimens.
UNDETERMINED = 1e8
#: Value of ``status`` of a pixel whose fit converged (:func:`pbrdf.fit_map`).
CONVERGED = 0
#: Pixels whose likelihoods are found together where their geometries differ.
TOGETHER = 1 << 12
_ANGLES = ("theta_i", "theta_r", "phi")
#: What is read for a block at once.
_PLAIN = (*STOKES, *(f"{name}_over_I" for name in STOKES[1:]))


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
        if "status" in block:
            known &= read("status") == CONVERGED
        if "mask" in block:
            known &= read("mask") != 0
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
    for name in _ANGLES:
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
    plain = COVARIANCE not in dataset.data_vars and set(measured) <= set(_PLAIN)
    shared = all(dataset[name].dims == (DIMENSION,) for name in _ANGLES)
    tables: list[SharedGeometry] = []

    def likelihoods(block: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        if not plain:
            return _one_by_one(block, dims, materials, gain, noise)
        values, std, angles = _arrays(block, dims, measured, noise)
        known = np.isfinite(std).any(axis=(1, 2))
        if "mask" in block.variables:
            known &= block["mask"].transpose(*dims).values.ravel() != 0
        if not known.any():
            return known, np.empty((0, len(materials))), np.empty((0, len(materials))), np.empty(0)
        chosen = slice(None) if known.all() else known
        values, std = values[chosen], std[chosen]
        incident = tuple(float(v) for v in block.attrs["illumination"])
        like = Observations(
            theta_i=angles[0][0],
            theta_r=angles[1][0],
            phi=angles[2][0],
            channels=tuple(measured),
            values=values[0],
            std=std[0],
            illumination=incident,  # type: ignore[arg-type]
            std_known=True,
        )
        if shared:
            if not tables:
                tables.append(
                    SharedGeometry.of(materials, like, gain=gain, least=least, temperature=temperature)
                )
            return known, *tables[0].evidence(values, std)
        angles = [np.broadcast_to(angle, (known.size, angle.shape[1]))[chosen] for angle in angles]
        data = [
            replace(like, theta_i=i, theta_r=r, phi=p, values=v, std=s)
            for i, r, p, v, s in zip(*angles, values, std, strict=True)
        ]
        return known, *_together(materials, data, gain)

    return likelihoods


def _arrays(
    block: xr.Dataset, dims: Sequence[str], measured: Sequence[str], noise: Noise | None
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Values and uncertainties on the scale of a BRDF, (N, C, G), and angles, (N or 1, G)."""

    def read(name: str) -> np.ndarray:
        array = block[name]
        here = [d for d in dims if d in array.dims]
        values = array.transpose(*here, DIMENSION).values.astype(float)
        if here and len(here) < len(dims):
            shape = [block.sizes[d] if d in here else 1 for d in dims]
            full = [block.sizes[d] for d in dims]
            values = np.broadcast_to(values.reshape(*shape, -1), (*full, values.shape[-1]))
        return values.reshape(-1, values.shape[-1])

    angles = [read(name) for name in _ANGLES]
    quantity = block.attrs["quantity"]
    scale = np.ones_like(angles[0])
    if quantity == "reflectance_factor":
        scale /= np.pi
    elif quantity not in ("brdf", NORMALISED):
        scale /= np.cos(angles[0])
    factors = [1.0 if is_ratio(name) else scale for name in measured]
    values = np.stack([read(name) * f for name, f in zip(measured, factors, strict=True)], axis=1)
    std = np.full_like(values, np.nan)
    if noise is None:
        for c, (name, factor) in enumerate(zip(measured, factors, strict=True)):
            if std_name(name) in block.data_vars:
                std[:, c] = read(std_name(name)) * factor
    intensity = values[:, measured.index("I")] if "I" in measured else np.full(values[:, 0].shape, np.nan)
    absent = [
        c for c, name in enumerate(measured) if noise is not None or std_name(name) not in block.data_vars
    ]
    for c in absent:
        std[:, c] = _stated(noise or NoiseModel(), measured[c], intensity, scale)
    gone = ~(np.isfinite(values) & np.isfinite(std) & (std > 0.0))
    values[gone], std[gone] = 0.0, np.inf
    return values, std, angles


def _stated(noise: Noise, channel: str, intensity: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Stated uncertainties of all pixels; parts of a pixel's typical intensity pixel by pixel."""
    if isinstance(noise, InstrumentNoise):
        return noise.standard_uncertainty(channel, intensity, scale)
    scales = np.broadcast_to(scale, intensity.shape)
    return np.stack(
        [noise.standard_uncertainty(channel, i, s) for i, s in zip(intensity, scales, strict=True)]
    )


def _one_by_one(
    block: xr.Dataset, dims: Sequence[str], materials: Sequence[Material], gain: bool, noise: Noise | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    block = block.load()
    shape = [block.sizes[d] for d in dims]
    known = np.zeros(int(np.prod(shape)), dtype=bool)
    mask = block["mask"].transpose(*dims).values.ravel() != 0 if "mask" in block.variables else ~known
    found: dict[Any, list[tuple[int, Observations]]] = {}
    names = [name for name in block.data_vars if name in VARIABLES]
    for number in np.flatnonzero(mask):
        place = np.unravel_index(int(number), shape)
        pixel = block.isel(dict(zip(dims, map(int, place), strict=True)))
        if not any(np.isfinite(pixel[name].values).any() for name in names):
            continue
        data = Observations.from_dataset(pixel, noise)
        known[number] = True
        found.setdefault(data.channels, []).append((int(number), data))
    log_evidence = np.full((known.size, len(materials)), np.nan)
    distance, freedom = np.full_like(log_evidence, np.nan), np.zeros(known.size)
    for members in found.values():
        at = [number for number, _ in members]
        result = _together(materials, [data for _, data in members], gain)
        log_evidence[at], distance[at], freedom[at] = result
    return known, log_evidence[known], distance[known], freedom[known]


def _together(
    materials: Sequence[Material], data: Sequence[Observations], gain: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    parts = [
        evidence(materials, data[begin : begin + TOGETHER], gain=gain)
        for begin in range(0, len(data), TOGETHER)
    ]
    return (
        np.concatenate([p.log_evidence for p in parts]),
        np.concatenate([p.distance for p in parts]),
        np.concatenate([p.degrees_of_freedom for p in parts]),
    )
