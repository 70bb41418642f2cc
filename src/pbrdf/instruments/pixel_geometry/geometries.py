"""One picture of a curved sample as one data set: its pixels are the geometries, each by itself or by directions.

Pixels of nearly the same directions are one geometry. Within such a bin the Stokes parameters run on, and near the
mirror direction steeply: their plain mean is not what belongs to the mean direction, and their scatter not their error.
So a surface of second order is fitted over the two directions in which the bin extends most (those of the pixels of one
series lie on a surface), and its value at the mean direction is taken, with its standard error from what is left over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pbrdf.data.alignment import in_stokes_order, require_same_labels
from pbrdf.data.build import make_dataset
from pbrdf.data.schema import COVARIANCE, DIMENSION
from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.labels import label_names
from pbrdf.optics.angles import within_half_turn, within_turn
from pbrdf.optics.stokes import STOKES

__all__ = ["BIN", "as_geometries"]

#: Width of the bins of directions, radians.
BIN = math.radians(5.0)
#: Pixels from which on a bin's values are fitted by a surface of second order, which has six terms.
_FEWEST = 12
#: Parts of the mean square of a bin's directions, and of the surface's terms, that count as 0.
_FLAT, _SINGULAR = 1e-8, 1e-3


class _Pixels(NamedTuple):
    """Pixels of one label: angles (N, 3), values (N, C), covariances (N, C, C), and their series (N,)."""

    angles: np.ndarray
    values: np.ndarray
    covariance: np.ndarray | None
    series: np.ndarray


def as_geometries(
    dataset: xr.Dataset,
    labels: xr.DataArray | np.ndarray | None = None,
    *,
    bins: float | None = BIN,
    every: int = 1,
) -> dict[str, xr.Dataset]:
    """The pixels of pictures of a curved sample as geometries of one data set, which a fit reads.

    Parameters
    ----------
    dataset
        Of :func:`.map_dataset`: Stokes parameters over (``geometry``, ``y``, ``x``) and the angles of each pixel.
    labels
        Which part of the sample each pixel belongs to, whole numbers over (``y``, ``x``); pixels with 0 are left out.
        By default all belong to one, called ``sample``.
    bins
        Pixels of the same series whose directions differ by about this angle, radians, become one geometry; None takes
        the pixels by themselves.
    every
        Without bins: take every so manieth pixel.

    Returns
    -------
    dict of str to xarray.Dataset
        By the names of the labels. ``group`` is the series. Bins of twelve pixels or more have the standard error of
        their scatter about a surface of second order, but no less than that of the pixels' own noise. The pixels of
        smaller bins stay by themselves, or, where their noise is not known, are left out.

    Raises
    ------
    DataError
        If the data set is no such map, a label has no measured pixel, or the labels are of other pixels.
    """
    dataset = in_stokes_order(dataset)
    known = [k for k, name in enumerate(STOKES) if name in dataset]
    if 0 not in known or any(name not in dataset[STOKES[0]].dims for name in (DIMENSION, "y", "x")):
        raise DataError("pixels become geometries of Stokes parameters over geometry, y and x (map_dataset)")
    if every < 1 or (bins is not None and not 0.0 < bins <= 0.5 * math.pi):
        raise DataError("bins are from 0 to 90 degrees, and every so manieth pixel is 1 or more")
    if labels is None:
        numbers, names = np.ones((dataset.sizes["y"], dataset.sizes["x"]), dtype=int), {1: "sample"}
    else:
        array = labels if isinstance(labels, xr.DataArray) else xr.DataArray(labels, dims=("y", "x"))
        numbers, names = array.transpose("y", "x").values, label_names(array)
        if numbers.shape != (dataset.sizes["y"], dataset.sizes["x"]) or numbers.dtype.kind not in "iub":
            raise DataError(
                f"labels are whole numbers, one for each of the picture's {dataset.sizes['y']} × "
                f"{dataset.sizes['x']} pixels"
            )
        require_same_labels(array, "the labels", dataset, "the pictures", ("y", "x"))
        if not names:
            raise DataError("no pixel has a label other than 0")
    return {
        name: _one_label(dataset, known, numbers == number, name, bins, every)
        for number, name in names.items()
    }


def _one_label(
    dataset: xr.Dataset, known: list[int], chosen: np.ndarray, name: str, bins: float | None, every: int
) -> xr.Dataset:
    pixels = _taken(dataset, known, chosen, every if bins is None else 1)
    count = len(pixels.series)
    if not count:
        raise DataError(f"no pixel of {name!r} was measured")
    if bins is not None:
        pixels = _binned(pixels, bins)
        if not len(pixels.series):
            raise DataError(f"{name!r} has too few pixels for bins, and no noise of single ones is known")
    covariance = None
    if pixels.covariance is not None:
        # no error at all is one that is not known
        stated = (np.diagonal(pixels.covariance, axis1=1, axis2=2) > 0.0).all(axis=1)
        covariance = np.full((len(pixels.series), 4, 4), np.nan)
        block = covariance[:, np.array(known)[:, None], known]
        block[stated] = pixels.covariance[stated]
        covariance[:, np.array(known)[:, None], known] = block
    group: Any = 0
    if dataset.sizes[DIMENSION] > 1:
        group = dataset["series"].values[pixels.series] if "series" in dataset.coords else pixels.series
    wavelength = dataset.coords.get("wavelength")
    kept = ("scale", "instrument", "pixel_geometry")
    measured: dict[str, Any] = {STOKES[k]: pixels.values[:, i] for i, k in enumerate(known)}
    return make_dataset(
        *pixels.angles.T,
        quantity=dataset.attrs.get("quantity", "dn"),
        **measured,
        covariance=covariance,
        wavelength=None if wavelength is None else wavelength.values[pixels.series],
        group=group,
        simulated=bool(dataset.attrs.get("simulated", 0)),
        attrs={
            "title": name,
            "source": "pixels of a picture as geometries",
            "pixels": count,
            **({} if bins is None else {"bins_degree": round(math.degrees(bins), 9)}),
            **{key: dataset.attrs[key] for key in kept if key in dataset.attrs},
        },
    )


def _taken(dataset: xr.Dataset, known: list[int], chosen: np.ndarray, every: int) -> _Pixels:
    """The measured pixels of a label."""
    parts = []
    for i, one in enumerate(_loaded(dataset, known)):
        stokes = np.stack([one[STOKES[k]].transpose("y", "x").values for k in known], axis=-1)
        where = np.nonzero(chosen & np.isfinite(stokes).all(axis=-1))
        where = tuple(index[::every] for index in where)
        angles = [
            xr.broadcast(one[a], one[STOKES[0]])[0].transpose("y", "x").values[where]
            for a in ("theta_i", "theta_r", "phi")
        ]
        covariance = None
        if COVARIANCE in one:
            whole = one[COVARIANCE].transpose("y", "x", ...).values[where]
            covariance = np.nan_to_num(whole[:, np.array(known)[:, None], known])
        series = np.full(len(where[0]), i)
        parts.append(_Pixels(np.stack(angles, axis=-1), stokes[where], covariance, series))
    angles, values, covariances, series = zip(*parts, strict=True)
    spread = None if covariances[0] is None else np.concatenate(covariances)
    return _Pixels(np.concatenate(angles), np.concatenate(values), spread, np.concatenate(series))


def _loaded(dataset: xr.Dataset, known: list[int]) -> Iterator[xr.Dataset]:
    """One geometry after the other in memory; of Dask arrays each chunk is computed once."""
    wanted = [*(STOKES[k] for k in known), *(name for name in (COVARIANCE,) if name in dataset)]
    needed = dataset[[*wanted, "theta_i", "theta_r", "phi"]]
    lengths = needed.unify_chunks().chunksizes.get(DIMENSION, (1,) * needed.sizes[DIMENSION])
    begin = 0
    for length in lengths:
        chunk = needed.isel({DIMENSION: slice(begin, begin + length)}).compute()
        yield from (chunk.isel({DIMENSION: i}) for i in range(length))
        begin += length


def _bin_numbers(pixels: _Pixels, width: float) -> np.ndarray:
    """A number for each pixel, the same for those of one bin, counted from 0."""
    theta = np.floor(pixels.angles[:, :2] / width)
    middle = (theta + 0.5) * width
    # the azimuth counts less the nearer the rays are to the normal; of one lamp it follows from the zenith angles, but
    # for the side, so that narrow cells would only cut bins into pieces
    turns = np.maximum(1.0, np.round(2.0 * np.pi * np.sqrt(np.sin(middle).prod(axis=-1)) / (2.0 * width)))
    # a cell lies about φ = 0: the plane of incidence is not cut
    azimuth = np.mod(np.floor(pixels.angles[:, 2] / (2.0 * np.pi) * turns + 0.5), turns)
    keys = np.column_stack([pixels.series, theta, azimuth]).astype(int)
    return np.unique(keys, axis=0, return_inverse=True)[1].ravel()


def _binned(pixels: _Pixels, width: float) -> _Pixels:
    """One geometry for each bin."""
    number = _bin_numbers(pixels, width)
    count = np.bincount(number)
    small = count[number] < _FEWEST
    if pixels.covariance is None:
        if small.all():
            return _Pixels(pixels.angles[:0], pixels.values[:0], None, pixels.series[:0])
        kept = ~small
        pixels = _Pixels(pixels.angles[kept], pixels.values[kept], None, pixels.series[kept])
        number = number[kept]
    else:
        # too few to say how values run on: each pixel by itself
        number = np.where(small, len(count) + np.arange(len(number)), number)
    number = np.unique(number, return_inverse=True)[1].ravel()
    count = np.bincount(number)
    first = np.zeros(len(count), dtype=int)
    first[number[::-1]] = np.arange(len(number))[::-1]

    def mean(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(values), -1)
        sums = np.stack([np.bincount(number, column) for column in flat.T], axis=-1)
        return (sums / count[:, None]).reshape(-1, *values.shape[1:])

    def products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Means of all products of columns, one at a time: pixels are many."""
        columns = [[np.bincount(number, a * b) for b in right.T] for a in left.T]
        return np.moveaxis(np.array(columns) / count, -1, 0)

    # from the first of each bin, so that the turn from 360° to 0° does no harm
    off = pixels.angles - pixels.angles[first][number]
    off[:, 2] = within_half_turn(off[:, 2])
    shift = mean(off)
    angles = pixels.angles[first] + shift
    weight = np.sqrt(np.maximum(np.sin(angles[:, 0]) * np.sin(angles[:, 1]), 0.0))
    apart = off - shift[number]
    apart[:, 2] *= weight[number]
    # across the bin: the two directions in which it extends most, in its own standard deviations
    size, axes = np.linalg.eigh(products(apart, apart))
    size = np.where(size > _FLAT * width**2, size, np.inf)
    a, b = ((np.einsum("nk,nk->n", apart, axes[number, :, k]) / np.sqrt(size[number, k])) for k in (2, 1))
    # a and b have the mean square 1: terms that no direction bears out are 0, and leave the plain mean
    terms = np.stack([np.ones_like(a), a, b, a * a - 1.0, a * b, b * b - 1.0], axis=-1)
    moments = products(terms, terms)
    inverse = np.linalg.pinv(moments, rcond=_SINGULAR, hermitian=True)
    rank = np.rint(np.einsum("bij,bji->b", inverse, moments))
    surface = inverse @ products(terms, pixels.values)
    left = pixels.values - np.einsum("nt,ntc->nc", terms, surface[number])
    # at the mean direction
    there = np.array([1.0, 0.0, 0.0, -1.0, 0.0, -1.0])
    fitted = count > 1
    values = np.where(fitted[:, None], np.einsum("t,btc->bc", there, surface), pixels.values[first])
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = products(left, left) / (count - rank)[:, None, None]
    lever = np.einsum("i,bij,j->b", there, inverse, there)
    spread *= lever[:, None, None]
    covariance = np.where(fitted[:, None, None], spread, 0.0)
    if pixels.covariance is not None:
        own = mean(pixels.covariance) * (np.where(fitted, lever, 1.0) / count)[:, None, None]
        scatters = np.trace(covariance, axis1=1, axis2=2) > np.trace(own, axis1=1, axis2=2)
        covariance = np.where(scatters[:, None, None], covariance, own)
    kept = (np.diagonal(covariance, axis1=1, axis2=2) > 0.0).all(axis=1)
    angles[:, 2] = within_turn(angles[:, 2])
    angles[:, :2] = np.maximum(angles[:, :2], 0.0)
    return _Pixels(angles[kept], values[kept], covariance[kept], pixels.series[first][kept])
