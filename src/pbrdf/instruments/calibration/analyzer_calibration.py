"""Calibration of a polarimeter's analyser vectors by known input states, and how accurate it is.

Intensities I (N states × K inputs) of known Stokes vectors S (4 × K) give the analyser vectors W = I S⁺, for the whole
field of view, for cells of it, or pixel by pixel. Inputs held out from the solution are then reduced with it: the rms
errors of their Q/I, U/I and V/I are the accuracy, linear and circular apart. Calibration of the settings themselves
(axes, retardances …) from the same readings is in :mod:`pbrdf.instruments.calibration.settings_calibration`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter, measured
from pbrdf.instruments.polarimeter.stokes_solution import solve_stokes
from pbrdf.optics import stokes as degrees
from pbrdf.optics.stokes import STOKES

__all__ = [
    "Accuracy",
    "Calibration",
    "accuracy_of",
    "calibrate",
    "input_errors",
    "reduced_inputs",
    "standard_inputs",
    "verify",
]

#: Input states whose Stokes vectors have a singular value below this share of the largest do not span the others.
_SPAN = 1e-6


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
    found
        Stokes vectors that the readings give, shape (4, K) or (4, K, rows, columns): of an input held out by vectors in
        which it has no part, of the others by those of the polarimeter. NaN where there are no readings, and in what is
        not measured.
    """

    polarimeter: Polarimeter
    covariance: np.ndarray
    accuracy: Accuracy | None
    held_out: tuple[int, ...]
    residual: float
    filled: np.ndarray
    found: np.ndarray


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
        own = {k: _solve(read, S, spread, [j for j in train if j != k], used)[0] for k in out}
    else:
        own = {}
    found = np.stack([reduced_inputs(own.get(k, W), read[:, k]) for k in range(count)], axis=1)
    accuracy = accuracy_of(found, S, out)
    W, covariance, filled = _fill(W, covariance)
    polarimeter = measured(W, states, name)
    if mosaic is not None:
        polarimeter = Polarimeter(
            W, polarimeter.states, name, np.asarray(mosaic), details=polarimeter.details
        )
    if accuracy is not None:
        polarimeter = polarimeter.with_accuracy(accuracy.linear, np.nan_to_num(accuracy.circular))
    return Calibration(polarimeter, covariance, accuracy, tuple(out), residual, filled, found)


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
    found = np.stack([reduced_inputs(polarimeter.analyzer, read[:, k]) for k in range(S.shape[1])], axis=1)
    accuracy = accuracy_of(found, S)
    assert accuracy is not None
    return accuracy


def reduced_inputs(analyzer: np.ndarray, intensities: np.ndarray) -> np.ndarray:
    """Stokes vectors (4, ...) from intensities (N, ...), states weighing alike; NaN in what is not measured.

    Parameters
    ----------
    analyzer
        Shape (N, 4), or (rows, columns, N, 4) for intensities of the shape (N, rows, columns).
    """
    known = np.isfinite(analyzer).all(axis=(-1, -2))
    analyzer = np.where(known[..., None, None], analyzer, 0.0)
    return solve_stokes(intensities, np.ones_like(intensities), analyzer, weighted=False)[0]


def input_errors(found: np.ndarray, stokes: np.ndarray) -> np.ndarray:
    """Errors of Q/I, U/I, V/I, DoLP and DoCP.

    Parameters
    ----------
    found
        Stokes vectors, shape (4, K, ...).
    stokes
        The inputs, shape (4, K).

    Returns
    -------
    ndarray
        Shape (5, K, ...).
    """
    true = np.reshape(stokes, (*np.shape(stokes), *(1,) * (found.ndim - 2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = list(found[1:] / found[0] - true[1:] / true[0])
    last, first = np.moveaxis(found, 0, -1), np.moveaxis(true, 0, -1)
    parts += [degrees.dolp(last) - degrees.dolp(first), degrees.docp(last) - degrees.docp(first)]
    return np.stack(parts)


def accuracy_of(
    found: np.ndarray, stokes: np.ndarray, inputs: Sequence[int] | None = None
) -> Accuracy | None:
    """Rms errors of Stokes vectors found (4, K, ...) at some of the inputs (4, K), all by default, that are lit.

    None if there is no such input.
    """
    chosen = [k for k in (range(stokes.shape[1]) if inputs is None else inputs) if stokes[0, k] > 0.0]
    if not chosen:
        return None
    squares = input_errors(found[:, chosen], stokes[:, chosen]) ** 2

    def rms(*rows: int) -> float:
        part = squares[list(rows)]
        return float(np.sqrt(part[np.isfinite(part)].mean())) if np.isfinite(part).any() else float("nan")

    return Accuracy(rms(0, 1), rms(2), rms(3), rms(4), len(chosen))


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


def _fill(W: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells without a solution get that of the nearest cell that has one."""
    missing = ~np.isfinite(W).all(axis=(-1, -2))
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        y, x = distance_transform_edt(missing, return_distances=False, return_indices=True)
        W, covariance = W[y, x], covariance[y, x]
    return W, covariance, missing
