"""Calibration of a polarimeter by known input states, and how accurate it is.

Intensities I (N states × K inputs) of known Stokes vectors S (4 × K) give the analyser vectors W = I S⁺, for the whole
field of view, for cells of it, or pixel by pixel. Inputs held out from the solution are then reduced with it: the rms
errors of their Q/I, U/I and V/I are the accuracy, linear and circular apart. Calibration of the settings themselves
(axes, retardances …) from the same readings is in :mod:`pbrdf.instruments.model_calibration`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.detector import Detector
from pbrdf.instruments.polarimeter import STOKES, Polarimeter, measured
from pbrdf.instruments.reduction import count_flags, flag_pixels
from pbrdf.instruments.stokes_solution import solve_stokes
from pbrdf.optics import stokes as degrees

__all__ = ["Accuracy", "Calibration", "Readings", "calibrate", "read_inputs", "standard_inputs", "verify"]

#: Input states whose Stokes vectors have a singular value below this share of the largest do not span the others.
_SPAN = 1e-6


@dataclass(frozen=True, eq=False)
class Readings:
    """What the instrument read at K known inputs.

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
        :class:`~pbrdf.instruments.reduction.PixelFlag` of the pixels, of all inputs together, uint8. A pixel that is
        bad at one input is left out at all of them: every input is averaged over the same pixels.
    """

    intensities: np.ndarray
    variance: np.ndarray
    pixels: np.ndarray
    flags: np.ndarray

    def counts(self) -> dict[str, int]:
        """How many pixels are good, and how many carry each flag."""
        return count_flags(self.flags)


@dataclass(frozen=True)
class Accuracy:
    """Rms errors of a calibrated instrument at inputs that it was not calibrated with.

    Attributes
    ----------
    linear
        Of Q/I and U/I, both together, each counted by itself.
    circular
        Of V/I; NaN for an instrument that does not measure V.
    dolp, docp
        Of the degrees of linear and circular polarisation.
    inputs
        How many inputs were reduced.
    """

    linear: float
    circular: float
    dolp: float
    docp: float
    inputs: int


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated polarimeter.

    Attributes
    ----------
    polarimeter
        With the calibrated analyser vectors, in units of intensity read per intensity of the inputs; its accuracy is
        that of the inputs held out.
    covariance
        Noise covariance of each analyser vector, shape (N, 4, 4) or (rows, columns, N, 4, 4).
    accuracy
        At the inputs held out; None if none was.
    held_out
        Their indices.
    residual
        Rms of intensities minus W·S over the mean intensity.
    filled
        Cells without a good pixel, which carry the vectors of the nearest good one, bool, shape (rows, columns) or ().
    """

    polarimeter: Polarimeter
    covariance: np.ndarray
    accuracy: Accuracy | None
    held_out: tuple[int, ...]
    residual: float
    filled: np.ndarray


def standard_inputs(angles: int = 12, *, circular: bool = True, natural: bool = False) -> np.ndarray:
    """Stokes vectors of a usual set of inputs, of intensity 1, shape (4, K).

    Parameters
    ----------
    angles
        Linear polarisations, evenly over 180° from 0.
    circular
        Left and right circular light after them.
    natural
        Natural light last.
    """
    psi = np.pi * np.arange(angles) / angles
    columns = [np.stack([np.ones(angles), np.cos(2.0 * psi), np.sin(2.0 * psi), np.zeros(angles)])]
    if circular:
        columns.append(np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [1.0, -1.0]]))
    if natural:
        columns.append(np.array([[1.0], [0.0], [0.0], [0.0]]))
    return np.concatenate(columns, axis=1)


def read_inputs(
    frames: ArrayLike,
    detector: Detector,
    *,
    cells: tuple[int, int] | None = (1, 1),
    dead: ArrayLike | None = None,
    dark_level: float = 0.0,
    black: ArrayLike | None = None,
    flat: ArrayLike | None = None,
) -> Readings:
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
        See :func:`pbrdf.instruments.reduction.reduce_frames`; shapes (rows, columns).

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
    states, inputs, rows, columns = frames.shape
    tall, wide = (rows, columns) if cells is None else cells
    if not (1 <= tall <= rows and 1 <= wide <= columns):
        raise DataError(f"pictures of {rows} × {columns} pixels cannot be divided into {tall} × {wide} cells")
    level = np.asarray(detector.black if black is None else black, dtype=float)
    response = np.asarray(1.0 if flat is None else flat, dtype=float)
    for name, array in (("the black level", level), ("the flat field", response)):
        if array.shape not in ((), (rows, columns)):
            raise DataError(f"{name} has the shape {array.shape}, the frames are {rows} × {columns} pixels")
    flags = np.zeros((rows, columns), dtype=np.uint8)
    for k in range(inputs):
        flags |= flag_pixels(frames[:, k], detector, dead=dead, dark_level=dark_level, black=black)
    good = flags == 0
    if not good.any():
        raise DataError("no pixel of the calibration frames is good: all are saturated, dead or dark")
    if not (np.broadcast_to(response, good.shape)[good] > 0.0).all():
        raise DataError("the flat field is not positive at a pixel that is used: mark it as dead")
    response = np.where(good, response, 1.0)
    starts = [-(-np.arange(count) * size // count) for count, size in ((tall, rows), (wide, columns))]

    def total(image: np.ndarray) -> np.ndarray:
        return np.add.reduceat(np.add.reduceat(image, starts[0], axis=0), starts[1], axis=1)

    pixels = total(good.astype(int))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(pixels > 0, 1.0 / pixels, np.nan)
    intensities = np.empty((states, inputs, tall, wide))
    variance = np.empty_like(intensities)
    for j in range(states):
        for k in range(inputs):
            frame = np.where(good, frames[j, k], level)
            intensities[j, k] = total((frame - level) / response * good) * share
            variance[j, k] = total(detector.variance(frame) / response**2 * good) * share**2
    if cells == (1, 1):
        intensities, variance, pixels = intensities[..., 0, 0], variance[..., 0, 0], pixels[0, 0]
    return Readings(intensities, variance, np.asarray(pixels), flags)


def calibrate(
    intensities: ArrayLike,
    stokes: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    held_out: Sequence[int] | Literal["each"] = "each",
    components: str = "IQUV",
    states: Sequence[str] | None = None,
    name: str = "calibrated polarimeter",
    mosaic: np.ndarray | None = None,
) -> Calibration:
    """Analyser vectors from known input states, W = I S⁺.

    Parameters
    ----------
    intensities
        Shape (N, K), or (N, K, rows, columns) for a map.
    stokes
        The inputs, shape (4, K), in the instrument's axes.
    variance
        Of the intensities, the same shape: inputs weigh accordingly. Without it all weigh the same, and the noise is
        taken from the residuals.
    held_out
        Indices of inputs that only verify; or ``"each"``: the analyser vectors come from all inputs, and each in turn
        is reduced with those of the others, as long as the others determine them. ``()`` verifies nothing.
    components
        ``"IQUV"``, or ``"IQU"`` for linear polarisers, which do not see V: its elements are then 0, and circular inputs
        are not needed.
    states, name, mosaic
        Of the polarimeter.

    Raises
    ------
    DataError
        If shapes do not fit, or the input states do not determine the components: says which.
    """
    read, S, spread = _checked(intensities, stokes, variance)
    if components not in ("IQUV", "IQU"):
        raise DataError(f"components are {components!r}: use 'IQUV', or 'IQU' for linear polarisers")
    used = len(components)
    missing = _not_spanned(S[:used])
    if missing:
        raise DataError(
            f"the {S.shape[1]} input states do not determine {', '.join(missing)}: add inputs that differ in it"
            + (", or calibrate the components 'IQU' of linear polarisers" if missing == ["V"] else "")
        )
    count = S.shape[1]
    if isinstance(held_out, str):
        if held_out != "each":
            raise DataError(f"held_out is {held_out!r}: give indices of inputs, or 'each'")
        out = [k for k in range(count) if not _not_spanned(np.delete(S[:used], k, axis=1))]
        train = list(range(count))
    else:
        out = sorted({int(k) for k in held_out})
        if out and not (out[0] >= 0 and out[-1] < count):
            raise DataError(f"an input held out is not one of 0 … {count - 1}")
        train = [k for k in range(count) if k not in out]
        missing = _not_spanned(S[:used, train])
        if missing:
            raise DataError(f"without the inputs held out, the others do not determine {', '.join(missing)}")
    W, covariance, residual = _solve(read, S, spread, train, used)
    if isinstance(held_out, str):
        solved = ((k, _solve(read, S, spread, [j for j in train if j != k], used)[0]) for k in out)
    else:
        solved = ((k, W) for k in out)
    errors = [_errors(own, read[:, k], S[:, k]) for k, own in solved if S[0, k] > 0.0]
    accuracy = _accuracy(errors) if errors else None
    W, covariance, filled = _fill(W, covariance)
    polarimeter = measured(W, states, name)
    if mosaic is not None:
        polarimeter = Polarimeter(
            W, polarimeter.states, name, np.asarray(mosaic), details=polarimeter.details
        )
    if accuracy is not None:
        polarimeter = polarimeter.with_accuracy(accuracy.linear, np.nan_to_num(accuracy.circular))
    return Calibration(polarimeter, covariance, accuracy, tuple(out), residual, filled)


def verify(polarimeter: Polarimeter, intensities: ArrayLike, stokes: ArrayLike) -> Accuracy:
    """Accuracy of a polarimeter at known inputs.

    Parameters
    ----------
    polarimeter
        One set of analyser vectors, or a map with the cells of `intensities`.
    intensities
        Shape (N, K), or (N, K, rows, columns).
    stokes
        Shape (4, K), each of positive intensity.

    Raises
    ------
    DataError
        If the shapes do not fit.
    """
    read, S, _ = _checked(intensities, stokes, None)
    if read.shape[0] != polarimeter.size or (S[0] <= 0.0).any():
        raise DataError(
            f"give intensities of the {polarimeter.size} states of {polarimeter.name}, at inputs of positive intensity"
        )
    return _accuracy([_errors(polarimeter.analyzer, read[:, k], S[:, k]) for k in range(S.shape[1])])


def _checked(
    intensities: ArrayLike, stokes: ArrayLike, variance: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    read, S = np.asarray(intensities, dtype=float), np.asarray(stokes, dtype=float)
    spread = None if variance is None else np.asarray(variance, dtype=float)
    if (
        read.ndim not in (2, 4)
        or S.shape != (4, *read.shape[1:2])
        or (spread is not None and spread.shape != read.shape)
    ):
        raise DataError(
            f"intensities {read.shape} at Stokes vectors {S.shape}: give (states, inputs), or (states, inputs, rows, "
            "columns), and (4, inputs); variances as the intensities"
        )
    if not np.isfinite(read).all(axis=(0, 1)).any():
        raise DataError("no pixel or cell has an intensity that is a number at every state and input")
    if not np.isfinite(S).all():
        raise DataError("the Stokes vector of an input state holds a number that is not finite")
    return read, S, spread


def _not_spanned(S: np.ndarray) -> list[str]:
    """Components that inputs (n, K) do not determine the answer to."""
    vectors, singular, _ = np.linalg.svd(S)
    kept = vectors[:, : len(singular)][:, singular > _SPAN * singular[0]]
    return [STOKES[i] for i in np.flatnonzero(1.0 - (kept**2).sum(axis=1) > _SPAN)]


def _solve(
    read: np.ndarray, S: np.ndarray, variance: np.ndarray | None, inputs: list[int], used: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Analyser vectors (..., N, 4), covariance (..., N, 4, 4) and relative rms residual from some of the inputs.

    The unknowns are those of a reduction with the parts exchanged: the inputs analyse the analyser vectors.
    """
    inner = S[:, inputs].T.copy()
    inner[:, used:] = 0.0
    values = np.swapaxes(read[:, inputs], 0, 1)
    spread = np.ones_like(values) if variance is None else np.swapaxes(variance[:, inputs], 0, 1)
    W, covariance = solve_stokes(values, spread, inner, weighted=variance is not None)
    W[used:], covariance[used:], covariance[:, used:] = 0.0, 0.0, 0.0
    residuals = values - np.tensordot(inner, W, axes=(1, 0))
    if variance is None:
        freedom = max(len(inputs) - used, 1)
        covariance = covariance * ((residuals**2).sum(axis=0) / freedom)
    residual = float(np.sqrt(np.nanmean(residuals**2)) / np.nanmean(values))
    return np.moveaxis(W, (0, 1), (-1, -2)), np.moveaxis(covariance, (0, 1, 2), (-2, -1, -3)), residual


def _errors(W: np.ndarray, intensities: np.ndarray, stokes: np.ndarray) -> np.ndarray:
    """Errors of Q/I, U/I, V/I, DoLP and DoCP at one input (N, ...), shape (5, ...)."""
    known = np.isfinite(W).all(axis=(-1, -2))
    W = np.where(known[..., None, None], W, 0.0)
    found, _ = solve_stokes(intensities, np.ones_like(intensities), W, weighted=False)
    ratios = found[1:] / found[0]
    true = stokes[1:] / stokes[0]
    last = np.moveaxis(found, 0, -1)
    parts = [ratios[i] - true[i] for i in range(3)]
    parts += [degrees.dolp(last) - degrees.dolp(stokes), degrees.docp(last) - degrees.docp(stokes)]
    return np.stack(parts)


def _accuracy(errors: list[np.ndarray]) -> Accuracy:
    squares = np.stack(errors).reshape(len(errors), 5, -1) ** 2

    def rms(rows: list[int]) -> float:
        part = squares[:, rows]
        return float(np.sqrt(part[np.isfinite(part)].mean())) if np.isfinite(part).any() else float("nan")

    return Accuracy(rms([0, 1]), rms([2]), rms([3]), rms([4]), len(errors))


def _fill(W: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells without a solution get that of the nearest cell that has one."""
    missing = ~np.isfinite(W).all(axis=(-1, -2))
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        y, x = distance_transform_edt(missing, return_distances=False, return_indices=True)
        W, covariance = W[y, x], covariance[y, x]
    return W, covariance, missing
