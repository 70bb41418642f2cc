"""Fit a model at every pixel of an image, or along any dimensions beside the geometries."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import DIMENSION, VARIABLES, std_name
from pbrdf.errors import DataError
from pbrdf.inversion.held_values import Held
from pbrdf.inversion.noise import Noise
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.parameter_map.layout import PixelStatus
from pbrdf.inversion.parameter_map.map_fit import LABEL, MapFit
from pbrdf.models import DoubleGauss, Model

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit_map"]

#: Pixels of a block, at most, and numbers that are read for one: about 0.7 GB with all that is made of them.
PIXELS, NUMBERS = 1 << 16, 1 << 24
_BUSY = threading.Lock()


def fit_map(
    dataset: xr.Dataset,
    model: type[Model] | Model | str = DoubleGauss,
    *,
    options: Mapping[str, str] | None = None,
    fix: Mapping[str, Held] | None = None,
    free: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    nuisances: Sequence[Nuisance | str] = (),
    loss: str = "linear",
    starts: int = 64,
    noise: Noise | str | None = None,
    objective: str = "stokes",
    covariance: ArrayLike | None = None,
    seed: int = 0,
    max_iterations: int = 100,
    share: Sequence[str] = (),
    labels: str | xr.DataArray | ArrayLike | None = None,
    correlation: bool = False,
    block: int | Mapping[str, int] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Fit a model along every dimension beside ``geometry``: at every pixel (y, x), sample, time …

    The image is fitted block by block. In a block a coarse grid of pixels is searched from many starts, the others
    start from their neighbours, and those whose χ² stands out are tried again
    (:mod:`pbrdf.inversion.parameter_map.search`). Each pixel is what :func:`pbrdf.fit` of it would be; one that cannot
    be fitted says so in ``status`` and stops no other.

    Parameters
    ----------
    dataset
        Data set of the project's schema with further dimensions, in any order, in its data variables and, where the
        geometry is that of each pixel, in ``theta_i``, ``theta_r`` and ``phi``. NaN is not measured and left out, and
        so are directions below the horizon, infinite values and uncertainties that are not above 0, unless that is so
        for every value of a variable in memory: that is refused. A variable
        ``mask`` over the further dimensions, False or 0 where a pixel is to be left out, is kept to. Of Dask arrays
        the map is lazy, too: their chunks are the blocks, and ``geometry`` must be one chunk. Other arrays that lie
        in a file are read block by block.
    model, options, fix, free, bounds, start, priors, nuisances, loss, noise, objective, seed, max_iterations
        As for :func:`pbrdf.fit`.
    starts
        Number of starts of the coarse grid's pixels and of those that are tried again.
    covariance
        As for :func:`pbrdf.fit`, shape (G, C, C), the same for all pixels.
    share
        Free parameters that all pixels have in common, or all of one label.
    labels
        Which part of the sample each pixel belongs to, integers over the further dimensions, or the name of such a
        variable; pixels of label 0 are left out.
    correlation
        Whether the correlations of the parameters are wanted.
    block
        Pixels of a block: one number for every further dimension, or numbers by their names; None chooses.
    progress
        Called with the number of pixels that are done and of all. Of Dask arrays use Dask's own.

    Returns
    -------
    Dataset
        ``estimate``, ``standard_error`` and ``flags`` over (``parameter``, further dimensions), ``chi2``,
        ``degrees_of_freedom``, ``status``, ``optima`` (distinct ones that were seen) and ``starts`` (followed) over
        the further dimensions, and ``correlation`` (``parameter``, ``other``, …) on request, angles in radians.
        Attributes of ``status`` and ``flags`` name their values. Attributes of the whole: ``model``, ``settings``,
        ``noise``; of what is not lazy ``pixels_fitted``, ``seconds`` and ``share_of_several_optima``: of the pixels
        searched from many starts, the share of those that had more than one optimum.

    Raises
    ------
    FitError, DataError, ModelError
        If the options or the form of the data do not allow a fit; the message says why.
    """
    if labels is not None and not isinstance(labels, str):
        dataset, labels = _with_labels(dataset, labels), LABEL
    prepared = MapFit.prepare(
        dataset,
        model,
        options=options,
        fix=fix,
        free=free,
        bounds=bounds,
        start=start,
        priors=priors,
        nuisances=nuisances,
        loss=loss,
        starts=starts,
        noise=noise,
        objective=objective,
        covariance=covariance,
        seed=seed,
        max_iterations=max_iterations,
        share=share,
        labels=labels,
        correlation=correlation,
    )
    if any(variable.chunks for variable in dataset.variables.values()):
        if prepared.settings["share"]:
            raise DataError(
                "share: what pixels share is found in several passes over all of them, which Dask arrays would have to "
                "be loaded for: give a data set that was opened without chunks, it is read block by block"
            )
        return _lazy(prepared, dataset, block)
    _require_uncertainties(dataset, prepared.dims)
    clock = time.perf_counter()
    blocks = list(blocks_of(dataset, prepared.dims, block))
    prepared = prepared.solve_shared(_Blocks(dataset, blocks))
    result = prepared.template()
    for name in result.data_vars:
        result[name].variable.data = np.array(result[name].values)
    total, done = math.prod(dataset.sizes[d] for d in prepared.dims), 0
    for where in blocks:
        report = None
        if progress is not None:
            report = lambda fitted, _, before=done: progress(before + fitted, total)  # noqa: E731
        found = prepared.fit_block(dataset.isel(where), report)
        for name in found.data_vars:
            result[name].variable[where] = found[name].variable
        done += found["status"].size
    result.attrs |= summary(result) | {"seconds": time.perf_counter() - clock}
    return result


def _require_uncertainties(dataset: xr.Dataset, dims: Sequence[str]) -> None:
    """Raise if the uncertainties of a variable are nowhere above 0: nothing of it would count, and nothing said so."""
    for name in map(str, dataset.data_vars):
        std = dataset[name]
        if name not in map(std_name, VARIABLES) or not isinstance(std.variable._data, np.ndarray):
            continue
        wrong = std.values <= 0.0
        if wrong.any() and not (std.values > 0.0).any():
            pixels = math.prod(dataset.sizes[d] for d in dims if d in std.dims)
            along = tuple(std.dims.index(d) for d in std.dims if d not in dims)
            raise DataError(
                f"{name} is 0 or less at {int(wrong.any(axis=along).sum())} of {pixels} pixels, and nowhere above 0: "
                "it is a standard uncertainty; leave it out where none is known"
            )


@dataclass(frozen=True)
class _Blocks:
    """Blocks of a data set, each read when it is its turn, as often as they are gone through."""

    dataset: xr.Dataset
    where: list[dict[str, slice]]

    def __iter__(self) -> Iterator[xr.Dataset]:
        return (self.dataset.isel(where) for where in self.where)


def summary(found: xr.Dataset) -> dict[str, Any]:
    """Attributes that are known when all pixels are: how many were fitted, how often there was one optimum more."""
    status, many = found["status"].values, found["starts"].values > 1
    several = float((found["optima"].values[many] > 1).mean()) if many.any() else math.nan
    fitted = np.isin(status, (PixelStatus.CONVERGED, PixelStatus.NOT_CONVERGED))
    return {"pixels_fitted": int(fitted.sum()), "share_of_several_optima": several}


def blocks_of(
    dataset: xr.Dataset, dims: Sequence[str], block: int | Mapping[str, int] | None
) -> Iterator[dict[str, slice]]:
    """Parts of an image, one after the other, as indices along its dimensions."""
    sizes = block_sizes(dataset, dims, block)
    ranges = [range(0, dataset.sizes[d], sizes[d]) for d in dims]
    for begin in itertools.product(*ranges):
        yield {d: slice(b, min(b + sizes[d], dataset.sizes[d])) for d, b in zip(dims, begin, strict=True)}


def block_sizes(
    dataset: xr.Dataset, dims: Sequence[str], block: int | Mapping[str, int] | None
) -> dict[str, int]:
    """Pixels of a block along each dimension: as asked for, else as many as memory of moderate size holds."""
    sizes = {d: dataset.sizes[d] for d in dims}
    if isinstance(block, Mapping):
        for name in block:
            if name not in sizes:
                raise DataError(f"block: {name!r} is no dimension of the image; these are {', '.join(dims)}")
    if block is not None:
        asked = dict(block) if isinstance(block, Mapping) else dict.fromkeys(dims, block)
        for name, size in asked.items():
            if size < 1:
                raise DataError(f"block: {size} pixels along {name}; at least 1 is needed")
        return {d: max(1, min(int(asked.get(d, n)), n)) for d, n in sizes.items()}
    numbers = sum(
        v.size // math.prod(dataset.sizes[d] for d in dims if d in v.dims)
        for v in dataset.variables.values()
        if set(v.dims) & set(dims)
    )
    most = max(1, min(PIXELS, NUMBERS // max(numbers, 1)))
    while math.prod(sizes.values()) > most:
        longest = max(sizes, key=lambda d: sizes[d])
        sizes[longest] = -(-sizes[longest] // 2)
    return sizes


def _with_labels(dataset: xr.Dataset, labels: xr.DataArray | ArrayLike) -> xr.Dataset:
    """The data set with labels as a variable."""
    import xarray as xr

    if not isinstance(labels, xr.DataArray):
        dims = [str(d) for d in dataset.sizes if d != DIMENSION and not str(d).startswith("stokes_")]
        array = np.asarray(labels)
        if array.shape != tuple(dataset.sizes[d] for d in dims):
            raise DataError(
                f"labels has the shape {array.shape}: it needs that of the image, "
                f"{tuple(dataset.sizes[d] for d in dims)} along {', '.join(dims)}"
            )
        labels = xr.DataArray(array, dims=dims)
    return dataset.assign_coords({LABEL: labels})


def _lazy(prepared: MapFit, dataset: xr.Dataset, block: int | Mapping[str, int] | None) -> xr.Dataset:
    """The map as Dask arrays, a task for each chunk of the image."""
    import xarray as xr

    if block is not None:
        dataset = dataset.chunk(block_sizes(dataset, prepared.dims, block))
    for name in map(str, dataset.variables):
        variable = dataset.variables[name]
        for dim, own in variable.chunksizes.items():
            if dim not in prepared.dims and len(own) > 1:
                raise DataError(
                    f"{name} lies in {len(own)} chunks along {dim!r}, but every pixel needs all of it: "
                    f"dataset.chunk({{{dim!r}: -1}}) makes it one"
                )
    try:
        chunks = {d: dataset.chunksizes[d] for d in prepared.dims if d in dataset.chunksizes}
    except ValueError as error:
        raise DataError(
            f"the variables lie in chunks that do not agree: dataset.unify_chunks() makes them ({error})"
        ) from None
    form = prepared.template()
    chunked = form.chunk({str(d): chunks.get(str(d), -1) for d in form.dims})
    found = xr.map_blocks(_fit_chunk, dataset, kwargs={"prepared": prepared}, template=chunked)
    return found.assign_coords(form.coords)


def _fit_chunk(block: xr.Dataset, *, prepared: MapFit) -> xr.Dataset:
    """One block at a time: each takes all cores."""
    with _BUSY:
        return prepared.fit_block(block)
