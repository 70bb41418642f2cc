"""The cameras of a Mitsuba scene, each with its own axes.

Mitsuba's integrator ``stokes`` refers every ray to the axes of the scene's first sensor, which for a ``batch`` are
those of the batch and of none of its cameras, and leaves the sensor's weight out (an irradiance meter reads 1 for π).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrdf.errors import PbrdfError

__all__ = ["camera_scenes", "groups_of_shapes", "parts_of", "picture_size"]


def picture_size(scene: Any) -> tuple[int, int]:
    """Columns and rows of the picture that a scene's first sensor takes, all cameras of a batch side by side."""
    columns, rows = (int(n) for n in scene.sensors()[0].film().crop_size())
    return columns, rows


def camera_scenes(scene: Any) -> list[Any]:
    """The scene with each camera of its first sensor alone: several for Mitsuba's ``batch``, from left to right.

    Parameters
    ----------
    scene
        A Mitsuba scene in the active variant.

    Raises
    ------
    PbrdfError
        If the scene has no sensor, or its first one is no camera (it weights the light of its rays), or a batch shows a
        part of its picture alone.
    """
    import mitsuba as mi

    if not scene.sensors():
        raise PbrdfError("the scene has no camera (<sensor>)")
    sensor = scene.sensors()[0]
    cameras = parts_of(sensor, mi.Sensor)
    if not cameras:
        _require_camera(sensor)
        return [scene]
    film = sensor.film()
    if tuple(film.crop_size()) != tuple(film.size()):
        raise PbrdfError(
            "a batch of cameras shows its whole picture or none of it: leave the film's crop out"
        )
    shapes = {f"shape{i}": shape for i, shape in enumerate(scene.shapes())}
    groups = {f"group{i}": group for i, group in enumerate(groups_of_shapes(scene))}
    lights = {f"light{i}": lamp for i, lamp in enumerate(scene.emitters()) if lamp.get_shape() is None}
    names = {shape: shape.id() for shape in (*groups.values(), *shapes.values())}
    scenes = []
    for camera in cameras:
        _require_camera(camera)
        # the film of the batch stands for those of its cameras, which keep the size alone
        width, height = (int(n) for n in camera.film().size())
        camera.m_film = mi.load_dict(
            {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "luminance",
                "rfilter": film.rfilter(),
            }
        )
        scenes.append(mi.load_dict({"type": "scene", "camera": camera, **groups, **shapes, **lights}))
        # which have been renamed by the keys above
        for shape, name in names.items():
            shape.set_id(name)
    return scenes


def groups_of_shapes(scene: Any) -> list[Any]:
    """The ``shapegroup``\\ s of a scene, whose instances alone are among its shapes."""
    import mitsuba as mi

    return [shape for shape in parts_of(scene, mi.Shape) if "ShapeGroup" in shape.class_name()]


def parts_of(thing: Any, wanted: Any) -> list[Any]:
    """The objects of a kind that a scene, a ``batch`` of sensors or a group of shapes consists of."""
    import mitsuba as mi

    class Parts(mi.TraversalCallback):
        def __init__(self) -> None:
            super().__init__()
            self.found: list[Any] = []

        def put(self, name: str, thing: Any, flags: int, kind: Any = None) -> None:
            if isinstance(thing, wanted):
                self.found.append(thing)

    parts = Parts()
    thing.traverse(parts)
    return parts.found


def _require_camera(sensor: Any) -> None:
    """Refuse sensors whose rays have another weight than 1, which ``stokes`` leaves out."""
    import drjit as dr
    import mitsuba as mi

    place = mi.Point2f(dr.linspace(mi.Float, 0.05, 0.95, 16), 0.5)
    wavelength = dr.linspace(mi.Float, 0.05, 0.95, 16)
    ray, weight = sensor.sample_ray_differential(0.0, wavelength, place, mi.Point2f(0.5))
    found = np.array(mi.unpolarized_spectrum(weight), dtype=float)
    if mi.is_spectral:
        # the rays' wavelengths are drawn by this density, by which `stokes` divides
        found = found * np.array(mi.pdf_rgb_spectrum(ray.wavelengths), dtype=float)
    if not np.allclose(found, 1.0, rtol=1e-3):
        raise PbrdfError(
            f"the sensor {sensor.class_name()} weights its rays by {found.flat[0]:.6g}, which Mitsuba's Stokes vectors "
            "leave out: give the scene a camera (perspective, thinlens, orthographic, radiancemeter), and no response "
            "of its own (srf)"
        )
