"""A cylinder in the picture: a pipe, or a sheet bent around one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.rays import across
from pbrdf.instruments.pixel_geometry.camera import PixelCamera
from pbrdf.instruments.pixel_geometry.geometry import CurvedSample, Surface
from pbrdf.instruments.pixel_geometry.silhouette import Bar, find_bar

__all__ = ["Cylinder"]


@dataclass(frozen=True, kw_only=True)
class Cylinder(CurvedSample):
    """A cylinder.

    Attributes
    ----------
    x, y
        A place on the axis, pixels; found in the picture, from the two straight edges, if it is left out.
    r
        Half the distance of the edges, pixels; of a camera with perspective what it would be in the middle of the
        picture: the focal length times the tangent of half the angle between the planes through the edges.
    angle
        Of the axis in the picture, radians from the horizontal, counterclockwise. Found with `x`, `y` and `r`.
    tilt
        Of the axis against the picture's plane, radians; positive if the end in the direction `angle` is nearer to the
        camera. Parallel lines of sight do not tell it (0 by default), with perspective it is found with the others.
    length
        Along the axis about (x, y), pixels of the picture; found, or as far as the picture reaches.
    size
        Radius of the cylinder in the unit of the lamps' distances.
    """

    x: float | None = None
    y: float | None = None
    r: float | None = None
    angle: float | None = None
    tilt: float | None = None
    length: float | None = None
    size: float = 1.0
    _found: dict[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [value is not None for value in (self.x, self.y, self.r, self.angle)]
        if any(given) and not all(given):
            raise DataError(
                "a cylinder is given by x, y, r and angle, or found in the picture: give all or none"
            )
        for name in ("r", "length", "size"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise DataError(f"the cylinder's {name} is {value:g}: it must be more than 0")
        if self.tilt is not None and not abs(self.tilt) < 0.5 * math.pi:
            raise DataError(f"the cylinder's tilt is {math.degrees(self.tilt):g}°: it is less than 90")

    def located(self, stokes: xr.Dataset) -> Cylinder:
        camera = self._sized(stokes)
        if self.r is not None:
            return replace(self, camera=camera, tilt=self.tilt or 0.0)
        bar = find_bar(stokes)
        if camera.focal is None:
            x, y, r, angle, tilt = bar.x, bar.y, bar.half_width, bar.angle, self.tilt or 0.0
        else:
            x, y, r, angle, tilt = _from_edges(bar, camera)
        found = {"found": 1, "found_residual_pixels": bar.residual}
        return replace(
            self,
            camera=camera,
            x=x,
            y=y,
            r=r,
            angle=angle,
            tilt=tilt,
            length=self.length or bar.length,
            _found=found,
        )

    def described(self) -> dict[str, Any]:
        about = {"kind": "cylinder", "x": self.x, "y": self.y, "r": self.r, "size": self.size}
        about |= {f"{name}_degree": math.degrees(getattr(self, name) or 0.0) for name in ("angle", "tilt")}
        return {**about, **({} if self.length is None else {"length": self.length}), **self._found}

    def surface(self, x: np.ndarray, y: np.ndarray) -> Surface:
        if self.x is None or self.y is None or self.r is None or self.angle is None:
            raise DataError("the cylinder has not been looked for in the pictures yet")
        camera, tilt = self.camera, self.tilt or 0.0
        view = camera.view(x, y)
        axis = _axis(self.angle, tilt)
        place = np.array([self.x, self.y])
        # in units of the radius, from a point of the axis
        if camera.focal is None:
            start = np.concatenate(
                [
                    (camera.plane(x, y) - camera.plane(*place)) / self.r,
                    np.zeros((*np.broadcast(x, y).shape, 1)),
                ],
                axis=-1,
            )
        else:
            towards = camera.view(*place)
            # the camera is 1/sin α away from the axis
            away = math.hypot(1.0, camera.focal / self.r) / np.linalg.norm(across(towards, axis))
            start = away * towards
        ray, begin = across(-view, axis), across(start, axis)
        a = (ray * ray).sum(-1)
        b = (ray * begin).sum(-1)
        square = b * b - a * ((begin * begin).sum(-1) - 1.0)
        along = (-b - np.sqrt(np.maximum(square, 0.0))) / a
        point = start - along[..., None] * view
        normal = begin + along[..., None] * ray
        seen = square > 0.0
        if self.length is not None:
            ahead = camera.plane(x, y) - camera.plane(*place)
            seen = seen & (
                np.abs(ahead @ np.array([math.cos(self.angle), math.sin(self.angle)])) <= 0.5 * self.length
            )
        return Surface(normal, view, self.size * point, seen)


def _axis(angle: float, tilt: float) -> np.ndarray:
    flat = math.cos(tilt)
    return np.array([flat * math.cos(angle), flat * math.sin(angle), math.sin(tilt)])


def _from_edges(bar: Bar, camera: PixelCamera) -> tuple[float, float, float, float, float]:
    """x, y, r, angle and tilt: the axis lies in both planes that touch the cylinder and run through the camera."""
    inside = camera.view(np.array(bar.x), np.array(bar.y))
    planes = []
    for edge in bar.edges:
        normal = np.cross(*camera.view(*np.array(edge).T))
        planes.append(normal * np.sign(normal @ inside) / np.linalg.norm(normal))
    axis = np.cross(planes[0], planes[1])
    middle = planes[0] - planes[1]
    if np.linalg.norm(axis) < 1e-9:
        raise DataError("the cylinder's edges have no common direction in this perspective")
    axis /= np.linalg.norm(axis)
    if axis[0] < 0.0 or (axis[0] == 0.0 and axis[1] < 0.0):
        axis = -axis
    # half the angle between the planes, whose normals point inwards
    half = math.atan2(np.linalg.norm(planes[0] + planes[1]), np.linalg.norm(middle))
    # of the rays in the plane that halves the angle, the one nearest to the middle of what was found
    ray = across(inside, middle / np.linalg.norm(middle))
    x, y = camera.place(ray / np.linalg.norm(ray))
    focal = camera.focal or math.nan
    return (
        x,
        y,
        focal * math.tan(half),
        math.atan2(axis[1], axis[0]),
        math.asin(max(-1.0, min(1.0, float(axis[2])))),
    )
