"""Pictures as means over square blocks of pixels, which are summed while the frames are read.

Degree and angle of polarisation are those of the mean Stokes vector of a block, so that noise lifts the degree little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.instruments.polarimeter.polarization_errors import polarization
from pbrdf.instruments.reduction.stokes_image import BAD_FLAGS, StokesImage

__all__ = ["BlockSums", "Picture", "PictureSum", "block_sums"]

#: Blocks along the longer side of a picture, at most.
_BLOCKS = 640
#: Rows of blocks that are worked on at a time.
_ROWS = 64


@dataclass(frozen=True, eq=False)
class BlockSums:
    """Sums over the pixels of blocks, of some rows of a picture.

    Attributes
    ----------
    first
        Number of the first row of blocks.
    sums
        Shape (3 + 6 + 1 + 3, block rows, block columns): I, Q, U; the six elements of their covariance; numbers of
        good, saturated, dead and dark pixels.
    """

    first: int
    sums: np.ndarray


_PAIRS = tuple((i, j) for i in range(3) for j in range(i, 3))


def block_size(rows: int, columns: int) -> int:
    """Side of the blocks, pixels, for a picture of this size."""
    return max(math.ceil(max(rows, columns) / _BLOCKS), 1)


def block_sums(image: StokesImage, first_row: int, size: int) -> BlockSums:
    """Sum some rows of a reduced picture over blocks of `size` × `size` pixels."""
    good = image.flags == 0
    layers = [*image.stokes[:3], *(image.covariance[i, j] for i, j in _PAIRS)]
    stack = np.stack(
        [np.where(good, layer, 0.0) for layer in layers]
        + [good.astype(float)]
        + [(image.flags & flag != 0).astype(float) for flag in BAD_FLAGS]
    )
    rows, columns = good.shape
    # edges of the blocks among these rows: the first block may have begun above
    down = np.unique(np.maximum(np.arange(first_row // size * size, first_row + rows, size) - first_row, 0))
    across = np.arange(0, columns, size)
    return BlockSums(first_row // size, np.add.reduceat(np.add.reduceat(stack, across, axis=2), down, axis=1))


class PictureSum:
    """Sums of a whole picture, to which rows are added in any order.

    Attributes
    ----------
    size
        Pixels along the side of a block.
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.size = block_size(rows, columns)
        self._shape = (rows, columns)
        self._sums = np.zeros((13, math.ceil(rows / self.size), math.ceil(columns / self.size)), np.float32)

    def add(self, part: BlockSums) -> None:
        """Add what :func:`block_sums` made of some rows, with the same size of blocks."""
        self._sums[:, part.first : part.first + part.sums.shape[1]] += part.sums

    def picture(self, coarser: int = 1) -> Picture:
        """The means over blocks, or over squares of several blocks."""
        down, across = (np.arange(0, count, coarser) for count in self._sums.shape[1:])
        layers: list[list[np.ndarray]] = []
        # some rows at a time: the errors of the angles take many times the place of the sums
        for first in range(0, len(down), _ROWS):
            low = down[first]
            high = down[first + _ROWS] if first + _ROWS < len(down) else self._sums.shape[1]
            part = np.add.reduceat(self._sums[:, low:high].astype(float), across, axis=2)
            layers.append(_means(np.add.reduceat(part, down[first : first + _ROWS] - low, axis=1)))
        intensity, dolp, aolp, aolp_std, mask = (np.concatenate(rows) for rows in zip(*layers, strict=True))
        return Picture(intensity, dolp, aolp, aolp_std, mask, self._shape, self.size * coarser)


def _means(sums: np.ndarray) -> list[np.ndarray]:
    """Intensity, DoLP, AoLP, its standard error, and mask, from the sums over some blocks."""
    values, (good, *masked) = sums[:9], sums[9:]
    some = np.where(good > 0.0, good, np.nan)
    stokes = np.full((4, *good.shape), np.nan)
    stokes[:3] = values[:3] / some
    covariance = np.full((4, 4, *good.shape), np.nan)
    for k, (i, j) in enumerate(_PAIRS):
        covariance[i, j] = covariance[j, i] = values[3 + k] / some**2
    found = polarization(stokes, covariance)
    kinds = np.stack([np.zeros_like(good), *masked])
    # a block shows a mask where fewer than half of its pixels are good
    mask = np.where(good * 2.0 < good + kinds.max(axis=0), kinds.argmax(axis=0), 0)
    shown = (stokes[0], found.dolp, np.rad2deg(found.aolp), np.rad2deg(found.aolp_std))
    return [*(values.astype(np.float32) for values in shown), mask.astype(np.uint8)]


@dataclass(frozen=True, eq=False)
class Picture:
    """What a quick look shows, arrays of one shape.

    Attributes
    ----------
    intensity, dolp, aolp, aolp_std
        Digital numbers, a ratio, degrees.
    mask
        0, or 1, 2, 3 where most pixels are saturated, dead, dark: the order of BAD_FLAGS.
    shape
        Rows and columns of the whole picture.
    size
        Pixels along the side of a block.
    """

    intensity: np.ndarray
    dolp: np.ndarray
    aolp: np.ndarray
    aolp_std: np.ndarray
    mask: np.ndarray
    shape: tuple[int, int]
    size: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top edge in pixels, row 0 at the top."""
        rows, columns = self.mask.shape
        return 0.0, columns * self.size, rows * self.size, 0.0
