"""Fits of the pixels of a block: from a coarse grid with many starts to every pixel from its neighbours.

1. Pixels of a coarse grid are searched from many starts, as a single fit is.
2. Grid after grid, each ever finer, pixels start from what is interpolated between the fitted ones around them. Where
   that does not suit (the border between two materials, say) the one of these that suits best is taken, and a search in
   draft accuracy comes before the end.
3. A wrong neighbour is undone. Pixels whose χ² stands out, among their neighbours, in the block or from its expected
   distribution, are offered what was found beside them, and what suits better is followed; those that stand out most
   are tried again from many starts, and more of them as long as that finds better ends. Wherever a pixel has found a
   better end its neighbours are offered it, and theirs, until it helps none: so a whole region that went wrong together
   is mended from one pixel.

All depends on the block alone, and on no chance but the seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pbrdf.inversion.parameter_map.ends import Ends, Pixels
from pbrdf.inversion.parameter_map.lattice import Level, cells, levels, neighbours
from pbrdf.inversion.solver import NOTHING_TO_GAIN

__all__ = ["fit_pixels", "standing_out"]

#: A start suits if its χ² is no more than so many times what is expected, plus the last term for each unknown.
SUITS, FOR_EACH_UNKNOWN = 1.5, 4.0
#: A pixel whose χ² is so many deviations above its like is offered what its neighbours found; is tried again from many
#: starts, or at as many as the largest of so many normal variables has: √(2 ln B).
OFFERED, TRIED_AGAIN = 2.0, 3.5
#: Pixels tried again at first: so many, or one in so many; each time that it helps one in HELPS, MORE times as many.
AT_FIRST, ONE_IN, HELPS, MORE = 16, 4096, 20, 4
#: A neighbour's end suits better if χ² in draft accuracy is less by this part.
BETTER = 1e-3
#: Width of the cells within which pixels are compared with their like.
NEIGHBOURHOOD = 8

Progress = Callable[[int], None]


def fit_pixels(
    pixels: Pixels,
    shape: Sequence[int],
    places: np.ndarray,
    freedom: np.ndarray,
    std_known: np.ndarray,
    progress: Progress | None = None,
) -> Ends:
    """Fit every pixel.

    Parameters
    ----------
    pixels
        The fits.
    shape
        Of the block.
    places
        Place of each pixel in it, shape (B, N).
    freedom
        Degrees of freedom of each pixel, shape (B,).
    std_known
        Whether the uncertainties of each are known, shape (B,): then χ² is too.
    progress
        Called with the number of pixels that have been fitted.
    """
    ends = Ends.none(len(places), pixels.low.shape[1])
    coarse, *finer = levels(shape, places)
    ends.put(coarse.pixels, pixels.from_many(coarse.pixels, progress=progress))
    done = len(coarse.pixels)
    for level in finer:
        ends.put(level.pixels, _from_parents(pixels, level, ends, freedom))
        done += len(level.pixels)
        if progress is not None:
            progress(done)
    if len(places) > len(coarse.pixels):
        _undo_wrong_ones(pixels, ends, shape, places, freedom, std_known)
    return ends


def _from_parents(pixels: Pixels, level: Level, ends: Ends, freedom: np.ndarray) -> Ends:
    """Fit the pixels of a level, each from the fitted pixels around it."""
    parents, number = level.parents, level.pixels
    there = (parents >= 0) & ends.reached[parents]
    weights = np.where(there, level.weights, 0.0)
    lost = ~there.any(axis=1)
    total = weights.sum(axis=1)
    around = np.where(there[..., None], ends.u[parents], 0.0)
    start = np.einsum("nk,nkp->np", weights, around) / np.where(lost, 1.0, total)[:, None]
    expected = np.einsum("nk,nk->n", weights, np.where(there, _reduced(ends.cost, freedom)[parents], 0.0))
    expected = expected / np.where(lost, 1.0, total)
    result = Ends.none(len(number), start.shape[1])
    if lost.any():
        result.put(lost, pixels.from_many(number[lost]))

    def bad(cost: np.ndarray, of: np.ndarray) -> np.ndarray:
        scale = np.maximum(expected[of], 1e-12)
        values: np.ndarray = 2.0 * cost > SUITS * scale * (
            freedom[number[of]] + FOR_EACH_UNKNOWN * start.shape[1]
        )
        return values

    kept = np.flatnonzero(~lost)
    cost = pixels.costs(number[kept], start[kept])
    unsuited = bad(cost, kept)
    far = kept[unsuited]
    if len(far):
        # what was found around, one by one
        row, column = np.nonzero(there[far])
        tried = around[far][row, column]
        table = np.full(there[far].shape, np.inf)
        table[row, column] = pixels.costs(number[far][row], tried)
        best = np.argmin(table, axis=1)
        lower = table[np.arange(len(far)), best] < cost[unsuited]
        start[far[lower]] = around[far[lower], best[lower]]
        cost = np.minimum(table[np.arange(len(far)), best], cost[unsuited])
        far = far[bad(cost, far)]
    if len(far):
        found = pixels.search(number[far], start[far])
        start[far] = np.where(np.isfinite(found.cost)[:, None], found.u, start[far])
    if len(kept):
        result.put(kept, pixels.near(number[kept], start[kept]))
    return result


def _undo_wrong_ones(
    pixels: Pixels,
    ends: Ends,
    shape: Sequence[int],
    places: np.ndarray,
    freedom: np.ndarray,
    std_known: np.ndarray,
) -> None:
    """Find pixels that ended at a wrong optimum, and fit them again."""
    beside = neighbours(shape, places)

    def deviations() -> np.ndarray:
        return standing_out(ends.cost, freedom, std_known, shape, places)

    _spread(pixels, ends, beside, _offer(pixels, ends, beside, np.flatnonzero(deviations() > OFFERED)))
    tried = np.zeros(len(places), dtype=bool)
    most = max(AT_FIRST, len(places) // ONE_IN)
    limit = max(TRIED_AGAIN, math.sqrt(2.0 * math.log(len(places))))
    while True:
        z = np.where(tried, -np.inf, deviations())
        again = np.argsort(-z, kind="stable")[:most]
        again = np.sort(again[z[again] > limit])
        if not len(again):
            return
        tried[again] = True
        found = pixels.from_many(again, ends)
        better = found.cost < ends.cost[again] * (1.0 - NOTHING_TO_GAIN)
        ends.put(again, found)
        _spread(pixels, ends, beside, again[better])
        if better.sum() * HELPS < len(again):
            return
        most *= MORE


def _spread(pixels: Pixels, ends: Ends, beside: np.ndarray, front: np.ndarray) -> None:
    """Offer the ends of pixels that found a better one to their neighbours, and so on until it helps none."""
    while len(front):
        around = beside[front]
        front = _offer(pixels, ends, beside, np.unique(around[around >= 0]))


def _offer(pixels: Pixels, ends: Ends, beside: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Let pixels follow ends beside them that suit them better than their own; the numbers of those whom it helped."""
    if not len(chosen):
        return chosen
    around = beside[chosen]
    row, column = np.nonzero((around >= 0) & ends.reached[around])
    owner = np.concatenate([chosen, chosen[row]])
    source = np.concatenate([chosen, around[row, column]])
    there = ends.reached[source]
    start = np.clip(ends.u[source], pixels.low[owner], pixels.high[owner])
    cost = np.full(len(owner), np.inf)
    cost[there] = pixels.costs(owner[there], start[there])
    table = np.full(around.shape, np.inf)
    table[row, column] = cost[len(chosen) :]
    best = np.argmin(table, axis=1)
    least = table[np.arange(len(chosen)), best]
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(least < cost[: len(chosen)] * (1.0 - BETTER))
    if not len(wrong):
        return chosen[wrong]
    number = chosen[wrong]
    start = np.clip(ends.u[around[wrong, best[wrong]]], pixels.low[number], pixels.high[number])
    searched = pixels.search(number, start)
    start = np.where(np.isfinite(searched.cost)[:, None], searched.u, start)
    found, old = pixels.near(number, start), ends[number]
    better = found.cost < old.cost * (1.0 - NOTHING_TO_GAIN)
    # the end that was left is an optimum too
    more = old.reached.astype(int)
    ends.put(
        number[better],
        replace(found, optima=np.maximum(old.optima, found.optima + more), starts=old.starts + 1)[better],
    )
    return number[better]


def standing_out(
    cost: np.ndarray, freedom: np.ndarray, std_known: np.ndarray, shape: Sequence[int], places: np.ndarray
) -> np.ndarray:
    """By how many deviations the χ² of each pixel stands above its like, shape (B,): the largest of three.

    Compared is ln of χ² over the degrees of freedom ν with the median of the pixels around, and with that of the block,
    in units of √(2/ν) or of the scatter of the pixels around those medians, where that is larger; and, where
    uncertainties are known, χ²/ν with 1 in units of √(2/ν).
    """
    reduced = _reduced(cost, freedom)
    size = np.log(np.maximum(reduced, 1e-300))
    finite = np.isfinite(size)
    expected = np.sqrt(2.0 / freedom)
    usual = np.median(size[finite]) if finite.any() else 0.0
    around = _medians(np.where(finite, size, np.inf), cells(shape, places, NEIGHBOURHOOD))
    result = np.full(len(cost), -np.inf)
    for above in (size - around, size - usual):
        scatter = 1.4826 * np.median(np.abs(above[finite])) if finite.any() else 0.0
        result = np.maximum(result, above / np.maximum(expected, scatter))
    result = np.maximum(result, np.where(std_known, (reduced - 1.0) / expected, -np.inf))
    return np.where(finite, result, np.inf)


def _reduced(cost: np.ndarray, freedom: np.ndarray) -> np.ndarray:
    values: np.ndarray = 2.0 * cost / freedom
    return values


def _medians(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Median of the values of the group of each, the lower one of two."""
    order = np.lexsort((values, group))
    begin = np.flatnonzero(np.diff(group[order], prepend=-1))
    size = np.diff(np.append(begin, len(order)))
    result = np.empty(len(values))
    result[order] = np.repeat(values[order[begin + (size - 1) // 2]], size)
    return result
