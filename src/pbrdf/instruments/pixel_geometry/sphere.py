"""A ball in the picture: every pixel of it sees another direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.geometry import CurvedSample, Surface
from pbrdf.instruments.pixel_geometry.silhouette import find_circle

__all__ = ["Sphere"]


@dataclass(frozen=True, kw_only=True)
class Sphere(CurvedSample):
    """A ball.

    Attributes
    ----------
    x, y
        Where the ball's centre is seen, pixels; found in the picture if it is left out.
    r
        Radius of its outline, pixels; of a camera with perspective the radius that the outline would have in the middle
        of the picture, the focal length times the tangent of its angular radius. Found with `x` and `y`.
    size
        Radius of the ball in the unit of the lamps' distances.
    """

    x: float | None = None
    y: float | None = None
    r: float | None = None
    size: float = 1.0
    _found: dict[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [value is not None for value in (self.x, self.y, self.r)]
        if any(given) and not all(given):
            raise DataError("a ball is given by x, y and r, or found in the picture: give all three or none")
        if self.r is not None and not 0.0 < self.r < math.inf:
            raise DataError(f"the ball's radius is {self.r:g} pixels: it must be more than 0")
        if not 0.0 < self.size < math.inf:
            raise DataError(f"the ball's size is {self.size:g}: it must be more than 0")

    def located(self, stokes: xr.Dataset) -> Sphere:
        camera = self._sized(stokes)
        if self.r is not None:
            return replace(self, camera=camera)
        circle = find_circle(stokes, camera)
        found = {"found": 1, "found_arc_share": circle.arc, "found_residual_pixels": circle.residual}
        return replace(self, camera=camera, x=circle.x, y=circle.y, r=circle.r, _found=found)

    def described(self) -> dict[str, Any]:
        return {"kind": "sphere", "x": self.x, "y": self.y, "r": self.r, "size": self.size, **self._found}

    def surface(self, x: np.ndarray, y: np.ndarray) -> Surface:
        if self.x is None or self.y is None or self.r is None:
            raise DataError("the ball has not been looked for in the pictures yet")
        camera = self.camera
        view = camera.view(x, y)
        centre = np.array([self.x, self.y])
        if camera.focal is None:
            across = (camera.plane(x, y) - camera.plane(*centre)) / self.r
            square = 1.0 - (across**2).sum(-1)
            up = np.sqrt(np.maximum(square, 0.0))
            normal = np.concatenate([across, up[..., None]], axis=-1)
        else:
            # in units of the radius: the centre is 1/sin α away, α the angular radius of the outline
            towards = camera.view(*centre)
            middle = -towards * math.hypot(1.0, camera.focal / self.r)
            along = -(view @ middle)
            square = along**2 - (middle @ middle - 1.0)
            near = along - np.sqrt(np.maximum(square, 0.0))
            normal = -near[..., None] * view - middle
        return Surface(normal, view, self.size * normal, square > 0.0)
