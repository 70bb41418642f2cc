"""From raw frames to Stokes parameters with their covariance, bad pixels marked and left out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.frames.exposures import Reading, single
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.instruments.polarimeter.stokes_solution import BLOCK, blank, row_space, solve_block

__all__ = ["BAD_FLAGS", "PixelFlag", "StokesImage", "count_flags", "flag_pixels", "reduce_frames"]


class PixelFlag(IntFlag):
    """Why a pixel is left out; 0 is a good pixel."""

    GOOD = 0
    SATURATED = 1
    DEAD = 2
    DARK = 4


#: The flags of pixels that are left out.
BAD_FLAGS = (PixelFlag.SATURATED, PixelFlag.DEAD, PixelFlag.DARK)


@dataclass(frozen=True, eq=False)
class StokesImage:
    """Stokes parameters of pixels or regions, with what is known of their errors.

    Attributes
    ----------
    stokes
        I, Q, U, V in digital numbers, shape (4, ...); NaN where a component is not determined or the pixel is
        saturated or dead. Dark pixels keep their values, noise about zero: a region that is dim as a whole needs them,
        as its mean would come out too bright without those that noise has made dark.
    covariance
        Shape (4, 4, ...), noise of the detector only; NaN likewise.
    flags
        :class:`PixelFlag` of each pixel, uint8, shape (...).
    """

    stokes: np.ndarray
    covariance: np.ndarray
    flags: np.ndarray

    def counts(self) -> dict[str, int]:
        """How many pixels are good, and how many carry each flag."""
        return count_flags(self.flags)


def count_flags(flags: np.ndarray) -> dict[str, int]:
    """How many pixels are good, and how many carry each flag; a pixel may carry several."""
    found = {"good": int((flags == 0).sum())}
    for flag in BAD_FLAGS:
        found[str(flag.name).lower()] = int((flags & flag != 0).sum())
    return found


def flag_pixels(
    frames: ArrayLike,
    detector: Detector,
    *,
    dead: ArrayLike | None = None,
    dark_level: float = 0.0,
    black: ArrayLike | None = None,
    saturated: np.ndarray | None = None,
) -> np.ndarray:
    """Which pixels must not be used, and why.

    Parameters
    ----------
    frames
        Raw digital numbers, shape (N, ...). A pixel with a number that is not finite counts as dead.
    dead
        Pixels known to be dead, bool, shape (...) or (N, ...): one dead state makes the pixel dead.
    dark_level
        A pixel is dark if its mean signal over the states does not exceed this many digital numbers.
    black
        Digital numbers of each pixel without light, shape (...) or (N, ...); by default the detector's black level.
    saturated
        Where the frames are saturated, bool, shape (N, ...); by default what the detector says of their numbers.

    Returns
    -------
    ndarray
        uint8, shape (...).

    Raises
    ------
    DataError
        If shapes do not agree.
    """
    frames = np.asarray(frames)
    level = np.asarray(detector.black if black is None else black, dtype=float)
    for name, array in (("the black level", level), ("the map of dead pixels", np.asarray(dead))):
        if array.shape not in ((), frames.shape[1:], frames.shape):
            raise DataError(f"{name} has the shape {array.shape}, the frames have {frames.shape}")
    if level.shape == frames.shape:
        level = level.mean(axis=0)
    # a mean of integers needs no copy of all the frames in floating point
    dark = ~(frames.mean(axis=0, dtype=float) - level > dark_level)
    broken = np.zeros(frames.shape[1:], dtype=bool)
    if frames.dtype.kind == "f":
        broken |= ~np.isfinite(frames).all(axis=0)
    if dead is not None:
        dead = np.asarray(dead, dtype=bool)
        broken |= dead.any(axis=0) if dead.shape == frames.shape else dead
    found = {
        PixelFlag.SATURATED: (detector.saturated(frames) if saturated is None else saturated).any(axis=0),
        PixelFlag.DEAD: broken,
        PixelFlag.DARK: dark & ~broken,
    }
    flags = np.zeros(frames.shape[1:], dtype=np.uint8)
    for flag, where in found.items():
        flags |= np.where(where, np.uint8(flag), np.uint8(0))
    return flags


def reduce_frames(
    frames: ArrayLike | Reading,
    polarimeter: Polarimeter,
    detector: Detector,
    *,
    dead: ArrayLike | None = None,
    dark_level: float = 0.0,
    weighted: bool = True,
    analyzer: np.ndarray | None = None,
    black: ArrayLike | None = None,
    flat: ArrayLike | None = None,
    extra_variance: ArrayLike | None = None,
    exposures: int = 1,
) -> StokesImage:
    """Reduce raw frames pixel by pixel.

    Where there are more states than unknowns, the weights come from the intensities that an unweighted solution
    expects, not from the measured ones: those would trust a state the more, the lower its noise happened to push it,
    and make I about 0.7 electrons too small. What remains pulls Q, U and V towards 0 by up to half an electron;
    unweighted ones are unbiased, but their variance is up to three times as large where the light is highly polarised.

    Parameters
    ----------
    frames
        Raw digital numbers, shape (N, ...): one frame a state (for a mosaic: after
        :func:`pbrdf.instruments.frames.mosaic.split_mosaic`); or a
        :class:`~pbrdf.instruments.frames.exposures.Reading` of them.
    polarimeter, detector
        What took them.
    dead, dark_level
        See :func:`flag_pixels`.
    weighted
        Weigh the states of each pixel by their variance; without it all states weigh the same.
    analyzer
        Analyser vectors of exactly these pixels, shape (..., N, 4), where the polarimeter is a map and the frames are
        only part of the image (:meth:`Polarimeter.spread`).
    black
        Digital numbers of each pixel without light, shape (...) or (N, ...); by default the detector's black level.
    flat
        Response of each pixel relative to the others, shape (...) or (N, ...): the signal is divided by it.
    extra_variance
        Of the signal beyond what the detector knows of, digital numbers squared, shape (...) or (N, ...).
    exposures
        How many exposures the frames are the mean of; a reading knows itself.

    Raises
    ------
    DataError
        If the number of frames is not the number of states, shapes do not agree, or the flat field is not positive at a
        pixel that is used.
    """
    reading = frames if isinstance(frames, Reading) else single(np.asarray(frames), detector, exposures)
    frames = reading.numbers
    if frames.shape[:1] != (polarimeter.size,):
        raise DataError(
            f"{frames.shape[0] if frames.ndim else 0} frames for the {polarimeter.size} states of {polarimeter.name}"
        )
    shape = frames.shape[1:]
    if analyzer is None:
        if polarimeter.is_map and len(shape) != 2:
            raise DataError(
                f"frames of the shape {frames.shape} cannot be placed on the map of {polarimeter.name}: give whole "
                "pictures, or the analyser vectors of the pixels"
            )
        analyzer = polarimeter.spread(*shape) if polarimeter.is_map else polarimeter.analyzer
    flags = flag_pixels(
        frames, detector, dead=dead, dark_level=dark_level, black=black, saturated=reading.saturated
    )
    raw = frames.reshape(len(frames), -1)
    scatter = None if reading.scatter is None else reading.scatter.reshape(raw.shape)
    level = _of_pixels("the black level", detector.black if black is None else black, frames.shape)
    response = _of_pixels("the flat field", 1.0 if flat is None else flat, frames.shape)
    # a dark pixel is solved for where that is possible
    solved = (flags == 0) | ((flags == PixelFlag.DARK) & (response > 0.0).all(axis=0).reshape(shape))
    bad = ~solved.ravel()
    extra = _of_pixels("the extra variance", 0.0 if extra_variance is None else extra_variance, frames.shape)
    W = analyzer.reshape(-1, *analyzer.shape[-2:]) if analyzer.ndim > 2 else analyzer
    stokes = np.empty((4, bad.size))
    covariance = np.empty((4, 4, bad.size))
    for first in range(0, bad.size, BLOCK):
        block = slice(first, first + BLOCK)
        out = bad[block]
        zero, gain = level[:, block], np.where(out, 1.0, response[:, block])
        if not (gain > 0.0).all():
            raise DataError("the flat field is not positive at a pixel that is used: mark it as dead")
        numbers = np.where(out, zero, raw[:, block])
        vectors = W[block] if W.ndim > 2 else W
        projector = row_space(vectors)
        signal = (numbers - zero) / gain
        ranks = np.einsum("...ii->...", projector)
        # as many states as unknowns have one solution, whatever the weights
        overdetermined = weighted and len(raw) > ranks.min() + 0.5
        if overdetermined:
            start, _ = solve_block(signal, np.ones_like(signal), vectors, projector, False)
            expected = np.einsum("nk,kp->np" if vectors.ndim == 2 else "pnk,kp->np", vectors, start)
            numbers = np.maximum(expected, 0.0) * gain + zero
        noise = detector.variance(numbers) * reading.share + reading.rounding
        variance = np.where(out, 1.0, noise / gain**2 + extra[:, block])
        spread = None
        if scatter is not None:
            spread = np.where(out, 1.0, scatter[:, block] / gain**2 + extra[:, block])
        stokes[:, block], covariance[:, :, block] = solve_block(
            signal, variance, vectors, projector, overdetermined, spread
        )
        blank(stokes[:, block], covariance[:, :, block], projector, out)
    return StokesImage(stokes.reshape(4, *shape), covariance.reshape(4, 4, *shape), flags)


def _of_pixels(name: str, values: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """A level of each pixel (or state and pixel) as an array (1 or N, pixels), without copying one number."""
    array = np.asarray(values, dtype=float)
    if array.shape not in ((), shape[1:], shape):
        raise DataError(f"{name} has the shape {array.shape}, the frames have {shape}")
    if array.ndim == 0:
        return np.broadcast_to(array, (1, int(np.prod(shape[1:]))))
    return array.reshape(shape[0] if array.shape == shape else 1, -1)
