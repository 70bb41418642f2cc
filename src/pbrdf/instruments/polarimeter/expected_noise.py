"""What an instrument will know of light that it has not seen yet: exposure, noise, calibration.

The covariance of the mean Stokes vector over n alike pixels is W⁺ Σ W⁺ᵀ/n from the detector, a term of rounding,
diag(0, l², l², c²) (I² + Q² + U² + V²)/2 from calibration errors (linear l, circular c) that are another at each
geometry (:func:`~pbrdf.instruments.virtual.miscalibration.miscalibrated`), and s² S Sᵀ from a source of stability s.

Rounding is noise only where other noise hides it: all pixels of an even region round a quiet signal the same way. Of
its variance 1/12 the part Σ_k exp(−4π²k²σ²)/(2π²k²) is common to pixels whose other noise is σ digital numbers (the
mean square of the Fourier series of the rounding error, each term damped by the characteristic function of the noise;
Widrow, Kollár, Liu, IEEE Trans. Instrum. Meas. 45, 353 (1996)), and averaging does not lessen it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.stokes_solution import solve_stokes
from pbrdf.optics.elements import rotate_frame

__all__ = [
    "FILL",
    "automatic_exposure",
    "expected_covariance",
    "rounding_covariance",
    "systematic_covariance",
]

#: Part of the detector's range that the brightest pixel reaches if exposures are set to the light.
FILL = 0.8


def systematic_covariance(instrument: Instrument, stokes: np.ndarray) -> np.ndarray:
    """Covariance by calibration and source, in the instrument's axes: no number of pixels averages it away.

    Accuracy is the root mean square error of Q/I, U/I and of V/I for fully polarised light; for natural light the
    errors are smaller by √2.

    Parameters
    ----------
    instrument
        States accuracy and stability.
    stokes
        Shape (..., 4); NaN where a component is not known.

    Returns
    -------
    ndarray
        Shape (..., 4, 4).
    """
    linear, circular = instrument.polarimeter.accuracy
    size = 0.5 * np.nansum(np.square(stokes), axis=-1)
    calibration = np.diag([0.0, linear**2, linear**2, circular**2]) * size[..., None, None]
    values: np.ndarray = calibration + instrument.stability**2 * stokes[..., :, None] * stokes[..., None, :]
    return values


def rounding_covariance(instrument: Instrument, signal: np.ndarray, pixels: int) -> np.ndarray:
    """What rounding adds to the covariance of the mean of several alike pixels, beyond their own noise.

    Parameters
    ----------
    instrument
        Whose detector rounds; of a map of analyser vectors the mean counts.
    signal
        Digital numbers above the black level in each state, shape (N, ...).
    pixels
        Number of pixels; one alone has nothing in common with others.

    Returns
    -------
    ndarray
        Of the Stokes vector in the instrument's axes, shape (..., 4, 4); 0 for components that it does not see.
    """
    W, detector = instrument.polarimeter.mean_analyzer, instrument.detector
    variance = detector.variance(signal + detector.black)
    k = np.arange(1.0, 101.0).reshape(-1, *(1,) * np.ndim(signal))
    other = np.maximum(variance - 1.0 / 12.0, 0.0)
    common = (np.exp(-4.0 * np.pi**2 * k**2 * other) / (2.0 * np.pi**2 * k**2)).sum(axis=0)
    # propagated with the weights that the pixels have, those of their whole variance
    whole = np.moveaxis(np.nan_to_num(solve_stokes(signal, variance, W)[1]), (0, 1), (-2, -1))
    gain = whole @ (W.T / np.moveaxis(variance, 0, -1)[..., None, :])
    values: np.ndarray = (
        (1.0 - 1.0 / pixels) * (gain * np.moveaxis(common, 0, -1)[..., None, :]) @ np.swapaxes(gain, -1, -2)
    )
    return values


def automatic_exposure(instrument: Instrument, brightest: ArrayLike, fill: float = FILL) -> np.ndarray:
    """Exposures at which the brightest pixel reaches a part of the detector's range.

    Parameters
    ----------
    instrument
        Whose detector is meant.
    brightest
        Largest intensity behind the analyser at unit exposure, digital numbers, any shape.
    fill
        The part, above 0 up to 1.

    Returns
    -------
    ndarray
        Exposure times to four digits, as a camera is set; 1 where there is no light.

    Raises
    ------
    DataError
        If the part is out of range.
    """
    if not 0.0 < fill <= 1.0:
        raise DataError(
            f"exposure: the brightest pixel can reach a part from 0 to 1 of the range, not {fill!r}"
        )
    brightest = np.asarray(brightest, dtype=float)
    lit = brightest > 0.0
    exact = fill * instrument.detector.range / np.where(lit, brightest, 1.0)
    unit = 10.0 ** (np.floor(np.log10(exact)) - 3.0)
    return np.where(lit, np.round(exact / unit) * unit, 1.0)


def expected_covariance(
    instrument: Instrument,
    stokes: ArrayLike,
    *,
    reference_angle: ArrayLike = 0.0,
    pixels: int = 400,
    exposure: ArrayLike | None = None,
) -> np.ndarray:
    """Covariance of a region's mean Stokes vector before it is measured.

    Parameters
    ----------
    instrument
        What will measure; of a map of analyser vectors the mean counts.
    stokes
        Radiance in the axes (p, s) of the surface, in digital numbers at unit exposure, shape (..., 4).
    reference_angle
        From the p direction to the instrument's x axis, radians, shape (...) or a number.
    pixels
        Number of pixels of the region.
    exposure
        Exposure times, shape (...) or a number; None sets each to the light, see :func:`automatic_exposure`.

    Returns
    -------
    ndarray
        In the axes (p, s) and the square of the unit of `stokes`, shape (..., 4, 4); NaN for components that the
        instrument does not see.

    Raises
    ------
    DataError
        If there is no pixel.
    """
    if pixels < 1:
        raise DataError(f"a region has at least one pixel, not {pixels}")
    stokes = np.asarray(stokes, dtype=float)
    turn = rotate_frame(np.broadcast_to(reference_angle, stokes.shape[:-1]))
    seen = np.einsum("...ij,...j->...i", turn, stokes)
    W = instrument.polarimeter.mean_analyzer
    intensities = seen @ W.T
    if exposure is None:
        exposure = automatic_exposure(instrument, intensities.max(axis=-1))
    signal = np.moveaxis(intensities * np.asarray(exposure)[..., None], -1, 0)
    noise = solve_stokes(signal, instrument.detector.variance(signal + instrument.detector.black), W)[1]
    covariance = np.moveaxis(noise, (0, 1), (-2, -1)) / pixels + rounding_covariance(
        instrument, signal, pixels
    )
    covariance = covariance / np.square(exposure)[..., None, None] + systematic_covariance(instrument, seen)
    # components that are not seen must not spread through the zeros of the rotation
    blind = np.isnan(covariance)
    back = np.swapaxes(turn, -1, -2)
    turned = back @ np.where(blind, 0.0, covariance) @ turn
    return np.where(blind, np.nan, turned)
