"""A camera's detector: from electrons to digital numbers, and what a digital number is worth.

Photon transfer: a pixel that holds N electrons on average holds a Poisson number of them, the read-out adds normal
noise, the amplifier divides by the gain, an offset is added, and the converter rounds and clips. The variance of a
digital number d is therefore (d − offset)/gain + (read noise/gain)² + 1/12, in digital numbers squared (Janesick,
*Photon Transfer*, 2007, ch. 3). The last term is that of the rounding; it holds as long as the noise before it is not
much below half a digit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError

__all__ = ["Detector"]

#: By how many read noises a full pixel may read below the full well and still counts as saturated.
_SATURATION_MARGIN = 4.0


@dataclass(frozen=True)
class Detector:
    """Numbers of a detector.

    Attributes
    ----------
    bits
        Of the converter, 1 … 16: digital numbers are 0 … 2^bits − 1.
    gain
        Electrons per digital number.
    read_noise
        Standard deviation, electrons.
    offset
        Black level, digital numbers.
    dark
        Dark signal of one exposure, electrons.
    full_well
        Electrons a pixel holds; None if the converter clips first.
    full_scale
        Digital number at which the converter ends, if that is below 2^bits − 1 (4080 of 8 bits stretched to 12); else
        None.
    alignment
        Where the bits stand in the numbers of 16 bits that files hold: ``"right"``, the numbers are those of the
        converter; ``"left"``, they are shifted up to end at 65535, as the format Mono16 of many cameras has it, and
        are shifted down when they are read; None: the frames tell.

    Raises
    ------
    DataError
        If a number is out of its range, or offset and dark signal leave none for light.
    """

    bits: int = 12
    gain: float = 2.5
    read_noise: float = 6.0
    offset: float = 0.0
    dark: float = 0.0
    full_well: float | None = None
    full_scale: float | None = None
    alignment: str | None = None

    def __post_init__(self) -> None:
        whole = isinstance(self.bits, Integral) and not isinstance(self.bits, bool)
        if not (whole and 1 <= self.bits <= 16):
            raise DataError(f"detector: bits is {self.bits!r}, it must be a whole number from 1 to 16")
        if self.alignment not in (None, "left", "right"):
            raise DataError(f"detector: alignment is {self.alignment!r}, it must be 'left' or 'right'")
        for name in ("gain", "read_noise", "offset", "dark", "full_well", "full_scale"):
            value = getattr(self, name)
            if name in ("full_well", "full_scale") and value is None:
                continue
            number = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
            positive = name in ("gain", "full_well", "full_scale")
            if not (number and (value > 0.0 if positive else value >= 0.0)):
                limit = "more than 0" if positive else "0 or more"
                raise DataError(f"detector: {name} is {value!r}, it must be a number of {limit}")
        if self.full_scale is not None and self.full_scale > 2**self.bits - 1:
            raise DataError(
                f"detector: full_scale is {self.full_scale:g}, but {self.bits} bits end at {2**self.bits - 1}"
            )
        if self.range <= 0.0:
            raise DataError(
                f"detector: offset {self.offset:g} and dark signal {self.dark / self.gain:g} leave no range below "
                f"saturation at the digital number {self.saturation:g}"
            )

    @property
    def black(self) -> float:
        """Digital number of a pixel without light: offset and dark signal."""
        return self.offset + self.dark / self.gain

    @property
    def saturation(self) -> float:
        """Digital number from which a pixel counts as saturated.

        The largest of the converter, or less if the pixel fills before: then read noise scatters the full pixels, and
        those up to 4 read noises below the full well count.
        """
        top = float(2**self.bits - 1 if self.full_scale is None else self.full_scale)
        if self.full_well is None:
            return top
        least = (self.full_well - _SATURATION_MARGIN * self.read_noise) / self.gain + self.offset
        return min(top, math.floor(least))

    @property
    def range(self) -> float:
        """Largest signal above black level, digital numbers."""
        return self.saturation - self.black

    def expose(self, signal: ArrayLike, rng: np.random.Generator) -> np.ndarray:
        """Frames that the detector reads out.

        Parameters
        ----------
        signal
            Mean signal above black level, digital numbers, any shape; negative ones count as 0.
        rng
            Source of the noise.

        Returns
        -------
        ndarray
            uint8 up to 8 bits, else uint16; the shape of `signal`.

        Raises
        ------
        DataError
            If a signal is not finite.
        """
        signal = np.asarray(signal, dtype=float)
        if not np.isfinite(signal).all():
            raise DataError("detector: a signal to expose is not a finite number")
        # far beyond saturation the exact number does not matter, and a Poisson number may not exceed 2⁶³
        electrons = np.clip(signal, 0.0, 16.0 * 2.0**self.bits) * self.gain + self.dark
        held = rng.poisson(electrons).astype(float)
        if self.full_well is not None:
            np.minimum(held, self.full_well, out=held)
        held += self.read_noise * rng.standard_normal(held.shape)
        numbers = np.rint(held / self.gain + self.offset)
        kind = np.uint8 if self.bits <= 8 else np.uint16
        top = 2.0**self.bits - 1.0 if self.full_scale is None else self.full_scale
        values: np.ndarray = np.clip(numbers, 0.0, top).astype(kind)
        return values

    def signal(self, frames: ArrayLike) -> np.ndarray:
        """Signal above black level, digital numbers."""
        return np.asarray(frames, dtype=float) - self.black

    def variance(self, frames: ArrayLike) -> np.ndarray:
        """Variance of single digital numbers from shot noise, read-out and rounding, digital numbers squared."""
        electrons = np.maximum((np.asarray(frames, dtype=float) - self.offset) * self.gain, 0.0)
        return (electrons + self.read_noise**2) / self.gain**2 + 1.0 / 12.0

    def saturated(self, frames: ArrayLike) -> np.ndarray:
        """Which pixels are saturated, bool."""
        return np.asarray(frames) >= self.saturation
