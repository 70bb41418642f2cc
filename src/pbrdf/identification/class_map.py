"""Which material each pixel of an image shows.

From a map of parameters (:func:`pbrdf.fit_map`) by the closed form of
:mod:`pbrdf.identification.parameter_evidence`; from Stokes parameters at every pixel by the integrated likelihoods of
:mod:`pbrdf.identification.evidence`, see :mod:`pbrdf.identification.pixels`. Each pixel is judged by itself. Where
materials fill regions, the logarithms of the likelihoods may be smoothed over neighbours first, which trades fine
detail for fewer stray pixels; p-values, and so what is none of the materials, stay those of the pixel.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import DIMENSION, STOKES_AXES, VARIABLES
from pbrdf.errors import DataError, FitError
from pbrdf.identification.conformal import Calibration, nominal, probabilities, told
from pbrdf.identification.identify import check_request, shares, unknown_gain
from pbrdf.identification.library import Library
from pbrdf.identification.pixels import of_parameters, of_stokes
from pbrdf.inversion.noise import Noise, parse_noise

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["NONE_OF_THESE", "NOT_MEASURED", "identify_map"]

#: What stands for a pixel that is like none of the materials, and for one that has no data.
NONE_OF_THESE, NOT_MEASURED = -1, -2
#: Pixels of a block, at most, and numbers that are read for one: some 300 MB with all that is made of them.
PIXELS, NUMBERS = 1 << 16, 1 << 22
#: What a pixel of its own says at most against a material, where neighbours are looked at: a likelihood ratio.
SAYS = 1e-3


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
        A map of parameters (:func:`pbrdf.fit_map`), or a data set with dimensions beside ``geometry``. What is on disk
        is read block by block. Pixels without a value, that did not converge or failed, or that a variable ``mask``
        leaves out (False or 0), are not measured; a parameter on a bound or undetermined says nothing.
    library
        The materials; for a map of parameters, of the map's model.
    confidence
        How often the set of a pixel is to hold the true material.
    gain
        For data, whether each pixel's intensities have a common factor that is not known; None takes what the data set
        says of its scale.
    noise
        For data: stated noise, see :func:`pbrdf.fit`.
    prior, calibration
        See :func:`pbrdf.identify`.
    smoothing
        Standard deviation in pixels of the Gaussian that smooths the logarithms of the likelihoods over the image
        before they become probabilities; 0 for none.
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
        If the library is empty or of another model, an option is none, or the data are neither form; or if pixels of a
        map are not yet fitted that no ``mask`` leaves out.
    """
    check_request(library, confidence)
    if not (math.isfinite(smoothing) and smoothing >= 0.0):
        raise FitError(f"smoothing={smoothing:g}: give a number of pixels, 0 or more")
    if isinstance(noise, str):
        noise = parse_noise(noise)
    share = shares(library, prior)
    used = calibration or library.calibration
    temperature = 1.0 if used is None else used.temperature
    materials = library.materials
    if "estimate" in dataset.variables and "parameter" in dataset.dims:
        dims = [str(d) for d in dataset["estimate"].dims if d != "parameter"]
        of_block = of_parameters(dataset, dims, materials)
        numbers = dataset.sizes["parameter"] * (2 + dataset.sizes.get("other", 0))
    elif DIMENSION in dataset.dims and set(VARIABLES) & set(map(str, dataset.data_vars)):
        measured = [dataset[name] for name in map(str, dataset.data_vars) if name in VARIABLES]
        dims = list(dict.fromkeys(str(d) for array in measured for d in array.dims))
        dims = [d for d in dims if d not in (DIMENSION, *STOKES_AXES)]
        free = unknown_gain(dataset) if gain is None else gain
        of_block = of_stokes(
            dataset, dims, materials, free, noise, _least(used, len(materials), confidence), temperature
        )
        numbers = sum(
            array.size // math.prod(dataset.sizes[d] for d in array.dims if d in dims) for array in measured
        )
    else:
        raise DataError(
            f"neither a map of parameters (estimate over parameter) nor measured data over {DIMENSION}: there is "
            f"nothing to identify in {', '.join(map(str, dataset.variables)) or 'no variables'}"
        )
    if not dims:
        raise DataError("the data have no dimension of an image beside the geometries: use identify")
    shape = tuple(dataset.sizes[d] for d in dims)
    log_evidence = np.full((len(materials), *shape), np.nan, dtype=np.float32)
    p_value = np.full_like(log_evidence, np.nan)
    done, total = 0, math.prod(shape)
    blocks = list(_blocks(shape, max(1, min(PIXELS, NUMBERS // max(numbers, 1)))))
    for place in blocks:
        known, found, distance, freedom = of_block(dataset.isel(dict(zip(dims, place, strict=True))))
        if known.any():
            scores = nominal(distance, freedom)
            if used is not None:
                scores = used.p_values(scores)
            size = tuple(part.stop - part.start for part in place)
            for target, values in ((log_evidence, found), (p_value, scores)):
                part = np.full((len(materials), known.size), np.nan, dtype=np.float32)
                part[:, known] = values.T
                target[(slice(None), *place)] = part.reshape(len(materials), *size)
        done += known.size
        if progress is not None:
            progress(done, total)
    if smoothing > 0.0:
        _smooth(log_evidence, smoothing)
    # probabilities take the place of the logarithms: an image of all materials is large
    judged = _Judged(log_evidence, shape)
    for place in blocks:
        judged.put(place, p_value, share, temperature, confidence)
    return _dataset(judged, p_value, library, confidence, used, smoothing, dims, dataset)


def _least(calibration: Calibration | None, count: int, confidence: float) -> np.ndarray:
    """Nominal probabilities that a calibration still takes for the material's, shape (C,); 1 where it says nothing."""
    if calibration is None:
        return np.ones(count)
    return np.array([np.quantile(own, 1.0 - confidence) if len(own) else 1.0 for own in calibration.scores])


def _blocks(shape: Sequence[int], pixels: int) -> Iterator[tuple[slice, ...]]:
    """Parts of an image of no more than so many pixels, whole rows where they fit."""
    steps: list[int] = []
    for size in reversed(shape):
        steps.insert(0, max(min(size, pixels), 1))
        pixels //= max(size, 1)
    starts = [range(0, size, step) for size, step in zip(shape, steps, strict=True)]
    for corner in itertools.product(*starts):
        yield tuple(
            slice(at, min(at + step, size)) for at, step, size in zip(corner, steps, shape, strict=True)
        )


class _Judged:
    """What a map holds beside the p-values, block by block: probabilities where logarithms of likelihoods were."""

    def __init__(self, probability: np.ndarray, shape: Sequence[int]) -> None:
        self.probability = probability
        self.in_set = np.zeros(probability.shape, dtype=bool)
        self.material = np.full(shape, NOT_MEASURED, dtype=np.int16)
        self.confidence = np.full(shape, np.nan, dtype=np.float32)

    def put(
        self,
        place: tuple[slice, ...],
        p_value: np.ndarray,
        share: np.ndarray,
        temperature: float,
        confidence: float,
    ) -> None:
        """Judge a block."""
        here = (slice(None), *place)
        p = p_value[here]
        known = np.isfinite(p).all(axis=0)
        if not known.any():
            return
        found = probabilities(self.probability[here][:, known].T.astype(float), share, temperature)
        inside = 1.0 - confidence < p[:, known].T
        best = told(found, inside)
        some = best < found.shape[1]
        chosen = np.append(found, np.full((len(found), 1), np.nan), axis=1)[np.arange(len(found)), best]
        self.material[place][known] = np.where(some, best, NONE_OF_THESE)
        self.confidence[place][known] = chosen
        self.in_set[here][:, known] = inside.T
        self.probability[here][:, known] = found.T


def _dataset(
    judged: _Judged,
    p_value: np.ndarray,
    library: Library,
    confidence: float,
    calibration: Calibration | None,
    smoothing: float,
    dims: Sequence[str],
    dataset: xr.Dataset,
) -> xr.Dataset:
    import xarray as xr

    names = library.names
    words = ("not_measured", "none_of_these", *("_".join(name.split()) for name in names))
    over = ("material_name", *dims)
    variables: dict[str, Any] = {
        "material": (
            dims,
            judged.material,
            {
                "long_name": "most probable material of the set",
                "flag_values": np.array([NOT_MEASURED, NONE_OF_THESE, *range(len(names))], dtype=np.int16),
                "flag_meanings": " ".join(words),
            },
        ),
        "confidence": (
            dims,
            judged.confidence,
            {"long_name": "probability of that material, given that it is one of the library", "units": "1"},
        ),
        "probability": (
            over,
            judged.probability,
            {"long_name": "probability, given that it is one of the library", "units": "1"},
        ),
        "p_value": (
            over,
            p_value,
            {"long_name": "how often the material is as unlike itself as this", "units": "1"},
        ),
        "in_set": (over, judged.in_set, {"long_name": f"whether it may be, at {confidence:g}"}),
    }
    own = {name: array for name, array in dataset.coords.items() if set(array.dims) <= set(dims)}
    return xr.Dataset(
        variables,
        coords={"material_name": names, **own},
        attrs={
            "confidence": confidence,
            "calibration": "none"
            if calibration is None
            else calibration.measurements or "labelled measurements",
            "smoothing": smoothing,
        },
    )


def _smooth(log_evidence: np.ndarray, width: float) -> None:
    """Average differences between materials over known neighbours, in place; what a pixel says is cut first."""
    from scipy.ndimage import gaussian_filter

    known = np.isfinite(log_evidence).any(axis=0)
    weight = np.maximum(gaussian_filter(known.astype(np.float32), width), 1e-12)
    top = np.where(known, log_evidence.max(axis=0), 0.0)
    for layer in log_evidence:
        # a pixel may say how sure it is, but not outvote a neighbourhood by a likelihood of e^-1000
        cut = np.where(known, np.maximum(layer - top, np.log(SAYS)), 0.0)
        layer[...] = np.where(known, gaussian_filter(cut, width) / weight, np.nan)
