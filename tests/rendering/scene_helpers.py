"""What the tests of scenes share: a camera's rays and axes written down independently of Mitsuba."""

from __future__ import annotations

import math

import numpy as np

from pbrdf.rendering.scenes import Camera

UP = np.array([0.0, 0.0, 1.0])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def pixel_axes(camera: Camera, columns: int, rows: int):
    """Direction of view, x (across it, to the right in the picture) and y (up) of every pixel's centre.

    Shape (rows, columns, 3) each. x × y points along the light, into the camera.
    """
    forward = unit(np.subtract(camera.target, camera.origin))
    right = unit(np.cross(forward, UP))
    upwards = np.cross(right, forward)
    half = math.tan(0.5 * camera.field_of_view)
    u = (np.arange(columns) + 0.5) / columns * 2.0 - 1.0
    v = (1.0 - (np.arange(rows) + 0.5) / rows * 2.0) * rows / columns
    d = unit(forward + half * (u[None, :, None] * right + v[:, None, None] * upwards))
    x = unit(np.cross(d, upwards))
    return d, x, np.cross(-d, x)


def sees(scene_entries, camera, size=(1, 1), spp=16, depth=4, seed=0):
    """Stokes vectors (4, rows, columns) that a camera sees of a scene given by its entries."""
    import mitsuba as mi

    from pbrdf.rendering.render import render_stokes

    scene = mi.load_dict({"type": "scene", "sensor": camera.to_dict(*size), **scene_entries})
    return render_stokes(scene, spp=spp, depth=depth, seed=seed)
