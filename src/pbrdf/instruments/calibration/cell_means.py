"""What an instrument reads at known inputs: means over cells of its field of view, bad pixels left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.frames.digital_numbers import require_range
from pbrdf.instruments.frames.exposures import Reading, combine, single
from pbrdf.instruments.frames.frames import Frames, color_cells_of
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.corrections import Corrections
from pbrdf.instruments.reduction.regions import Region, require_inside
from pbrdf.instruments.reduction.stokes_image import PixelFlag, count_flags, flag_pixels

__all__ = ["CellMeans", "cell_means", "cell_means_of_frames"]


@dataclass(frozen=True, eq=False)
class CellMeans:
    """What the instrument read at K known inputs, on the mean over cells of its field of view.

    Attributes
    ----------
    intensities
        Signal above black level, shape (N, K), or (N, K, rows, columns) of the cells of a map; NaN in a cell without a
        good pixel.
    variance
        Of the intensities, the same shape.
    pixels
        How many good pixels are behind each number, shape () or (rows, columns).
    flags
        :class:`~pbrdf.instruments.reduction.stokes_image.PixelFlag` of the pixels, of all inputs together, uint8. A
        pixel that is bad at one input is left out at all of them: every input is averaged over the same pixels.
    used
        Which pixels were to be used at all, bool, shape of `flags`; the others are flagged as dead.
    """

    intensities: np.ndarray
    variance: np.ndarray
    pixels: np.ndarray
    flags: np.ndarray
    used: np.ndarray

    def counts(self) -> dict[str, int]:
        """How many of the pixels to be used are good, and how many carry each flag."""
        return count_flags(self.flags[self.used])


def cell_means(
    frames: ArrayLike,
    detector: Detector,
    *,
    cells: tuple[int, int] | None = (1, 1),
    dead: ArrayLike | None = None,
    dark_level: float = 0.0,
    black: ArrayLike | None = None,
    flat: ArrayLike | None = None,
) -> CellMeans:
    """Mean intensities of calibration frames over cells of the field of view, bad pixels left out.

    Parameters
    ----------
    frames
        Raw digital numbers, shape (N, K, rows, columns): N states at K inputs.
    detector
        What took them.
    cells
        Rows and columns of cells that the field is divided into, as :meth:`Polarimeter.spread` divides it; (1, 1) is
        one for all, None one for each pixel.
    dead, dark_level, black, flat
        See :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames`; (rows, columns), or (N, rows, columns).

    Raises
    ------
    DataError
        If shapes do not fit, or no pixel is good.
    """
    frames = np.asarray(frames)
    if frames.ndim != 4 or 0 in frames.shape:
        raise DataError(
            f"calibration frames have the shape {frames.shape}: give (states, inputs, rows, columns)"
        )
    return _one_by_one(
        lambda k: single(frames[:, k], detector),
        np.ones(frames.shape[1], dtype=bool),
        detector,
        cells=cells,
        dead=dead,
        dark_level=dark_level,
        black=black,
        flat=flat,
    )


def cell_means_of_frames(
    frames: Frames,
    instrument: Instrument,
    lit: np.ndarray,
    *,
    cells: tuple[int, int] | None = (1, 1),
    regions: Sequence[Region] = (),
    dark_level: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> CellMeans:
    """As :func:`cell_means` for frames not all in memory, corrected as the instrument's table ``[frames]`` says.

    Parameters
    ----------
    frames, instrument
        What was read, and with what.
    lit
        Which of the series are light, not darkness, shape (K,).
    cells
        See :func:`cell_means`.
    regions
        Parts of the picture that were lit evenly; all of it by default.
    dark_level
        See :func:`pbrdf.instruments.reduction.stokes_image.flag_pixels`.
    progress
        Called with the number of finished readings and of all.

    Raises
    ------
    DataError
        If frames, instrument and regions do not fit each other, or no pixel is good.
    """
    instrument.require_stokes()
    size = instrument.polarimeter.size
    if frames.states != size:
        raise DataError(
            f"{frames.states} frames a series for the {size} states of {instrument.polarimeter.name}"
        )
    require_inside({f"{k + 1}": region for k, region in enumerate(regions)}, frames.rows, frames.columns)
    used = None
    if regions:
        used = np.any([region.mask(0, frames.rows, frames.columns) for region in regions], axis=0)
    color = color_cells_of(frames, 0)
    corrections = Corrections.of(instrument, frames)
    pixels = corrections.pixels(instrument, slice(0, frames.rows * color.size[0])).part(color)

    def read(k: int) -> Reading:
        raw = color.parts(frames.read(k, 0, frames.rows))[0]
        try:
            require_range(raw, instrument.detector)
        except DataError as error:
            raise DataError(f"series {frames.names[k]!r}: {error}") from None
        return combine(raw, instrument.detector, corrections.layout.exposures or 1)

    return _one_by_one(
        read,
        lit,
        instrument.detector,
        cells=cells,
        dead=pixels.dead,
        dark_level=dark_level,
        black=pixels.black,
        flat=pixels.flat,
        used=used,
        progress=progress,
    )


def _one_by_one(
    read: Callable[[int], Reading],
    lit: np.ndarray,
    detector: Detector,
    *,
    cells: tuple[int, int] | None,
    dead: ArrayLike | None,
    dark_level: float,
    black: ArrayLike | None,
    flat: ArrayLike | None,
    used: np.ndarray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> CellMeans:
    """The means from what `read` gives by the number of the input, shape (N, rows, columns); each is read twice.

    At inputs that are not lit no pixel counts as dark; pixels that are not `used` are left out.
    """
    inputs = len(lit)
    first = read(0)
    shape = states, rows, columns = first.numbers.shape
    tall, wide = (rows, columns) if cells is None else cells
    if not (1 <= tall <= rows and 1 <= wide <= columns):
        raise DataError(f"pictures of {rows} × {columns} pixels cannot be divided into {tall} × {wide} cells")
    level = np.asarray(detector.black if black is None else black, dtype=float)
    response = np.asarray(1.0 if flat is None else flat, dtype=float)
    for name, array in (("the black level", level), ("the flat field", response)):
        if array.shape not in ((), (rows, columns), shape):
            raise DataError(f"{name} has the shape {array.shape}, the frames are {rows} × {columns} pixels")
    wanted = np.ones((rows, columns), dtype=bool) if used is None else used
    flags = np.where(wanted, np.uint8(0), np.uint8(PixelFlag.DEAD))
    for k in range(inputs):
        reading = first if k == 0 else read(k)
        found = flag_pixels(
            reading.numbers,
            detector,
            dead=dead,
            dark_level=dark_level,
            black=black,
            saturated=reading.saturated,
        )
        flags |= found if lit[k] else found & ~np.uint8(PixelFlag.DARK)
        if progress is not None:
            progress(k + 1, 2 * inputs)
    good = flags == 0
    if not good.any():
        raise DataError("no pixel of the calibration frames is good: all are saturated, dead or dark")
    response = np.broadcast_to(response, shape)
    if not (response[:, good] > 0.0).all():
        raise DataError("the flat field is not positive at a pixel that is used: mark it as dead")
    level = np.broadcast_to(level, shape)
    starts = [-(-np.arange(count) * size // count) for count, size in ((tall, rows), (wide, columns))]

    def total(image: np.ndarray) -> np.ndarray:
        return np.add.reduceat(np.add.reduceat(image, starts[0], axis=0), starts[1], axis=1)

    pixels = total(good.astype(int))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(pixels > 0, 1.0 / pixels, np.nan)
    intensities = np.empty((states, inputs, tall, wide))
    variance = np.empty_like(intensities)
    for k in range(inputs):
        reading = read(k)
        spread = reading.variance(detector)
        for j in range(states):
            frame = np.where(good, reading.numbers[j], level[j])
            divisor = np.where(good, response[j], 1.0)
            intensities[j, k] = total((frame - level[j]) / divisor * good) * share
            variance[j, k] = total(np.where(good, spread[j], 0.0) / divisor**2) * share**2
        if progress is not None:
            progress(inputs + k + 1, 2 * inputs)
    if cells == (1, 1):
        intensities, variance, pixels = intensities[..., 0, 0], variance[..., 0, 0], pixels[0, 0]
    return CellMeans(intensities, variance, np.asarray(pixels), flags, wanted)
