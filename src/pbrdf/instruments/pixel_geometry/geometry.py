"""What every geometry of pixels has in common: where it is put, and how angles and axes follow from vectors.

The axes of a pixel are those of :mod:`pbrdf.rendering.picture` and of the instruments: about its line of sight, x lies
across it, horizontal in the camera's frame, to the right of the picture; y is up; the light travels into the camera
along k = x × y. The surface's p direction there is that of docs/conventions.md, s = k×n/|k×n|, p = s×k: the normal's
part across the ray. ``rotation`` counts from x to p, from x towards y, counterclockwise as the picture is seen:
Stokes vectors of the pixel's axes become those of (p, s) by ``rotate_frame(rotation)``, and the `reference_angle` of
instruments and tables of angles is −rotation.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pbrdf.data.schema import DIMENSION
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.rays import UPRIGHT, across, angles_of
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera

__all__ = [
    "MAX_ZENITH",
    "CurvedSample",
    "LitSurface",
    "PixelGeometry",
    "Surface",
    "lit_angles",
    "pixel_coordinates",
    "plane_rotation",
]

#: Zenith angles from which on a curved sample's pixels see too much of the surface at once to be used, radians.
MAX_ZENITH = math.radians(80.0)

_WORDS = {
    "theta_i": ("rad", "zenith angle of the source"),
    "theta_r": ("rad", "zenith angle of the camera"),
    "phi": ("rad", "relative azimuth, 0 forward"),
    "rotation": ("rad", "angle from the pixel's x axis to the surface's p direction, counterclockwise"),
    "irradiance": ("1", "irradiance across the beam, in parts of that in the middle of the sample"),
    "mask": ("1", "on the sample, lit and seen"),
}


class Surface(NamedTuple):
    """What pixels see, in the camera's axes; shapes (rows, columns, 3), or (3,) where all pixels have the same.

    Attributes
    ----------
    normal, view
        Unit vectors; `view` points towards the camera.
    point
        Place from the middle of the sample, in the unit of a lamp's distance.
    seen
        Whether the pixel sees the sample, shape (rows, columns) or ().
    """

    normal: np.ndarray
    view: np.ndarray
    point: np.ndarray
    seen: np.ndarray


class LitSurface(NamedTuple):
    """A surface with a lamp, for one series."""

    surface: Surface
    lamp: Lamp


class PixelGeometry(ABC):
    """Directions of source and camera at every pixel of a picture.

    A geometry may leave open what a picture tells: its size, where the sample is in it, the angles of its series.
    :meth:`located` fills that in; :meth:`pixels` then needs the coordinates of pixels alone, so that blocks of a large
    picture can be asked for one by one.
    """

    @abstractmethod
    def located(self, stokes: xr.Dataset) -> PixelGeometry:
        """The same with all that Stokes pictures tell of it filled in.

        Parameters
        ----------
        stokes
            The whole pictures, as ``pbrdf reduce`` writes them; numbers are read only where something has to be found
            in a picture, and then S0 and the flags, some rows at a time.

        Raises
        ------
        DataError
            If the pictures do not tell what is needed.
        """

    @abstractmethod
    def pixels(self, x: np.ndarray, y: np.ndarray) -> xr.Dataset:
        """Geometry of some pixels.

        Parameters
        ----------
        x, y
            Columns and rows, counted from 0 from the left and from the top, shapes (columns,) and (rows,).

        Returns
        -------
        xarray.Dataset
            ``theta_i``, ``theta_r``, ``phi``, ``rotation`` (radians; NaN off the sample), ``irradiance`` (of lamps that
            are near, in parts of that in the middle of the sample) and ``mask``, over (``geometry``, ``y``, ``x``) with
            the coordinates `y` and `x`. Without ``geometry`` where all series share one geometry, without ``y`` and
            ``x`` where all pixels do.
        """

    def of(self, stokes: xr.Dataset) -> xr.Dataset:
        """Geometry of all pixels of Stokes pictures; parameters and errors as :meth:`located` has."""
        return self.located(stokes).pixels(*pixel_coordinates(stokes))


@dataclass(frozen=True, kw_only=True)
class CurvedSample(PixelGeometry):
    """A sample of which each pixel sees another direction, under lamps whose directions are known.

    Attributes
    ----------
    lamps
        One for all series, or one for each.
    camera
        Orthographic by default.
    max_zenith
        Pixels with a larger zenith angle of lamp or camera are no longer on the sample, radians: at the rim a pixel
        sees too much of the surface.
    """

    lamps: Sequence[Lamp]
    camera: PixelCamera = PixelCamera()  # noqa: RUF009  frozen
    max_zenith: float = MAX_ZENITH

    def __post_init__(self) -> None:
        if not self.lamps:
            raise DataError("name the direction of the lamp, or one for each series")
        if not 0.0 < self.max_zenith <= 0.5 * math.pi:
            raise DataError(
                f"the largest zenith angle is {math.degrees(self.max_zenith):g}°: give one up to 90"
            )

    def _sized(self, stokes: xr.Dataset) -> PixelCamera:
        """The camera of these pictures; checks that the lamps are those of the series."""
        require_series(len(self.lamps), stokes, "lamps")
        return self.camera.sized(stokes.sizes["y"], stokes.sizes["x"])

    @abstractmethod
    def surface(self, x: np.ndarray, y: np.ndarray) -> Surface:
        """What is seen at places of the picture, shapes that broadcast to (rows, columns)."""

    def _lit(self, surface: Surface) -> Iterator[LitSurface]:
        """The surface with each lamp."""
        return (LitSurface(surface, lamp) for lamp in self.lamps)

    @abstractmethod
    def described(self) -> dict[str, Any]:
        """What it is, in attributes."""

    def pixels(self, x: np.ndarray, y: np.ndarray) -> xr.Dataset:
        series = self._lit(self.surface(*centres(x, y)))
        about = {
            "camera": str(self.camera),
            "lamps": "; ".join(map(str, self.lamps)),
            "max_zenith_degree": round(math.degrees(self.max_zenith), 6),
        }
        return lit_angles(series, x, y, self.max_zenith, {**self.described(), **about})


def pixel_coordinates(stokes: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of Stokes pictures: their coordinates, or counted from 0."""
    found = [
        np.asarray(stokes[name].values if name in stokes.coords else np.arange(stokes.sizes[name]))
        for name in ("x", "y")
    ]
    return found[0], found[1]


def centres(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the centres of pixels, shapes (1, columns) and (rows, 1)."""
    return np.asarray(x, float)[None, :] + 0.5, np.asarray(y, float)[:, None] + 0.5


def require_series(count: int, stokes: xr.Dataset, what: str) -> None:
    """Check that there is one of something for all series, or one for each."""
    series = stokes.sizes.get("series", 1)
    if count not in (1, series):
        raise DataError(f"there are {count} {what} for {series} series: give one for all or one for each")


def lit_angles(
    series: Iterator[LitSurface], x: np.ndarray, y: np.ndarray, max_zenith: float, attrs: dict[str, Any]
) -> xr.Dataset:
    """Angles and axes from vectors; see :meth:`PixelGeometry.pixels` for what is given and returned."""
    found: dict[str, list[np.ndarray]] = {}
    near = False
    for surface, lamp in series:
        source, irradiance = lamp.seen_from(surface.point)
        theta_i, theta_r, phi = angles_of(surface.normal, source, surface.view)
        mask = surface.seen & (theta_i < max_zenith) & (theta_r < max_zenith)
        values = {"theta_i": theta_i, "theta_r": theta_r, "phi": phi}
        values["rotation"] = plane_rotation(surface.normal, surface.view, source)
        values["irradiance"] = np.ones(()) if irradiance is None else irradiance
        near |= irradiance is not None
        for name, value in values.items():
            found.setdefault(name, []).append(np.where(mask, value, np.nan))
        found.setdefault("mask", []).append(mask)
    if not near:
        del found["irradiance"]
    return stacked(found, x, y, attrs)


def plane_rotation(normal: np.ndarray, view: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Angle from the pixels' x axis to the surface's p direction, radians from −π to π.

    Seen along the normal, where every plane is one of reflection, p points to the side of the source, which belongs to
    the φ = 0 that stands there; with the source in the same direction it is the x axis.

    Parameters
    ----------
    normal, view, source
        Unit vectors in the camera's axes, shapes (..., 3) that broadcast.
    """
    p = across(normal, view)
    p = np.where(np.linalg.norm(p, axis=-1, keepdims=True) < UPRIGHT, across(source, view), p)
    # about the ray k = view: x = up × k is level, y = k × x; both are equally long
    up = np.array([0.0, 1.0, 0.0])
    right = np.cross(up, view)
    along, upward = (p * right).sum(-1), (p * np.cross(view, right)).sum(-1)
    return np.where(np.hypot(along, upward) < UPRIGHT, 0.0, np.arctan2(upward, along))


def stacked(
    found: dict[str, list[np.ndarray]], x: np.ndarray, y: np.ndarray, attrs: dict[str, Any]
) -> xr.Dataset:
    """A data set of arrays by name, one a series, of the shapes (rows, columns) or ()."""
    data: dict[str, Any] = {}
    for name, values in found.items():
        units, words = _WORDS[name]
        shared = all(np.ndim(value) == 0 for value in values)
        dims = () if shared else ("y", "x")
        if len(values) == 1:
            array = np.asarray(values[0])
        else:
            array = np.stack([np.broadcast_to(v, () if shared else (len(y), len(x))) for v in values])
            dims = (DIMENSION, *dims)
        if not shared:
            array = np.broadcast_to(array, (*array.shape[:-2], len(y), len(x)))
        data[name] = (dims, array, {"units": units, "long_name": words})
    return xr.Dataset(data, coords={"y": ("y", np.asarray(y)), "x": ("x", np.asarray(x))}, attrs=attrs)
