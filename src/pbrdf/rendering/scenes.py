"""Scenes of the project's own: spheres on a ground plate, tilted panels, a piece of a car. Metres, z up.

The camera looks in the direction +y, so that the azimuth of a light is 0° on the right of the picture, 90° behind the
object and 270° behind the camera.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.rendering.lights import light_dict
from pbrdf.rendering.polarized_lamp import LampPolarization
from pbrdf.rendering.sky import Sky, direction_of

__all__ = ["SCENES", "Camera", "Subject", "load_scene_file", "make_scene", "subject"]

#: Reflectance of the ground, and its radius in extents of the subject: its edge passes for the horizon.
_GROUND, _GROUND_EXTENTS = 0.2, 2000.0
_RADIUS, _SPACING = 0.5, 1.25
#: Field of view across the pictures of spheres and panels.
_VIEW = math.radians(30.0)
#: Elevation of a panel's normal and zenith angle of the camera: seen at 42°, reflections are well polarised.
_PANEL_ELEVATION, _PANEL_VIEW = math.radians(60.0), math.radians(72.0)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes
    ----------
    origin, target
        Where it stands and what is in the middle of its picture.
    field_of_view
        Across the width of the picture, radians.
    """

    origin: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float

    def to_dict(self, width: int, height: int) -> dict[str, Any]:
        """Entry of a Mitsuba scene. A box filter keeps the pixels' errors independent of each other."""
        import mitsuba as mi

        return {
            "type": "perspective",
            "fov": math.degrees(self.field_of_view),
            "fov_axis": "x",
            "to_world": mi.ScalarTransform4f().look_at(list(self.origin), list(self.target), [0.0, 0.0, 1.0]),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "luminance",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        }


@dataclass(frozen=True)
class Subject:
    """What is to be painted and lit.

    Attributes
    ----------
    entries
        Shapes by name, as entries of a Mitsuba scene.
    camera
        A camera that shows it well in a picture of the aspect `aspect` (width over height).
    centre, extent
        Middle and radius of what is painted.
    light
        Zenith angle and azimuth of a light that suits it, radians.
    """

    entries: dict[str, Any] = field(repr=False)
    camera: Camera
    centre: tuple[float, float, float]
    extent: float
    light: tuple[float, float]


def _diffuse(reflectance: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}}


def _ground(extent: float) -> dict[str, Any]:
    import mitsuba as mi

    place = mi.ScalarTransform4f().scale(_GROUND_EXTENTS * extent)
    return {"type": "disk", "to_world": place, "bsdf": _diffuse(_GROUND)}


def _framed(
    direction: tuple[float, float], width: float, tall: float, middle: float, aspect: float
) -> Camera:
    """A camera in the direction (zenith, azimuth) that sees `width` × `tall` about a point on the z axis."""
    across = max(width, tall * aspect)
    distance = 0.5 * across / math.tan(0.5 * _VIEW)
    x, y, z = (distance * component for component in direction_of(*direction))
    return Camera((x, y, z + middle), (0.0, 0.0, middle), _VIEW)


def _row(count: int) -> list[float]:
    """x of `count` objects side by side."""
    return [_SPACING * (i - 0.5 * (count - 1)) for i in range(count)]


def _spheres(bsdfs: Sequence[Any], aspect: float) -> Subject:
    entries = {
        f"sphere{i + 1}": {"type": "sphere", "center": [x, 0.0, _RADIUS], "radius": _RADIUS, "bsdf": bsdf}
        for i, (x, bsdf) in enumerate(zip(_row(len(bsdfs)), bsdfs, strict=True))
    }
    across = _SPACING * len(bsdfs) + 0.3
    extent = 0.5 * across
    # the horizon is in the picture, near its upper edge
    pitch = min(math.radians(12.0), 0.7 * math.atan(math.tan(0.5 * _VIEW) / aspect))
    camera = _framed((0.5 * math.pi - pitch, math.radians(270.0)), across, 1.55, 0.46, aspect)
    return Subject(
        {**entries, "ground": _ground(extent)},
        camera,
        (0.0, 0.0, _RADIUS),
        extent,
        (math.radians(45.0), math.radians(235.0)),
    )


def _panels(bsdfs: Sequence[Any], aspect: float) -> Subject:
    import mitsuba as mi

    half = 0.5
    upright = half * math.cos(_PANEL_ELEVATION)
    tilt = math.degrees(0.5 * math.pi - _PANEL_ELEVATION)
    entries = {}
    for i, (x, bsdf) in enumerate(zip(_row(len(bsdfs)), bsdfs, strict=True)):
        place = mi.ScalarTransform4f().translate([x, 0.0, upright + 0.02])
        # the rectangle's normal is z: it is turned towards −y
        place = (
            place @ mi.ScalarTransform4f().rotate([1.0, 0.0, 0.0], tilt) @ mi.ScalarTransform4f().scale(half)
        )
        entries[f"panel{i + 1}"] = {"type": "rectangle", "to_world": place, "bsdf": bsdf}
    across = _SPACING * len(bsdfs) + 0.3
    extent = 0.5 * across
    # the panels mirror a lamp there, beyond the zenith, into the camera
    lamp = 2.0 * _PANEL_ELEVATION + _PANEL_VIEW - math.pi
    return Subject(
        {**entries, "ground": _ground(extent)},
        _framed((_PANEL_VIEW, math.radians(270.0)), across, 1.25, 0.25, aspect),
        (0.0, 0.0, upright),
        extent,
        (lamp, math.radians(90.0)),
    )


def _fender(bsdfs: Sequence[Any], aspect: float) -> Subject:
    import mitsuba as mi

    from pbrdf.rendering.meshes import WHEEL_CENTRE, WHEEL_RADIUS, body_panel, hills

    x, z = WHEEL_CENTRE
    upright = mi.ScalarTransform4f().rotate([1.0, 0.0, 0.0], 90.0)

    def disc(y: float, radius: float) -> Any:
        return mi.ScalarTransform4f().translate([x, y, z]) @ upright @ mi.ScalarTransform4f().scale(radius)

    inside = mi.ScalarTransform4f().translate([0.0, 0.8, 0.42]) @ mi.ScalarTransform4f().scale(
        [1.9, 0.55, 0.2]
    )
    panel = body_panel()
    parts = panel.split_along_x(len(bsdfs), -2.0, 1.6)
    entries: dict[str, Any] = {
        f"body{i + 1}": part.to_mitsuba(f"body{i + 1}", mi.load_dict(bsdf))
        for i, (part, bsdf) in enumerate(zip(parts, bsdfs, strict=True))
    }
    entries |= {
        "tyre": {
            "type": "cylinder",
            "p0": [x, 0.05, z],
            "p1": [x, 0.4, z],
            "radius": WHEEL_RADIUS,
            "bsdf": {"type": "twosided", "bsdf": _diffuse(0.03)},
        },
        "tyre_side": {"type": "disk", "to_world": disc(0.055, WHEEL_RADIUS), "bsdf": _diffuse(0.035)},
        "hub": {"type": "disk", "to_world": disc(0.045, 0.19), "bsdf": _diffuse(0.25)},
        "interior": {
            "type": "cube",
            "to_world": inside,
            "bsdf": _diffuse(0.02),
        },
        "ground": {"type": "disk", "to_world": mi.ScalarTransform4f().scale(100.0), "bsdf": _diffuse(0.12)},
        "hills": hills().to_mitsuba("hills", mi.load_dict(_diffuse(0.08))),
    }
    camera = Camera((-2.9, -3.1, 1.12), (-0.12, 0.3, 0.6), math.radians(31.0))
    return Subject(entries, camera, (0.0, 0.0, 0.5), 2.0, (math.radians(50.0), math.radians(215.0)))


#: Name → function from the coats of paint (entries of Mitsuba scenes) and the picture's aspect to the subject.
SCENES: dict[str, Callable[[Sequence[Any], float], Subject]] = {
    "sphere": _spheres,
    "plate": _panels,
    "fender": _fender,
}
#: More objects than this in a row are too small to be looked at.
_MOST_OBJECTS = 12


def subject(name: str, bsdfs: Sequence[Any], aspect: float = 1.0) -> Subject:
    """One of :data:`SCENES`, painted.

    Parameters
    ----------
    name
        ``sphere``, ``plate`` or ``fender``.
    bsdfs
        Coats of paint as entries of a Mitsuba scene: one object (on the fender: one piece of the body) for each.
    aspect
        Width of the picture over its height.

    Raises
    ------
    PbrdfError
        If there is no such scene, no coat, or there are more coats than the scene has room for.
    """
    if name not in SCENES:
        hint = "; it shows a fender, and is called so" if name == "car" else ""
        raise PbrdfError(
            f"scene {name!r}: choose {', '.join(SCENES)}, or give a Mitsuba scene FILE.xml{hint}"
        )
    if not 1 <= len(bsdfs) <= _MOST_OBJECTS:
        raise PbrdfError(f"the scene {name} takes 1 to {_MOST_OBJECTS} models, not {len(bsdfs)}")
    return SCENES[name](bsdfs, aspect)


def make_scene(
    what: Subject,
    light: str,
    size: tuple[int, int],
    *,
    direction: tuple[float, float] | None = None,
    sky: Sky | None = None,
    polarization: LampPolarization | None = None,
) -> Any:
    """A Mitsuba scene from a subject and a light.

    Parameters
    ----------
    what
        See :func:`subject`.
    light
        See :func:`pbrdf.rendering.lights.light_dict`.
    size
        Width and height of the picture, pixels.
    direction
        Zenith angle and azimuth of the light, radians; that of the subject by default.
    sky
        The sky for the light ``sky``, sun included; `direction` is not looked at then.
    polarization
        What stands before a lamp, ``point`` or ``area``.
    """
    import mitsuba as mi

    zenith, azimuth = direction or what.light
    lamp = light_dict(
        light,
        zenith=zenith,
        azimuth=azimuth,
        centre=what.centre,
        extent=what.extent,
        sky=sky,
        polarization=polarization,
    )
    return mi.load_dict(
        {"type": "scene", "sensor": what.camera.to_dict(*size), **what.entries, "light": lamp}
    )


def load_scene_file(path: Path, bsdfs: Sequence[Any], size: tuple[int, int] | None = None) -> Any:
    """A Mitsuba scene from an XML file, with coats of paint put where it names them.

    The file's BSDFs with the ids ``paint``, or ``paint1``, ``paint2`` …, stand for the coats; whatever they were is
    replaced.

    Parameters
    ----------
    path
        The file.
    bsdfs
        Coats of paint as entries of a Mitsuba scene.
    size
        Width and height of the picture; the file's own by default.

    Raises
    ------
    PbrdfError
        If the file cannot be understood, has no camera, or does not name as many coats as there are.
    """
    import mitsuba as mi

    config = mi.parser.ParserConfig(mi.variant())
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.prepend(str(path.resolve().parent))
    mi.set_file_resolver(resolver)
    try:
        state = mi.parser.parse_file(config, str(path))
        _paint_nodes(state, path, bsdfs)
        _size_film(state, path, size)
        mi.parser.transform_all(config, state)
        scene = mi.parser.instantiate(config, state)
    except PbrdfError:
        raise
    except RuntimeError as error:
        # of a plug-in of ours it shows a traceback, whose end is what we said
        ours = _one_line(error).rpartition("PbrdfError: ")[2]
        raise PbrdfError(f"{path}: Mitsuba cannot read this scene: {ours}") from error
    finally:
        mi.set_file_resolver(before)
    return scene[0] if isinstance(scene, list) else scene


def _paint_nodes(state: Any, path: Path, bsdfs: Sequence[Any]) -> None:
    """Put coats of paint in the place of the BSDFs called ``paint…``."""
    import mitsuba as mi

    places = {}
    for i, node in enumerate(state.nodes):
        name = node.props.id()
        if node.type == mi.ObjectType.BSDF and re.fullmatch(r"paint\d*", name):
            places[int(name.removeprefix("paint") or 1)] = i
    if len(places) != len(bsdfs):
        named = ", ".join(state.nodes[i].props.id() for _, i in sorted(places.items())) or "none"
        raise PbrdfError(
            f'{path}: {len(bsdfs)} models for the BSDFs of this scene that ask for one (id="paint", or "paint1", '
            f'"paint2", …): {named}'
        )
    for (_, i), bsdf in zip(sorted(places.items()), bsdfs, strict=True):
        props = mi.Properties(bsdf["type"])
        props.set_id(state.nodes[i].props.id())
        for key, value in bsdf.items():
            if key != "type":
                props[key] = mi.load_dict(value) if isinstance(value, dict) else value
        state.nodes[i].props = props


def _size_film(state: Any, path: Path, size: tuple[int, int] | None) -> None:
    import mitsuba as mi

    films = [node for node in state.nodes if node.type == mi.ObjectType.Film]
    if not any(node.type == mi.ObjectType.Sensor for node in state.nodes):
        raise PbrdfError(f"{path}: this scene has no camera (<sensor>)")
    if size is not None:
        if not films:
            raise PbrdfError(f"{path}: the camera of this scene has no <film> to give the size to")
        # of every sensor: the first is the one that is rendered, and a batch gives its cameras their shares
        for film in films:
            film.props["width"], film.props["height"] = size


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
