"""A flat sample: the angles of its middle, and what the perspective of the camera makes of them elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.geometry import (
    LitSurface,
    PixelGeometry,
    Surface,
    centres,
    lit_angles,
    require_series,
)
from pbrdf.optics.angles import within_half_turn

__all__ = ["Panel"]

#: Coordinates of ``pbrdf reduce`` (degrees) that say what is left open.
_ANGLES = ("theta_i", "theta_r", "phi", "reference_angle")
#: Angles that differ by no more are the same, radians.
_SAME = 1e-4


@dataclass(frozen=True)
class Panel(PixelGeometry):
    """A flat sample at given angles.

    Angles are single numbers or one for each series, radians; those left out are the coordinates of the Stokes
    pictures, which ``pbrdf reduce --angles`` writes. Where pictures have them, others are refused.

    Attributes
    ----------
    theta_i, theta_r, phi
        At the place `at`.
    reference_angle
        From the surface's p direction to the camera's x axis there, from p towards s, as in tables of angles and
        instruments: 90° where x lies along s. If neither table nor instrument says it, the pictures' attribute counts.
    at
        Where in the picture the angles hold, pixels (x, y); where the optical axis meets it by default, its middle.
    camera
        Orthographic by default: then the angles hold everywhere, but for a lamp that is near.
    distance
        Of the camera from the place `at`.
    pixel
        Size of a pixel on a surface across the line of sight there; follows from `distance` and focal length.
    lamp_distance
        Of the lamp from the place `at`, in the unit of `distance` or `pixel`; infinite by default.
    """

    theta_i: float | Sequence[float] | None = None
    theta_r: float | Sequence[float] | None = None
    phi: float | Sequence[float] | None = None
    reference_angle: float | Sequence[float] | None = None
    at: tuple[float, float] | None = None
    camera: PixelCamera = PixelCamera()  # noqa: RUF009  frozen
    distance: float | None = None
    pixel: float | None = None
    lamp_distance: float = math.inf

    def __post_init__(self) -> None:
        if not self.lamp_distance > 0.0:
            raise DataError(f"the lamp's distance is {self.lamp_distance:g}: it must be more than 0")
        for name in ("distance", "pixel"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise DataError(f"a panel's {name} is {value:g}: it must be more than 0")
        if self.distance is not None and self.pixel is not None:
            raise DataError("the size of a pixel follows from the camera's distance: give one of them")

    def located(self, stokes: xr.Dataset) -> Panel:
        camera = self.camera.sized(stokes.sizes["y"], stokes.sizes["x"])
        angles: dict[str, Any] = {name: self._angle(name, stokes) for name in _ANGLES}
        count = max(map(len, angles.values()))
        for values in angles.values():
            if len(values) not in (1, count):
                raise DataError(
                    f"a panel's angles are {', '.join(f'{len(v)} of {n}' for n, v in angles.items())}: "
                    "give one of each, or one for each series"
                )
        require_series(count, stokes, "angles of the panel")
        return replace(self, **angles, camera=camera, at=self.at or camera.centre)

    def _angle(self, name: str, stokes: xr.Dataset) -> tuple[float, ...]:
        own = getattr(self, name)
        if own is None:
            if name in stokes.coords:
                own = np.deg2rad(np.atleast_1d(stokes[name].values))
            elif name == "reference_angle" and "reference_angle_degree" in stokes.attrs:
                own = math.radians(float(stokes.attrs["reference_angle_degree"]))
            else:
                raise DataError(
                    f"the panel's {name} is not known: state it, or reduce the frames with a table of angles"
                )
        elif name in stokes.coords:
            _require_same(name, np.atleast_1d(np.asarray(own, float)), np.deg2rad(stokes[name].values))
        values = np.atleast_1d(np.asarray(own, float))
        if not np.isfinite(values).all():
            raise DataError(f"a panel's {name} is not a finite number")
        if name.startswith("theta") and not ((values >= 0.0) & (values < 0.5 * np.pi)).all():
            raise DataError(f"a panel's {name} is from 0 to less than 90 degrees")
        # one geometry for all series stays one
        return tuple(values[:1] if np.ptp(values) == 0.0 else values)

    def _poses(self) -> list[tuple[float, ...]]:
        angles = [getattr(self, name) for name in _ANGLES]
        if self.at is None or any(not isinstance(values, tuple) for values in angles):
            raise DataError("the panel has not been located in the pictures yet")
        count = max(map(len, angles))
        return list(zip(*(values * (count // len(values)) for values in angles), strict=True))

    def pixels(self, x: np.ndarray, y: np.ndarray) -> xr.Dataset:
        about = {
            "kind": "flat",
            "camera": str(self.camera),
            "at_x": self._at[0],
            "at_y": self._at[1],
            **{
                f"{name}_degree": [round(math.degrees(value), 9) for value in values]
                for name, values in zip(_ANGLES, zip(*self._poses(), strict=True), strict=True)
            },
        }
        if math.isfinite(self.lamp_distance):
            about["lamp_distance"] = self.lamp_distance
        return lit_angles(self._series(*centres(x, y)), x, y, 0.5 * math.pi, about)

    @property
    def _at(self) -> tuple[float, float]:
        if self.at is None:
            raise DataError("the panel has not been located in the pictures yet")
        return self.at

    def _series(self, x: np.ndarray, y: np.ndarray) -> Iterator[LitSurface]:
        view = self.camera.view(x, y)
        middle = self.camera.view(*(np.array(place) for place in self._at))
        for theta_i, theta_r, phi, reference in self._poses():
            normal, source = _placed(middle, theta_i, theta_r, phi, -reference)
            far = math.isinf(self.lamp_distance)
            # a far lamp does not ask where a point is
            point = np.zeros(3) if far else self._points(x, y, view, middle, normal)
            facing = (view * normal).sum(-1) > 0.0
            yield LitSurface(Surface(normal, view, point, facing), Lamp.towards(source, self.lamp_distance))

    def _points(
        self, x: np.ndarray, y: np.ndarray, view: np.ndarray, middle: np.ndarray, normal: np.ndarray
    ) -> np.ndarray:
        """Where the lines of sight meet the panel, from the place `at`."""
        camera = self.camera
        if camera.focal is None:
            if self.pixel is None:
                raise DataError("a near lamp before an orthographic camera asks for the size of a pixel")
            ahead = self.pixel * (camera.plane(x, y) - camera.plane(*map(np.array, self._at)))
            depth = -(ahead * normal[:2]).sum(-1, keepdims=True) / normal[2]
            return np.concatenate([ahead, depth], axis=-1)
        distance = self.distance
        if distance is None:
            if self.pixel is None:
                raise DataError(
                    "a near lamp asks for the camera's distance from the panel, or the size of a pixel"
                )
            distance = self.pixel * camera.focal / float(middle[2])
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (middle @ normal) / (view * normal).sum(-1, keepdims=True)
        values: np.ndarray = distance * (middle - along * view)
        return values


def _placed(
    view: np.ndarray, theta_i: float, theta_r: float, phi: float, rotation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Normal and direction of the source, in the camera's axes, of a geometry seen along −`view`.

    With k = `view`, p from the pixel's axes, s = k×p: the normal is cosθ_r k + sinθ_r p, the tangent below the ray is
    e = sinθ_r k − cosθ_r p, which lies at the azimuth φ from the forward direction; the tangent 90° further is −s.
    """
    right = np.cross([0.0, 1.0, 0.0], view)
    right /= np.linalg.norm(right)
    p = math.cos(rotation) * right + math.sin(rotation) * np.cross(view, right)
    s = np.cross(view, p)
    normal = math.cos(theta_r) * view + math.sin(theta_r) * p
    tangent = math.sin(theta_r) * view - math.cos(theta_r) * p
    forward = math.cos(phi) * tangent + math.sin(phi) * s
    return normal, math.cos(theta_i) * normal - math.sin(theta_i) * forward


def _require_same(name: str, stated: np.ndarray, carried: np.ndarray) -> None:
    """Raise if an angle is stated that the pictures have, and otherwise."""
    if stated.size in (1, carried.size):
        off = within_half_turn(stated - carried)
        # NaN is not known
        if not (np.abs(off) > _SAME).any():
            return
    theirs, ours = (
        " … ".join(f"{angle:g}°" for angle in np.unique(np.round(np.rad2deg([v.min(), v.max()]), 3)))
        for v in (carried[np.isfinite(carried)], stated)
    )
    raise DataError(
        f"the pictures say themselves that {name} is {theirs}, and {ours} is stated: leave {name} out, or reduce the "
        "frames with another table of angles"
    )
