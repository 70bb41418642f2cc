"""Raw frames of a measurement: for each series (a geometry, an exposure) one picture for each state of the polarimeter.

Whatever the files are, the reduction sees them as :class:`Frames`, which it reads by blocks of rows: a measurement
larger than memory is never held as a whole. Row 0 is the top row of the picture, column 0 the left one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pbrdf.errors import DataError

__all__ = ["ArrayFrames", "ChosenSeries", "Frames", "named", "require_raw"]


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
        """Raw digital numbers of some rows of a series, uint8 or uint16, shape (N, last_row − first_row, columns)."""
        ...


@dataclass(frozen=True, eq=False)
class ArrayFrames:
    """Frames in an array, in memory or memory-mapped.

    Attributes
    ----------
    array
        Raw digital numbers, uint8 or uint16, shape (M, N, rows, columns).
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
        require_raw(self.array.dtype, "the array of frames")
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

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        return self._frames.read(self._index[series], first_row, last_row)


def require_raw(dtype: np.dtype[Any], what: str) -> None:
    """Check that numbers are those of a camera's converter, uint8 or uint16; raises DataError, which names `what`."""
    if dtype.kind != "u" or dtype.itemsize > 2:
        raise DataError(f"{what} holds numbers of the type {dtype}: give raw frames, uint8 or uint16")


def named(names: Sequence[str], most: int = 5) -> str:
    """Some names for a message: 'a', 'b' and 3 more."""
    shown = ", ".join(map(repr, names[:most]))
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
