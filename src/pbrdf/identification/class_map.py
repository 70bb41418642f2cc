"""Which material each pixel of an image shows.

From a map of parameters (:func:`pbrdf.fit_map`) by the closed form of
:mod:`pbrdf.identification.parameter_evidence`; from Stokes parameters at every pixel by the integrated likelihoods of
:mod:`pbrdf.identification.evidence`. Each pixel is judged by itself. Where materials fill regions, the logarithms of the
likelihoods may be smoothed over neighbours first, which trades fine detail for fewer stray pixels; p-values, and so what
is none of the materials, stay those of the pixel.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import DIMENSION
from pbrdf.errors import DataError, FitError
from pbrdf.identification.conformal import Calibration, nominal, probabilities
from pbrdf.identification.identify import check_request, shares, unknown_gain
from pbrdf.identification.library import Library
from pbrdf.identification.material import Material
from pbrdf.identification.parameter_evidence import parameter_evidence
from pbrdf.inversion.noise import Noise, parse_noise

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["NONE_OF_THESE", "NOT_MEASURED", "identify_map"]

#: What stands for a pixel that is like none of the materials, and for one that has no data.
NONE_OF_THESE, NOT_MEASURED = -1, -2
#: Pixels of a block.
PIXELS = 1 << 16
#: Variance of a parameter that the data do not determine, in units of the scatter between specimens.
UNDETERMINED = 1e8


def identify_map(
    dataset: xr.Dataset,
    library: Library,
    *,
    confidence: float = 0.95,
    gain: bool | None = None,
    noise: Noise | str | None = None,
    prior: Mapping[str, float] | None = None,
    calibration: Calibration | None = None,
    smoothing: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Identify the material of every pixel.

    Parameters
    ----------
    dataset
        A map of parameters (:func:`pbrdf.fit_map`), or Stokes parameters with dimensions beside ``geometry``, as
        :func:`pbrdf.fit_map` takes them. What is on disk is read block by block.
    library
        The materials; for a map of parameters, of the map's model.
    confidence
        How often the set of a pixel is to hold the true material.
    gain
        For Stokes parameters, whether each pixel's intensities have a common factor that is not known; None takes what
        the data set says of its scale.
    noise
        For Stokes parameters: stated noise, see :func:`pbrdf.fit`.
    prior, calibration
        See :func:`pbrdf.identify`.
    smoothing
        Standard deviation in pixels of the Gaussian that smooths the logarithms of the likelihoods over the image before
        they become probabilities; 0 for none.
    progress
        Called with the number of finished pixels and of all.

    Returns
    -------
    Dataset
        Over the dimensions of the image: ``material`` (number of the most probable of the set, −1 none of these, −2 not
        measured), ``confidence`` (its probability, given that it is one of the library), and over ``material_name`` and
        the image ``probability``, ``p_value`` and ``in_set``.

    Raises
    ------
    FitError, DataError
        If the library is empty or of another model, an option is none, or the data are neither form.
    """
    check_request(library, confidence)
    if not (np.isfinite(smoothing) and smoothing >= 0.0):
        raise FitError(f"smoothing={smoothing:g}: give a number of pixels, 0 or more")
    by_parameters = "estimate" in dataset and "parameter" in dataset.dims
    if not by_parameters and DIMENSION not in dataset.dims:
        raise DataError(
            f"neither a map of parameters (estimate over parameter) nor data over {DIMENSION}: there is nothing to identify"
        )
    own = (
        ("parameter", "other")
        if by_parameters
        else (DIMENSION, "stokes_out", "stokes_in", "stokes_row", "stokes_column")
    )
    dims = [str(d) for d in dataset.dims if d not in own]
    if not dims:
        raise DataError("the data have no dimension of an image: use identify")
    shape = tuple(dataset.sizes[d] for d in dims)
    used = calibration or library.calibration
    if isinstance(noise, str):
        noise = parse_noise(noise)
    materials = library.materials
    log_evidence = np.full((len(materials), *shape), np.nan, dtype=np.float32)
    p_value = np.full_like(log_evidence, np.nan)
    likelihoods = (
        _of_parameters(dataset, dims, materials)
        if by_parameters
        else _of_stokes(dataset, dims, materials, gain, noise)
    )
    done, total = 0, int(np.prod(shape))
    for place in _blocks(shape):
        block = dataset.isel(dict(zip(dims, place, strict=True))).transpose(
            *own[: 1 + by_parameters], ..., *dims, missing_dims="ignore"
        )
        size = tuple(part.stop - part.start for part in place)
        known, found, distance, freedom = likelihoods(block)
        if known.any():
            scores = nominal(distance, freedom)
            if used is not None:
                scores = used.p_values(scores)
            for target, values in ((log_evidence, found), (p_value, scores)):
                part = np.full((len(materials), known.size), np.nan, dtype=np.float32)
                part[:, known] = values.T
                target[(slice(None), *place)] = part.reshape(len(materials), *size)
        done += int(np.prod(size))
        if progress is not None:
            progress(done, total)
    return _judged(log_evidence, p_value, library, confidence, prior, used, smoothing, dims, dataset)


def _blocks(shape: Sequence[int]) -> Iterator[tuple[slice, ...]]:
    """Parts of the image of about PIXELS pixels, whole rows where they fit."""
    steps, left = [], PIXELS
    for size in reversed(shape):
        step = max(min(size, left), 1)
        steps.append(step)
        left = max(left // size, 1)
    starts = [range(0, size, step) for size, step in zip(shape, reversed(steps), strict=True)]
    for corner in itertools.product(*starts):
        yield tuple(
            slice(at, min(at + step, size))
            for at, step, size in zip(corner, reversed(steps), shape, strict=True)
        )


#: Known pixels, and of these log evidence (N, C), distance (N, C) and degrees of freedom (N,).
_Likelihoods = Callable[[Any], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


def _of_parameters(dataset: xr.Dataset, dims: Sequence[str], materials: Sequence[Material]) -> _Likelihoods:
    space = materials[0].space
    names = [str(name) for name in dataset["parameter"].values]
    model = dataset.attrs.get("model")
    if model is not None and str(model) != space.model.name and f'"{space.model.name}"' not in str(model):
        raise FitError(
            f"the map is of the model {model}, the library's material {materials[0].name} of {space.model.name}"
        )
    if missing := [name for name in space.names if name not in names]:
        raise FitError(
            f"the map has no parameter {', '.join(missing)}, which differs between the specimens of {materials[0].name}: "
            "fit with it free"
        )
    order = [names.index(name) for name in space.names]
    unit = np.sqrt(np.mean([np.diag(m.covariance) for m in materials], axis=0))
    rows, columns = np.tril_indices(len(order))

    def likelihoods(block: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        estimate = block["estimate"].values.reshape(len(names), -1)[order].T
        error = block["standard_error"].values.reshape(len(names), -1)[order].T
        known = np.isfinite(estimate).all(axis=1)
        estimate, error = estimate[known], error[known]
        unknowns = space.to_unknowns(estimate)
        spread = error / space.derivative(estimate)
        undetermined = ~np.isfinite(spread) | (spread <= 0.0)
        spread = np.where(undetermined, np.sqrt(UNDETERMINED) * unit, spread)
        if "correlation" in block:
            whole = block["correlation"].values.reshape(len(names), len(names), -1)[order][:, order][
                :, :, known
            ]
            correlation = np.nan_to_num(whole[rows, columns]).T
            correlation[:, rows == columns] = 1.0
            off = rows != columns
            correlation[:, off] *= ~(undetermined[:, rows[off]] | undetermined[:, columns[off]])
        else:
            correlation = np.broadcast_to((rows == columns).astype(float), (len(spread), len(rows)))
        covariance = correlation * spread[:, rows] * spread[:, columns]
        found, distance = parameter_evidence(materials, unknowns, covariance)
        return known, found, distance, (~undetermined).sum(axis=1)

    return likelihoods


def _of_stokes(
    dataset: xr.Dataset,
    dims: Sequence[str],
    materials: Sequence[Material],
    gain: bool | None,
    noise: Noise | None,
) -> _Likelihoods:
    from pbrdf.identification.evidence import evidence
    from pbrdf.inversion.observations import Observations

    free = unknown_gain(dataset) if gain is None else gain

    def likelihoods(block: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        flat = block.stack(pixel=list(dims)).reset_index("pixel", drop=True)
        found = []
        for pixel in range(flat.sizes["pixel"]):
            found.append(Observations.from_dataset(flat.isel(pixel=pixel), noise))
        result = evidence(materials, found, gain=free)
        known = np.ones(len(found), dtype=bool)
        return known, result.log_evidence, result.distance, result.degrees_of_freedom

    return likelihoods


def _judged(
    log_evidence: np.ndarray,
    p_value: np.ndarray,
    library: Library,
    confidence: float,
    prior: Mapping[str, float] | None,
    calibration: Calibration | None,
    smoothing: float,
    dims: Sequence[str],
    dataset: xr.Dataset,
) -> xr.Dataset:
    import xarray as xr

    known = np.isfinite(p_value).all(axis=0)
    if smoothing > 0.0:
        log_evidence = _smoothed(log_evidence, known, smoothing)
    temperature = 1.0 if calibration is None else calibration.temperature
    share = np.full_like(p_value, np.nan)
    share[:, known] = probabilities(log_evidence[:, known].T, shares(library, prior), temperature).T
    inside = p_value > 1.0 - confidence
    best = np.where(inside, share, -1.0).argmax(axis=0).astype(np.int16)
    material = np.where(inside.any(axis=0), best, NONE_OF_THESE).astype(np.int16)
    material[~known] = NOT_MEASURED
    sure = np.take_along_axis(share, np.maximum(material, 0)[None], axis=0)[0]
    names = library.names
    values = np.array([NOT_MEASURED, NONE_OF_THESE, *range(len(names))], dtype=np.int16)
    words = " ".join(name.replace(" ", "_") for name in ("not_measured", "none_of_these", *names))
    return xr.Dataset(
        {
            "material": (
                dims,
                material,
                {
                    "long_name": "most probable material of the set",
                    "flag_values": values,
                    "flag_meanings": words,
                },
            ),
            "confidence": (
                dims,
                np.where(material >= 0, sure, np.nan).astype(np.float32),
                {
                    "long_name": "probability of that material, given that it is one of the library",
                    "units": "1",
                },
            ),
            "probability": (("material_name", *dims), share, {"units": "1"}),
            "p_value": (("material_name", *dims), p_value, {"units": "1"}),
            "in_set": (
                ("material_name", *dims),
                inside,
                {"long_name": f"whether it may be, at {confidence:g}"},
            ),
        },
        coords={"material_name": names, **{d: dataset[d] for d in dims if d in dataset.coords}},
        attrs={
            "confidence": confidence,
            "calibration": "none"
            if calibration is None
            else calibration.measurements or "labelled measurements",
            "smoothing": smoothing,
        },
    )


def _smoothed(log_evidence: np.ndarray, known: np.ndarray, width: float) -> np.ndarray:
    """Differences between materials averaged over known neighbours, unbounded likelihoods first cut at a thousandth."""
    from scipy.ndimage import gaussian_filter

    # a pixel may say how sure it is, but not outvote a neighbourhood by a likelihood of e^-1000
    logit = np.where(known, np.maximum(log_evidence - np.nanmax(log_evidence, axis=0), np.log(1e-3)), 0.0)
    weight = gaussian_filter(known.astype(float), width)
    return np.stack(
        [
            np.where(known, gaussian_filter(layer, width) / np.maximum(weight, 1e-12), np.nan)
            for layer in logit
        ]
    )
