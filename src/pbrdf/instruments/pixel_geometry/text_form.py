"""The geometry of pixels in words, as the command line takes it: ``KIND[:FILE][,KEY=VALUE…]``.

=============================================== =================================================================
``flat``                                        a panel (:class:`.Panel`): ``theta_i``, ``theta_r``, ``phi``,
                                                ``reference`` (what is left out stands in the pictures), ``x``, ``y``
                                                (where they hold), ``distance`` or ``pixel``, ``lamp`` (distance)
``sphere``                                      a ball (:class:`.Sphere`): ``x``, ``y``, ``r`` (found if left out),
                                                ``light``, ``lamp``, ``size``
``cylinder``                                    :class:`.Cylinder`: ``x``, ``y``, ``r``, ``angle`` (found if left
                                                out), ``tilt``, ``length``, ``light``, ``lamp``, ``size``
``normals:FILE``                                :class:`.NormalMap`: ``light``
``angles:FILE``                                 :class:`.AngleMaps`
``mesh:FILE``                                   :class:`pbrdf.rendering.mesh_geometry.MeshGeometry`: ``camera``,
                                                ``target``, ``up`` (each ``X/Y/Z``), ``light``, ``lamp``, ``smooth``
                                                (yes, no), ``pixel``
=============================================== =================================================================

All but ``angles`` take ``fov`` (degrees across the picture's width) or ``focal`` (pixels), and ``cx``, ``cy`` (where
the optical axis meets the picture); all curved ones ``max`` (the largest zenith angle, 80). Angles are in degrees,
places in pixels from the left and from the top. A light is ``POLAR@AZIMUTH`` seen from the middle of the sample: the
angle from the direction to the camera, and the direction in the picture, 0 on the right, 90 above. Several, one for
each series, are separated by semicolons, and so are several values of a panel's angles and of lamp distances.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import number_from_text
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.cylinder import Cylinder
from pbrdf.instruments.pixel_geometry.geometry import MAX_ZENITH, PixelGeometry
from pbrdf.instruments.pixel_geometry.normal_map import AngleMaps, NormalMap
from pbrdf.instruments.pixel_geometry.panel import Panel
from pbrdf.instruments.pixel_geometry.sphere import Sphere

__all__ = ["GEOMETRY_KINDS", "parse_pixel_geometry"]


class _Options:
    """``KEY=VALUE`` of a text, taken one after another."""

    def __init__(self, kind: str, parts: list[str]) -> None:
        self._kind = kind
        self._values: dict[str, str] = {}
        for part in parts:
            key, sign, value = part.partition("=")
            key = key.strip()
            if not sign or not value.strip():
                raise DataError(f"{kind}: {part!r} is not KEY=VALUE")
            if key in self._values:
                raise DataError(f"{kind}: {key} is given twice")
            self._values[key] = value.strip()
        self._asked: list[str] = []

    def text(self, key: str) -> str | None:
        self._asked.append(key)
        return self._values.pop(key, None)

    def numbers(self, key: str) -> tuple[float, ...] | None:
        """One or several, separated by semicolons."""
        text = self.text(key)
        return None if text is None else tuple(self._number(key, part) for part in text.split(";"))

    def number(self, key: str) -> float | None:
        text = self.text(key)
        return None if text is None else self._number(key, text)

    def angle(self, key: str) -> float | None:
        """In radians."""
        value = self.number(key)
        return None if value is None else math.radians(value)

    def angles(self, key: str) -> tuple[float, ...] | None:
        values = self.numbers(key)
        return None if values is None else tuple(map(math.radians, values))

    def vector(self, key: str) -> tuple[float, float, float] | None:
        """``X/Y/Z``."""
        text = self.text(key)
        if text is None:
            return None
        parts = tuple(self._number(key, part) for part in text.split("/"))
        if len(parts) != 3:
            raise DataError(f"{self._kind}: {key} is {text!r}: give X/Y/Z")
        return parts

    def camera(self) -> PixelCamera:
        x, y = self.number("cx"), self.number("cy")
        if (x is None) != (y is None):
            raise DataError(f"{self._kind}: give cx and cy, or neither")
        centre = None if x is None or y is None else (x, y)
        return PixelCamera(self.number("focal"), self.angle("fov"), centre)

    def curved(self) -> dict[str, Any]:
        """What all curved samples take."""
        text = self.text("light")
        if text is None:
            raise DataError(
                f"{self._kind}: name the direction of the light, light=POLAR@AZIMUTH in degrees: from the direction to "
                "the camera, and from the picture's right counterclockwise"
            )
        distance = self.numbers("lamp") or (math.inf,)
        lights = text.split(";")
        if len(distance) not in (1, len(lights)):
            raise DataError(
                f"{self._kind}: there are {len(distance)} lamp distances for {len(lights)} lights"
            )
        distance *= len(lights) // len(distance)
        lamps = []
        for one, away in zip(lights, distance, strict=True):
            polar, sign, azimuth = one.partition("@")
            angles = [self._number("light", part) for part in (polar, azimuth if sign else "0")]
            lamps.append(Lamp(math.radians(angles[0]), math.radians(angles[1]), away))
        largest = self.angle("max")
        return {
            "lamps": tuple(lamps),
            "camera": self.camera(),
            "max_zenith": MAX_ZENITH if largest is None else largest,
        }

    def _number(self, key: str, text: str) -> float:
        try:
            value = number_from_text(text)
        except (ValueError, OverflowError):
            raise DataError(f"{self._kind}: {key} is {text!r}, not a number") from None
        if not math.isfinite(value):
            raise DataError(f"{self._kind}: {key} is {text!r}: it must be finite")
        return value

    def finish(self) -> None:
        if self._values:
            raise DataError(
                f"{self._kind}: {next(iter(self._values))!r} is not known; it takes {', '.join(self._asked)}"
            )


def _flat(options: _Options, _: str | None) -> PixelGeometry:
    x, y = options.number("x"), options.number("y")
    if (x is None) != (y is None):
        raise DataError("flat: give x and y, or neither")
    lamp = options.number("lamp")
    return Panel(
        options.angles("theta_i"),
        options.angles("theta_r"),
        options.angles("phi"),
        options.angles("reference"),
        None if x is None or y is None else (x, y),
        options.camera(),
        options.number("distance"),
        options.number("pixel"),
        math.inf if lamp is None else lamp,
    )


def _sphere(options: _Options, _: str | None) -> PixelGeometry:
    place: dict[str, Any] = {key: options.number(key) for key in ("x", "y", "r")}
    size = options.number("size")
    return Sphere(**place, size=1.0 if size is None else size, **options.curved())


def _cylinder(options: _Options, _: str | None) -> PixelGeometry:
    place: dict[str, Any] = {key: options.number(key) for key in ("x", "y", "r", "length")}
    place |= {key: options.angle(key) for key in ("angle", "tilt")}
    size = options.number("size")
    return Cylinder(**place, size=1.0 if size is None else size, **options.curved())


def _normals(options: _Options, file: str | None) -> PixelGeometry:
    return NormalMap(normals=Path(_named("normals", file)), **options.curved())


def _angles(_: _Options, file: str | None) -> PixelGeometry:
    return AngleMaps(Path(_named("angles", file)))


def _mesh(options: _Options, file: str | None) -> PixelGeometry:
    # by name alone, for it stands some floors above, with the renderer
    home = importlib.import_module("pbrdf.rendering.mesh_geometry")
    place = {key: options.vector(key) for key in _PLACES}
    smooth = options.text("smooth") or "yes"
    if smooth not in ("yes", "no"):
        raise DataError(f"mesh: smooth is {smooth!r}: give yes or no")
    given = {_PLACES[key]: value for key, value in place.items() if value is not None}
    if "origin" not in given:
        raise DataError("mesh: name the camera's place, camera=X/Y/Z")
    found: PixelGeometry = home.MeshGeometry(
        mesh=Path(_named("mesh", file)),
        smooth=smooth == "yes",
        pixel=options.number("pixel"),
        **given,
        **options.curved(),
    )
    return found


def _named(kind: str, file: str | None) -> str:
    if not file:
        raise DataError(f"{kind}: name the file, {kind}:FILE")
    return file


_KINDS: dict[str, Callable[[_Options, str | None], PixelGeometry]] = {
    "flat": _flat,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "normals": _normals,
    "angles": _angles,
    "mesh": _mesh,
}
GEOMETRY_KINDS = tuple(_KINDS)
_PLACES = {"camera": "origin", "target": "target", "up": "up"}
_WITH_FILE = ("normals", "angles", "mesh")


def parse_pixel_geometry(text: str) -> PixelGeometry:
    """Read a geometry from words; the module's text says how they are put.

    Raises
    ------
    DataError
        Names what is not understood, and what would be.
    """
    kind, _, rest = text.partition(":")
    kind = kind.strip()
    if kind not in _KINDS:
        raise DataError(f"geometry {text!r}: begin with one of {', '.join(GEOMETRY_KINDS)}")
    parts = [part for part in rest.split(",") if part.strip()]
    file = parts.pop(0) if kind in _WITH_FILE and parts and "=" not in parts[0] else None
    options = _Options(kind, parts)
    geometry = _KINDS[kind](options, file)
    options.finish()
    return geometry
