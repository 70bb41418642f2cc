"""Directions of source and camera as vectors, and the angles of a geometry from them.

Vectors point away from the surface; angles are those of :mod:`pbrdf.optics.geometry`.
"""

from __future__ import annotations

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.optics.angles import within_turn
from pbrdf.optics.geometry import geometry_from_angles

__all__ = ["UPRIGHT", "across", "angles_of", "between", "ray_vectors"]

#: A ray whose part across the normal is shorter runs along the normal: its azimuth is not known.
UPRIGHT = 1e-12


def ray_vectors(theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray) -> dict[str, np.ndarray]:
    """The vectors of :class:`~pbrdf.optics.geometry.Geometry` by name, shape (G, 3) each."""
    backend = get_backend()
    geometry = geometry_from_angles(*(backend.upload(backend.Float, a) for a in (theta_i, theta_r, phi)))
    size = len(theta_i)
    found = {}
    for name in ("omega_i", "omega_r", "p_i", "s_i", "p_r", "s_r"):
        vector = [np.broadcast_to(backend.Float(c).numpy(), size) for c in getattr(geometry, name)]
        found[name] = np.stack(vector, axis=-1)
    return found


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between unit vectors, accurate when it is small; shape (...)."""
    values: np.ndarray = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return values


def across(ray: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The part of vectors at right angles to unit vectors, shape (..., 3)."""
    values: np.ndarray = ray - (ray * normal).sum(-1, keepdims=True) * normal
    return values


def angles_of(
    normal: np.ndarray, source: np.ndarray, camera: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θ_i, θ_r, φ from unit vectors away from the surface, shapes (..., 3) that broadcast; φ within [0, 2π).

    Seen or lit along the normal φ is 0.
    """
    seen = across(camera, normal)
    forward = -across(source, normal)
    # under normal incidence every direction is forward: that of the camera
    forward = np.where(np.linalg.norm(forward, axis=-1, keepdims=True) < UPRIGHT, seen, forward)
    left = np.cross(normal, forward)
    phi = np.arctan2((camera * left).sum(-1), (camera * forward).sum(-1))
    none = (np.abs(phi) < 1e-12) | (np.linalg.norm(seen, axis=-1) < UPRIGHT)
    return between(normal, source), between(normal, camera), within_turn(np.where(none, 0.0, phi))
