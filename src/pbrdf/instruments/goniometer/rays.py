"""Directions of source and camera as vectors, and the angles of a geometry from them.

Vectors point away from the surface; angles are those of :mod:`pbrdf.optics.geometry`.
"""

from __future__ import annotations

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.optics.geometry import geometry_from_angles

__all__ = ["angles_of", "between", "ray_vectors"]


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
    """Angle between unit vectors, accurate when it is small; shape (G,)."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def angles_of(
    normal: np.ndarray, source: np.ndarray, camera: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θ_i, θ_r, φ from unit vectors away from the surface, shape (G, 3) each; φ within [0, 2π)."""

    def across(ray: np.ndarray) -> np.ndarray:
        return ray - np.einsum("gk,gk->g", ray, normal)[:, None] * normal

    forward = -across(source)
    # under normal incidence every direction is forward: that of the camera
    upright = np.linalg.norm(forward, axis=1) < 1e-12
    forward[upright] = across(camera)[upright]
    left = np.cross(normal, forward)
    phi = np.arctan2(np.einsum("gk,gk->g", camera, left), np.einsum("gk,gk->g", camera, forward))
    phi = np.where(np.abs(phi) < 1e-12, 0.0, phi)
    return between(normal, source), between(normal, camera), np.mod(phi, 2.0 * np.pi)
