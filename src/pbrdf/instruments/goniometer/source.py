"""What the light source and the goniometer's mechanics add to a measurement.

The source is the port of an integrating sphere: a uniform disc of some angular radius seen from the sample, steady
from one reading to the next up to its stability, and nearly unpolarised. The mechanics set angles with an error of
their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.protocols import Protocol

__all__ = ["AngleErrors", "Source"]

#: Largest angular radius of a source, and largest standard deviation of an angle, radians.
_WIDEST, _LARGEST_ERROR = 0.5, 0.1


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
        :attr:`Protocol.source_reference_angle`); Q > 0 along its x axis.
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

    def readings(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Radiance at so many readings, 1 on average; shape (count,)."""
        return 1.0 + self.stability * rng.standard_normal(count)


@dataclass(frozen=True)
class AngleErrors:
    """Errors of the goniometer's angles, normal, radians.

    Attributes
    ----------
    sample
        Standard deviation of the sample angle at each geometry.
    camera
        Standard deviation of the camera's position, drawn once for each group: it stays where it is while the sample
        turns.
    zero
        Standard deviation of the zero of the sample angle, drawn once for each group, as the sample is mounted anew.
    tilt
        Standard deviation of the tilt of the sample out of the plane of incidence at each geometry.
    """

    sample: float = 0.0
    camera: float = 0.0
    zero: float = 0.0
    tilt: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and 0.0 <= value <= _LARGEST_ERROR):
                raise DataError(
                    f"angle errors: that of the {field.name} is {math.degrees(value):.4g}°, it must be within "
                    f"0° … {math.degrees(_LARGEST_ERROR):.1f}°"
                )

    def apply(self, protocol: Protocol, rng: np.random.Generator) -> Protocol:
        """The geometries that there really are when those of a protocol are set.

        Raises
        ------
        DataError
            If an error puts a ray below the horizon.
        """
        labels, member = np.unique(protocol.group, return_inverse=True)
        # drawn whatever the sizes are, so that one error can be changed and the others stay
        own = rng.standard_normal(len(protocol))
        camera, zero = rng.standard_normal((2, len(labels)))
        tilt = rng.standard_normal(len(protocol))
        return protocol.displaced(
            self.sample * own + self.zero * zero[member], self.camera * camera[member], self.tilt * tilt
        )
