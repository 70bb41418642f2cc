"""Which pixels are fitted when, and which fitted ones they start from: a coarse grid first, then ever finer ones.

Pixels are given by their places, integers along any number of dimensions; those that are not to be fitted have none. A
cell of a grid is represented by the pixel nearest to its middle, so an irregular region has its coarse pixels too.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["Level", "cells", "levels", "neighbours"]

#: Pixels of the coarse grid, at most: this many, or one in so many if those are more.
COARSE, ONE_IN = 16, 4096
#: Each grid is so many times as fine as the one before.
FINER = 4


@dataclass(frozen=True)
class Level:
    """Pixels that are fitted together.

    Attributes
    ----------
    pixels
        Their numbers, shape (n,).
    parents
        Numbers of fitted pixels around each, shape (n, K), −1 for none; K is 0 in the first level.
    weights
        By which to interpolate between them, shape (n, K), 0 where there is none.
    """

    pixels: np.ndarray
    parents: np.ndarray
    weights: np.ndarray


def levels(shape: Sequence[int], places: np.ndarray) -> list[Level]:
    """The levels, the coarse one first; every pixel is in one of them.

    Parameters
    ----------
    shape
        Of the image.
    places
        Place of each pixel that is to be fitted, shape (B, N).
    """
    most = max(COARSE, len(places) // ONE_IN)
    step = 1
    while np.prod([-(-n // step) for n in shape]) > most:
        step += 1 if step < 2 * FINER else step // FINER
    first = _chosen(shape, places, step)
    result = [Level(first, np.empty((len(first), 0), dtype=int), np.empty((len(first), 0)))]
    fitted = np.zeros(len(places), dtype=bool)
    fitted[first] = True
    while step > 1:
        grid = _representatives(shape, places, step).reshape([-(-n // step) for n in shape])
        finer = step // FINER if step > 2 * FINER else 1
        pixels = _chosen(shape, places, finer)
        pixels = pixels[~fitted[pixels]]
        result.append(Level(pixels, *_around(grid, places[pixels], step)))
        fitted[pixels] = True
        step = finer
    return result


def cells(shape: Sequence[int], places: np.ndarray, step: int) -> np.ndarray:
    """Number of the cell of each place, cells being ``step`` pixels wide."""
    values: np.ndarray = np.ravel_multi_index(tuple((places // step).T), [-(-n // step) for n in shape])
    return values


def neighbours(shape: Sequence[int], places: np.ndarray) -> np.ndarray:
    """Numbers of the pixels beside each, shape (B, 2 N), −1 for none."""
    number = np.full([n + 2 for n in shape], -1)
    inner = places + 1
    number[tuple(inner.T)] = np.arange(len(places))
    steps = [sign * row for row in np.eye(len(shape), dtype=int) for sign in (-1, 1)]
    return np.stack([number[tuple((inner + step).T)] for step in steps], axis=1)


def _chosen(shape: Sequence[int], places: np.ndarray, step: int) -> np.ndarray:
    """Numbers of the representatives of all cells, ascending."""
    if step == 1:
        return np.arange(len(places))
    found = np.sort(_representatives(shape, places, step))
    return found[found >= 0]


def _representatives(shape: Sequence[int], places: np.ndarray, step: int) -> np.ndarray:
    """Number of the pixel nearest to the middle of each cell, −1 for an empty one; flat."""
    found = np.full(int(np.prod([-(-n // step) for n in shape])), -1)
    cell = cells(shape, places, step)
    distance = ((places - ((places // step) * step + 0.5 * (step - 1))) ** 2).sum(axis=1)
    order = np.lexsort((distance, cell))
    ordered = cell[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    found[ordered[first]] = order[first]
    return found


def _around(grid: np.ndarray, places: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Representatives of the cells whose middles surround each place, and multilinear weights."""
    position = (places - 0.5 * (step - 1)) / step
    low = np.floor(position).astype(int)
    part = position - low
    parents, weights = [], []
    for corner in itertools.product((0, 1), repeat=places.shape[1]):
        cell = low + np.array(corner)
        inside = ((cell >= 0) & (cell < grid.shape)).all(axis=1)
        number = grid[tuple(np.clip(cell, 0, np.array(grid.shape) - 1).T)]
        number = np.where(inside, number, -1)
        weight = np.where(corner, part, 1.0 - part).prod(axis=1)
        parents.append(number)
        # the own cell counts even where the place is at its very edge
        weights.append(np.where(number >= 0, np.maximum(weight, 1e-6), 0.0))
    return np.stack(parents, axis=1), np.stack(weights, axis=1)
