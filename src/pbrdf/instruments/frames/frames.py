"""Raw frames of a measurement: for each series (a geometry, an exposure) one picture for each state of the polarimeter.

Whatever the files are, the reduction sees them as :class:`Frames`, which it reads by blocks of rows: a measurement
larger than memory is never held as a whole. Row 0 is the top row of the picture, column 0 the left one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.instruments.reduction.stokes_image import split_mosaic

__all__ = ["ArrayFrames", "ChosenSeries", "FrameLayout", "Frames", "MosaicFrames", "named", "require_raw"]


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

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        tall = self._cell[0]
        return split_mosaic(
            self.pictures.read(series, first_row * tall, last_row * tall)[0], self.polarimeter
        )


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


@dataclass(frozen=True)
class FrameLayout:
    """The table ``[frames]`` of an instrument's file.

    Attributes
    ----------
    pattern
        How the files of a folder are called, with ``{series}`` and ``{state}`` for the names; with a slash for folders
        in the folder, ``{series}/{state}``; None: what :func:`pbrdf.instruments.frames.frame_files.open_frames` finds.
    dark_frame
        Picture taken with the light shut out, the same for all states.
    flat_field
        Picture of an even field of natural light.
    dead_pixels
        Picture that is not 0 where a pixel must not be used.
    dark_exposures, flat_exposures
        How many exposures the dark frame and the flat field are the mean of: their noise is that much less.
    flat_transmittance
        Of a mosaic's states for the light of the flat field, in any unit; None for what the polarimeter says of natural
        light. A calibration made with the flat field holds for that of the nominal polarimeter, and writes it here.
    """

    pattern: str | None = None
    dark_frame: Path | None = None
    flat_field: Path | None = None
    dead_pixels: Path | None = None
    dark_exposures: int = 1
    flat_exposures: int = 1
    flat_transmittance: tuple[float, ...] | None = None

    @classmethod
    def from_table(cls, table: dict[str, Any], folder: Path | None = None) -> FrameLayout:
        """Check the table; names of files are relative to `folder`.

        Raises
        ------
        DataError
            If a key is not known or a value is not what it should be.
        """
        known = tuple(cls.__dataclass_fields__)
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in known:
                raise DataError(f"[frames] {key}: there is no such key; use {', '.join(known)}")
            if key.endswith("_exposures"):
                if not (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
                    raise DataError(f"[frames] {key} is {value!r}: give a whole number from 1")
                values[key] = value
            elif key == "flat_transmittance":
                numbers = isinstance(value, list) and all(type(v) in (int, float) and v > 0.0 for v in value)
                if not numbers:
                    raise DataError(f"[frames] {key} is {value!r}: give a list of numbers more than 0")
                values[key] = tuple(map(float, value))
            elif not isinstance(value, str) or not value:
                raise DataError(f"[frames] {key} is {value!r}: give a text in quotes")
            else:
                values[key] = value if key == "pattern" else (folder or Path()) / value
        return cls(**values)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are not frames themselves."""
        return tuple(f for f in (self.dark_frame, self.flat_field, self.dead_pixels) if f is not None)


def require_raw(dtype: np.dtype[Any], what: str) -> None:
    """Check that numbers are those of a camera's converter, uint8 or uint16; raises DataError, which names `what`."""
    if dtype.kind != "u" or dtype.itemsize > 2:
        raise DataError(f"{what} holds numbers of the type {dtype}: give raw frames, uint8 or uint16")


def named(names: Sequence[str], most: int = 5) -> str:
    """Some names for a message: 'a', 'b' and 3 more."""
    shown = ", ".join(map(repr, names[:most]))
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
