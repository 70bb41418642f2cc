"""Pixels that cannot be trusted, found in dark frames and flat fields."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError

__all__ = ["find_dead_pixels"]

#: Median absolute deviation of normal noise, in standard deviations.
_MAD = 0.6744897501960817

#: Frames of a stack from which its scatter in time tells noisy and stuck pixels.
_STACK = 8


def find_dead_pixels(
    dark: ArrayLike | None = None,
    flat: ArrayLike | None = None,
    *,
    cell: tuple[int, int] = (1, 1),
    threshold: float = 8.0,
    least_difference: float = 0.1,
) -> np.ndarray:
    """Mark hot, noisy, stuck and unresponsive pixels.

    A pixel is compared with the median of its surroundings (5 × 5 pixels of its own class), so that vignetting and
    uneven light do not count. The scale of the differences is their median absolute deviation: the pixels that are
    sought do not widen it.

    Parameters
    ----------
    dark
        Frames without light, shape (rows, columns) or a stack (M, rows, columns). Marks hot pixels; in a stack of 8 or
        more also pixels whose scatter in time is far above the others' (noisy) or 0 where the others' is not (stuck).
    flat
        Frames of even light, the same shapes, brighter than the dark ones and not saturated; without `dark` their black
        level must be 0. Marks pixels that respond too little or too much.
    cell
        Rows and columns of a mosaic's cell: pixels of different polarisers are not compared.
    threshold
        From how many standard deviations a pixel is dead.
    least_difference
        A response is not dead if it differs by less than this share from that of the surroundings, however quiet the
        flat field is.

    Returns
    -------
    ndarray
        bool, shape (rows, columns); True is dead.

    Raises
    ------
    DataError
        If there are no frames, or shapes do not agree.
    """
    if dark is None and flat is None:
        raise DataError("dead pixels are found in dark frames or flat fields: give one or both")
    stacks = {n: _stack(f, n) for n, f in (("dark frames", dark), ("flat fields", flat)) if f is not None}
    shape = next(iter(stacks.values())).shape[1:]
    if any(stack.shape[1:] != shape for stack in stacks.values()):
        raise DataError("dark frames and flat fields must have the same rows and columns")
    level = np.zeros(shape)
    dead = np.zeros(shape, dtype=bool)
    if dark is not None:
        stack = stacks["dark frames"]
        level = stack.mean(axis=0)
        # averages of rounded numbers: the rounding is the least scatter there can be
        dead |= _outliers(level, cell, threshold, np.sqrt(1.0 / 12.0 / len(stack))) > 0
        if len(stack) >= _STACK:
            scatter = stack.std(axis=0)
            dead |= _outliers(scatter, cell, threshold, np.sqrt(1.0 / 24.0 / len(stack))) > 0
            dead |= (scatter == 0.0) & (np.median(scatter) > 0.5)
    if flat is not None:
        stack = _stack(flat, "flat fields")
        bright = stack.mean(axis=0) - level
        if dead.shape not in ((), bright.shape):
            raise DataError(
                f"dark frames are {dead.shape}, flat fields {bright.shape}: they must be of one size"
            )
        around = _surroundings(bright, cell)
        if not (around > 0.0).all():
            raise DataError("the flat field is not brighter than the dark frame in a part of the picture")
        ratio = bright / around
        dead |= (_outliers(ratio, cell, threshold, 1e-6) != 0) & (np.abs(ratio - 1.0) > least_difference)
    return dead


def _stack(frames: ArrayLike, name: str) -> np.ndarray:
    array = np.asarray(frames, dtype=float)
    array = array[None] if array.ndim == 2 else array
    if array.ndim != 3 or 0 in array.shape:
        raise DataError(
            f"{name} have the shape {array.shape}: give (rows, columns) or (frames, rows, columns)"
        )
    return array


def _surroundings(image: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
    """Median of the 5 × 5 pixels of the same class around each pixel."""
    from scipy.ndimage import median_filter

    around = np.empty_like(image)
    for y in range(cell[0]):
        for x in range(cell[1]):
            part = (slice(y, None, cell[0]), slice(x, None, cell[1]))
            around[part] = median_filter(image[part], size=5, mode="nearest")
    return around


def _outliers(image: np.ndarray, cell: tuple[int, int], threshold: float, floor: float) -> np.ndarray:
    """+1 where the image is far above its surroundings, −1 where far below, else 0."""
    difference = image - _surroundings(image, cell)
    size = np.abs(difference)
    # at the border of a steep vignetting the median is not in the middle, for all pixels there: hence the local scale
    scale = np.maximum(_surroundings(size, cell), max(float(np.median(size)), floor * _MAD)) / _MAD
    values: np.ndarray = np.sign(difference) * (size > threshold * scale)
    return values
