"""The light source of a goniometer: the port of an integrating sphere.

It is a uniform disc of some angular radius seen from the sample, steady from one reading to the next up to its
stability, and nearly unpolarised.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.errors import DataError

__all__ = ["Source"]

#: Largest angular radius, radians.
_WIDEST = 0.5


@dataclass(frozen=True)
class Source:
    """An extended source of nearly natural light.

    Attributes
    ----------
    angular_radius
        Of the port seen from the sample, radians.
    stability
        Relative standard deviation of its radiance from one reading (geometry) to the next; the paper states better
        than 0.001.
    polarisation
        Residual polarisation Q/I, U/I, V/I in the axes of the source, which is held as the camera is (see
        :attr:`.Protocol.source_reference_angle`); Q > 0 along its x axis.
    """

    angular_radius: float = 0.0
    stability: float = 0.0
    polarisation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.angular_radius) and 0.0 <= self.angular_radius <= _WIDEST):
            raise DataError(
                f"source: its angular radius is {math.degrees(self.angular_radius):.4g}°, it must be within "
                f"0° … {math.degrees(_WIDEST):.1f}°"
            )
        if not (math.isfinite(self.stability) and 0.0 <= self.stability < 1.0):
            raise DataError(f"source: its stability is {self.stability!r}, it must be from 0 to below 1")
        if len(self.polarisation) != 3 or not math.hypot(*self.polarisation) <= 1.0:
            raise DataError(
                f"source: its polarisation {self.polarisation!r} must be three numbers Q/I, U/I, V/I, together at "
                "most 1"
            )

    @property
    def stokes(self) -> np.ndarray:
        """Stokes vector of unit irradiance in the axes of the source, shape (4,)."""
        return np.array([1.0, *self.polarisation])

    def radiances(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Radiance at so many readings, relative to its mean; shape (count,)."""
        return 1.0 + self.stability * rng.standard_normal(count)
