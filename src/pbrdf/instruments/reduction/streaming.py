"""The reduction of a measurement block by block, within a bound on memory."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import Frames, color_cells_of, layers_of
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.corrections import Corrections, reduce_rows
from pbrdf.instruments.reduction.stokes_image import StokesImage

__all__ = ["DEFAULT_MEMORY", "Block", "reduced_blocks"]

#: Bytes for frames and what is computed from them, where nothing else is said.
DEFAULT_MEMORY = 500_000_000
#: Pixels of a block: more at a time leave the processor's cache; with fewer, more threads do not help.
_PIXELS, _FEW_PIXELS = 2**16, 2**14
#: Bytes that a pixel takes while it is reduced (a part for each state, and one besides), and when it is done.
_BYTES_PER_STATE, _BYTES_PER_PIXEL, _BYTES_DONE = 30, 1150, 290
#: More threads than this compete for the memory.
_MOST_THREADS = 8

T = TypeVar("T")


@dataclass(frozen=True)
class Block:
    """Some rows of one series, reduced.

    Attributes
    ----------
    series
        Its number, from 0.
    first_row, last_row
        Of the picture; the last is not included.
    image
        Stokes parameters, covariance and flags of the rows.
    """

    series: int
    first_row: int
    last_row: int
    image: StokesImage


def reduced_blocks(
    frames: Frames,
    instrument: Instrument,
    finish: Callable[[Block], T],
    *,
    rows: tuple[int, int] | None = None,
    dark_level: float = 0.0,
    weighted: bool = True,
    max_memory: int = DEFAULT_MEMORY,
    progress: Callable[[int, int], None] | None = None,
) -> Generator[T]:
    """Reduce all series, one block of rows after another, in several threads.

    Parameters
    ----------
    frames, instrument
        What was measured, and with what. Dark frame, flat field and dead pixels are those that the instrument's table
        ``[frames]`` names.
    finish
        What to make of each block; it runs in the threads.
    rows
        First and last row (not included) to be reduced; all by default.
    dark_level, weighted
        See :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames`.
    max_memory
        Bytes for the frames and what is computed from them. Dark frame, flat field, dead pixels, and a picture that can
        only be decoded whole come on top.
    progress
        Called with the number of finished rows and of all.

    Yields
    ------
    object
        What `finish` returned, in the order of series and rows.

    Raises
    ------
    DataError
        If the frames do not fit the instrument, or it does not determine the intensity; names the series.
    """
    if frames.states != instrument.polarimeter.size:
        raise DataError(
            f"{frames.states} frames a series for the {instrument.polarimeter.size} states of "
            f"{instrument.polarimeter.name}"
        )
    instrument.require_stokes()
    instrument.polarimeter.require_intensity()
    corrections = Corrections.of(instrument, frames)
    top, bottom = rows if rows is not None else (0, frames.rows)
    threads, high = _shares(frames, max_memory)
    # An eighth of the memory for raw frames, of which two parts may be there at a time. Many rows are read at once, as
    # some pictures must be decoded whole for every reading.
    pictures = frames.states * layers_of(frames)
    slab = max(max_memory // (8 * 2 * pictures * frames.columns) // high, 1) * high

    def work(raw: np.ndarray, series: int, first: int, last: int) -> T:
        try:
            image = reduce_rows(
                raw,
                instrument,
                corrections,
                (first, last, frames.rows),
                cells=color_cells_of(frames, series),
                dark_level=dark_level,
                weighted=weighted,
            )
        except DataError as error:
            raise DataError(f"series {frames.names[series]!r}: {error}") from None
        return finish(Block(series, first, last, image))

    def pieces() -> Iterator[tuple[np.ndarray, int, int, int]]:
        for series in range(len(frames.names)):
            for first in range(top, bottom, slab):
                last = min(first + slab, bottom)
                raw = frames.read(series, first, last)
                tall = raw.shape[-2] // (last - first)
                for row in range(first, last, high):
                    end = min(row + high, last)
                    yield raw[..., (row - first) * tall : (end - first) * tall, :], series, row, end

    total = (bottom - top) * len(frames.names)
    finished = 0
    waiting: deque[tuple[Future[T], int]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for raw, series, first, last in pieces():
                waiting.append((pool.submit(work, raw, series, first, last), last - first))
                if len(waiting) > threads:
                    future, count = waiting.popleft()
                    yield future.result()
                    finished += count
                    if progress is not None:
                        progress(finished, total)
            for future, count in waiting:
                yield future.result()
                finished += count
                if progress is not None:
                    progress(finished, total)
        finally:
            for future, _ in waiting:
                future.cancel()


def _shares(frames: Frames, max_memory: int) -> tuple[int, int]:
    """Number of threads, and rows of a block, for so much memory."""
    threads = min(os.cpu_count() or 1, _MOST_THREADS)
    while True:
        # a third of the memory: a block in each thread, as many that wait, and one that is being used
        states = frames.states * layers_of(frames)
        pixel = threads * (_BYTES_PER_PIXEL + _BYTES_PER_STATE * states) + (threads + 1) * _BYTES_DONE
        fits = max_memory // (3 * pixel)
        if fits >= _FEW_PIXELS or threads == 1:
            return threads, max(min(fits, _PIXELS) // frames.columns, 1)
        threads //= 2
