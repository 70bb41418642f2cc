"""Lines of sight of a camera's pixels, and lamps, in the axes of the camera.

The axes: x to the right in the picture, y upwards, z against the line of sight of the picture's middle, from the sample
to the camera. Places in the picture are counted as those of regions are (:mod:`pbrdf.instruments.reduction.regions`):
x from the left edge, y from the top edge down, so that the centre of the first pixel is (½, ½).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pbrdf.errors import DataError

__all__ = ["Lamp", "PixelCamera"]


@dataclass(frozen=True)
class PixelCamera:
    """A camera without distortion: a pinhole, or from so far away that all lines of sight are parallel.

    Attributes
    ----------
    focal
        Focal length in pixels; None is orthographic, unless there is a field of view.
    field_of_view
        Across the width of the picture, radians, in place of the focal length.
    centre
        Where the optical axis meets the picture, pixels (x, y); the middle of the picture by default.

    Raises
    ------
    DataError
        If a number is not positive, or both focal length and field of view are given.
    """

    focal: float | None = None
    field_of_view: float | None = None
    centre: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.focal is not None and self.field_of_view is not None:
            raise DataError("a camera has a focal length or a field of view: give one of them")
        if self.focal is not None and not 0.0 < self.focal < math.inf:
            raise DataError(f"the focal length is {self.focal:g} pixels: it must be more than 0")
        if self.field_of_view is not None and not 0.0 < self.field_of_view < math.pi:
            raise DataError(
                f"the field of view is {math.degrees(self.field_of_view):g}°: it must be between 0 and 180"
            )

    def sized(self, rows: int, columns: int) -> PixelCamera:
        """The camera of a picture of this size: with its focal length in pixels and its centre."""
        focal = self.focal
        if self.field_of_view is not None:
            focal = 0.5 * columns / math.tan(0.5 * self.field_of_view)
        return PixelCamera(focal, None, self.centre or (0.5 * columns, 0.5 * rows))

    def plane(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Places in the picture as vectors (right, up) from its centre, pixels, shape (..., 2)."""
        if self.centre is None:
            raise DataError("the size of the picture is not known yet")
        return np.stack(np.broadcast_arrays(x - self.centre[0], self.centre[1] - y), axis=-1)

    def view(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Unit vectors towards the camera of what is seen at (x, y), shape (..., 3), or (3,) if all are the same."""
        if self.focal is None:
            return np.array([0.0, 0.0, 1.0])
        across = -self.plane(x, y)
        vector = np.concatenate([across, np.full((*across.shape[:-1], 1), self.focal)], axis=-1)
        values: np.ndarray = vector / np.linalg.norm(vector, axis=-1, keepdims=True)
        return values

    def place(self, direction: np.ndarray) -> tuple[float, float]:
        """Where in the picture a ray towards the camera, from this direction (3,), is seen."""
        if self.focal is None or self.centre is None:
            raise DataError("without a focal length all lines of sight are parallel")
        right, up = -self.focal * direction[:2] / direction[2]
        return float(self.centre[0] + right), float(self.centre[1] - up)

    def __str__(self) -> str:
        if self.field_of_view is not None:
            return f"field of view {math.degrees(self.field_of_view):g} degrees"
        return "orthographic" if self.focal is None else f"focal length {self.focal:.6g} pixels"


@dataclass(frozen=True)
class Lamp:
    """A small source of natural light.

    Attributes
    ----------
    polar
        Angle between the direction of the lamp, seen from the middle of the sample, and the camera's z axis, radians:
        0 is beside the camera, more than π/2 behind the sample.
    azimuth
        Of the lamp in the picture, radians: 0 on the right, π/2 above, counterclockwise.
    distance
        From the middle of the sample, in the unit of the sample's size; infinite by default.
    """

    polar: float
    azimuth: float = 0.0
    distance: float = math.inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.polar <= math.pi and math.isfinite(self.azimuth)):
            raise DataError(
                f"a lamp's direction is {math.degrees(self.polar):g}° from the camera's axis at the azimuth "
                f"{math.degrees(self.azimuth):g}°: give 0 to 180, and a finite azimuth"
            )
        if not self.distance > 0.0:
            raise DataError(f"a lamp's distance is {self.distance:g}: it must be more than 0")

    @classmethod
    def towards(cls, vector: np.ndarray, distance: float = math.inf) -> Lamp:
        """The lamp in the direction of a vector, shape (3,)."""
        x, y, z = (float(c) for c in vector)
        return cls(math.atan2(math.hypot(x, y), z), math.atan2(y, x), distance)

    @property
    def direction(self) -> np.ndarray:
        """Unit vector from the middle of the sample, shape (3,)."""
        across = math.sin(self.polar)
        return np.array(
            [across * math.cos(self.azimuth), across * math.sin(self.azimuth), math.cos(self.polar)]
        )

    def scaled(self, unit: float) -> Lamp:
        """With the distance counted in another unit."""
        return replace(self, distance=self.distance / unit)

    def seen_from(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Directions from points about the middle of the sample, and the irradiance there across the beam.

        Parameters
        ----------
        point
            Shape (..., 3), in the unit of the distance.

        Returns
        -------
        direction, irradiance
            Unit vectors, shape (..., 3) or (3,); irradiance in parts of that in the middle of the sample, shape (...),
            or None if it is the same everywhere.
        """
        if math.isinf(self.distance):
            return self.direction, None
        vector = self.distance * self.direction - point
        length = np.linalg.norm(vector, axis=-1)
        return vector / length[..., None], (self.distance / length) ** 2

    def __str__(self) -> str:
        there = f"{math.degrees(self.polar):.6g}@{math.degrees(self.azimuth):.6g} degrees"
        return there if math.isinf(self.distance) else f"{there}, distance {self.distance:.6g}"
