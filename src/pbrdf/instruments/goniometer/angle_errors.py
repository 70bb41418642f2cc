"""Errors of a goniometer's mechanics: the geometries that there really are when those of a protocol are set."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.protocols import Protocol

__all__ = ["AngleErrors"]

#: Largest standard deviation of an angle, radians.
_LARGEST_ERROR = 0.1


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
