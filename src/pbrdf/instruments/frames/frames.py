"""Raw frames of a measurement: for each series (a geometry, an exposure) one picture for each state of the polarimeter.

Whatever the files are, the reduction sees them as :class:`Frames`, which it reads by blocks of rows: a measurement
larger than memory is never held as a whole. Row 0 is the top row of the picture, column 0 the left one.

Some frames have more to say than the others, and those that have not need no attribute for it: how many pictures there
are for each state (:func:`layers_of`), by how much the files' numbers were shifted (:func:`shift_of`), which pixels of
a colour mosaic a series is made of (:func:`color_cells_of`), and what should be told about them (:func:`notes_of`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pbrdf.errors import DataError

__all__ = [
    "ArrayFrames",
    "ChosenSeries",
    "ColorCells",
    "Frames",
    "color_cells_of",
    "color_sources_of",
    "layers_of",
    "named",
    "notes_of",
    "require_raw",
    "shift_of",
]


class Frames(Protocol):
    """Frames of M series with N states each.

    Attributes
    ----------
    names
        Of the series.
    states
        N.
    rows, columns
        Size of the pictures; for a mosaic in its cells, which are the pixels of what is computed from them.
    """

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def states(self) -> int: ...

    @property
    def rows(self) -> int: ...

    @property
    def columns(self) -> int: ...

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        """Raw digital numbers of some rows of a series, shape (N, last_row − first_row, columns).

        Whole numbers, or means of exposures with decimals; shape (K, N, …) where each state was taken K times. Of a
        colour mosaic the rows and columns are those of :attr:`ColorCells.size` for each of ours.
        """
        ...


@dataclass(frozen=True)
class ColorCells:
    """Which polarisation cells of a colour mosaic have a colour.

    Attributes
    ----------
    size
        Rows and columns of cells over which the colours repeat.
    places
        Row and column of each cell of the colour; more than one are averaged.
    """

    size: tuple[int, int] = (1, 1)
    places: tuple[tuple[int, int], ...] = ((0, 0),)

    def parts(self, array: np.ndarray) -> list[np.ndarray]:
        """What belongs to each of the places of an array (..., rows, columns)."""
        return [array[..., y :: self.size[0], x :: self.size[1]] for y, x in self.places]


@dataclass(frozen=True, eq=False)
class ArrayFrames:
    """Frames in an array, in memory or memory-mapped.

    Attributes
    ----------
    array
        Raw digital numbers of the converter, whole or means of exposures with decimals, shape (M, N, rows, columns).
        Numbers in the upper end of 16 bits are made such by
        :class:`~pbrdf.instruments.frames.digital_numbers.ConvertedFrames` around these frames.
    names
        Of the M series; "1", "2", … by default.

    Raises
    ------
    DataError
        If the array has another type or shape, or the names do not fit.
    """

    array: np.ndarray
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_raw(self.array.dtype, "the array of frames", means=True)
        if self.array.ndim != 4 or 0 in self.array.shape:
            raise DataError(
                f"the array of frames has the shape {self.array.shape}: give (series, states, rows, columns)"
            )
        names = tuple(str(name) for name in self.names) or tuple(str(i + 1) for i in range(len(self.array)))
        if len(names) != len(self.array) or len(set(names)) != len(names):
            raise DataError(f"{len(self.array)} series of frames need as many names, each another")
        object.__setattr__(self, "names", names)

    @property
    def states(self) -> int:
        return int(self.array.shape[1])

    @property
    def rows(self) -> int:
        return int(self.array.shape[2])

    @property
    def columns(self) -> int:
        return int(self.array.shape[3])

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        return np.asarray(self.array[series, :, first_row:last_row])


class ChosenSeries:
    """Some series of other frames, in the order of the names.

    Parameters
    ----------
    frames
        All of them.
    names
        Those wanted.

    Raises
    ------
    DataError
        If there is no series of a name, or a name comes twice.
    """

    def __init__(self, frames: Frames, names: Sequence[str]) -> None:
        missing = [name for name in names if name not in frames.names]
        if missing:
            raise DataError(f"there is no series {named(missing)}; there are {named(frames.names, 10)}")
        if not names or len(set(names)) != len(names):
            raise DataError(f"series {named(names)}: give one or more, each once")
        self._frames = frames
        self._index = [frames.names.index(name) for name in names]
        self.names = tuple(names)
        self.states, self.rows, self.columns = frames.states, frames.rows, frames.columns
        self.layers, self.shift = layers_of(frames), shift_of(frames)
        self.sources = tuple(color_sources_of(frames)[k] for k in self._index if color_sources_of(frames))

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        return self._frames.read(self._index[series], first_row, last_row)

    def color_cells(self, series: int) -> ColorCells:
        """As of the other frames."""
        return color_cells_of(self._frames, self._index[series])

    @property
    def notes(self) -> list[str]:
        """As of the other frames."""
        return notes_of(self._frames)


def layers_of(frames: Frames) -> int:
    """Numbers that :meth:`Frames.read` gives for each state and pixel, at most."""
    return int(getattr(frames, "layers", 1))


def shift_of(frames: Frames) -> int:
    """By how many bits the numbers of the files were shifted down."""
    return int(getattr(frames, "shift", 0))


def color_cells_of(frames: Frames, series: int) -> ColorCells:
    """Which cells of a colour mosaic the series is made of; all of any other camera."""
    own = getattr(frames, "color_cells", None)
    return ColorCells() if own is None else own(series)


def color_sources_of(frames: Frames) -> tuple[tuple[str, str, float | None], ...]:
    """For each series the picture, the colour and its wavelength (nm); empty where there are no colours."""
    return tuple(getattr(frames, "sources", ()))


def notes_of(frames: Frames) -> list[str]:
    """What a user should know of the frames read so far, one sentence each."""
    return list(getattr(frames, "notes", ()))


def require_raw(dtype: np.dtype[Any], what: str, *, means: bool = False) -> None:
    """Check that numbers can be those of a camera's converter.

    Parameters
    ----------
    dtype
        Their type: whole numbers.
    what
        Holds them, for the message.
    means
        Take floating point too, for means of exposures.

    Raises
    ------
    DataError
        If they cannot.
    """
    if dtype.kind not in ("uif" if means else "ui"):
        also = ", or means of exposures with decimals" if means else ""
        raise DataError(
            f"{what} holds numbers of the type {dtype}: give raw frames, whole numbers of 8 or 16 bits{also}"
        )


def named(names: Sequence[str], most: int = 5) -> str:
    """Some names for a message: 'a', 'b' and 3 more."""
    shown = ", ".join(map(repr, names[:most]))
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
