"""Pictures of a division of focal plane: a mosaic of the states, taken apart into frames and put together again.

A cell of the mosaic is one pixel of what is computed from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import Frames, layers_of, notes_of, shift_of
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["MosaicFrames", "split_mosaic", "weave_mosaic"]


@dataclass(frozen=True, eq=False)
class MosaicFrames:
    """Pictures of a division of focal plane, seen as frames with one state for each pixel of the mosaic's cell.

    Attributes
    ----------
    pictures
        The raw pictures as frames with one state.
    polarimeter
        Says which state stands where.

    Raises
    ------
    DataError
        If there is no mosaic or the pictures are not made of whole cells.
    """

    pictures: Frames
    polarimeter: Polarimeter

    def __post_init__(self) -> None:
        mosaic = self.polarimeter.mosaic
        if mosaic is None:
            raise DataError(f"{self.polarimeter.name} has no mosaic")
        if self.pictures.rows % mosaic.shape[0] or self.pictures.columns % mosaic.shape[1]:
            raise DataError(
                f"a picture of {self.pictures.rows} × {self.pictures.columns} pixels is not made of whole "
                f"{mosaic.shape[0]} × {mosaic.shape[1]} cells"
            )

    @property
    def _cell(self) -> tuple[int, int]:
        assert self.polarimeter.mosaic is not None
        tall, wide = self.polarimeter.mosaic.shape
        return tall, wide

    @property
    def names(self) -> tuple[str, ...]:
        return self.pictures.names

    @property
    def states(self) -> int:
        return self.polarimeter.size

    @property
    def rows(self) -> int:
        return self.pictures.rows // self._cell[0]

    @property
    def columns(self) -> int:
        return self.pictures.columns // self._cell[1]

    @property
    def layers(self) -> int:
        """As of the pictures."""
        return layers_of(self.pictures)

    @property
    def shift(self) -> int:
        """As of the pictures."""
        return shift_of(self.pictures)

    @property
    def notes(self) -> list[str]:
        """As of the pictures."""
        return notes_of(self.pictures)

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        tall = self._cell[0]
        pictures = self.pictures.read(series, first_row * tall, last_row * tall)
        return split_mosaic(pictures[..., 0, :, :], self.polarimeter)


def split_mosaic(picture: ArrayLike, polarimeter: Polarimeter) -> np.ndarray:
    """Intensities of a division of focal plane, one for each state in each cell of the mosaic.

    Parameters
    ----------
    picture
        Raw, shape (..., rows, columns), both a multiple of the cell's.

    Returns
    -------
    ndarray
        Shape (..., N, rows/cell rows, columns/cell columns). Cells are not interpolated: each keeps its own noise.

    Raises
    ------
    DataError
        If the polarimeter has no mosaic or the picture is not made of whole cells.
    """
    picture = np.asarray(picture)
    if polarimeter.mosaic is None:
        raise DataError(f"{polarimeter.name} has no mosaic")
    tall, wide = polarimeter.mosaic.shape
    if picture.ndim < 2 or picture.shape[-2] % tall or picture.shape[-1] % wide:
        raise DataError(
            f"a picture of {' × '.join(map(str, picture.shape[-2:]))} pixels is not made of whole {tall} × {wide} cells"
        )
    places = [np.argwhere(polarimeter.mosaic == state)[0] for state in range(polarimeter.size)]
    return np.stack([picture[..., y::tall, x::wide] for y, x in places], axis=-3)


def weave_mosaic(frames: np.ndarray, polarimeter: Polarimeter) -> np.ndarray:
    """The picture that :func:`split_mosaic` takes apart into these frames.

    Parameters
    ----------
    frames
        Shape (..., N, rows, columns), one frame a state.

    Returns
    -------
    ndarray
        Shape (..., cell rows·rows, cell columns·columns), of the same type.

    Raises
    ------
    DataError
        If the polarimeter has no mosaic.
    """
    if polarimeter.mosaic is None:
        raise DataError(f"{polarimeter.name} has no mosaic")
    tall, wide = polarimeter.mosaic.shape
    rows, columns = frames.shape[-2:]
    picture = np.empty((*frames.shape[:-3], tall * rows, wide * columns), dtype=frames.dtype)
    for (y, x), state in np.ndenumerate(polarimeter.mosaic):
        picture[..., y::tall, x::wide] = frames[..., state, :, :]
    return picture
