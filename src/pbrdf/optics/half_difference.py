"""Half and difference angles, and the polarisation frame that tables over them use.

S. Rusinkiewicz, "A new change of variables for efficient BRDF representation" (Eurographics Workshop on
Rendering, 1998). With i towards the source and o towards the viewer, h = (i + o)/|i + o| is the half vector,
``theta_h`` its angle from the surface normal ẑ and ``theta_d`` half the angle between i and o. ``phi_d`` turns i
about h, counted anticlockwise (seen from the tip of h) from the direction in which ``theta_h`` grows:

    i = cosθ_d h + sinθ_d d,  o = cosθ_d h − sinθ_d d,  d = cosφ_d t + sinφ_d b,  b = ẑ×h/|ẑ×h|,  t = b×h.

So ``phi_d`` = 0 is the plane of incidence with i closer to the surface than o, exchanging i and o adds π, and
−``phi_d`` is the mirror image. The azimuth of h is left out: the surfaces are isotropic. Angles are in radians.

This is about tables, over NumPy arrays: unlike the model's formulas it is not traced into a kernel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.optics.angles import within_half_turn

__all__ = ["directions", "facet_tilt", "from_scattering_plane", "half_difference", "to_scattering_plane"]

Array = NDArray[np.float64]


def directions(theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike) -> tuple[Array, Array, Array]:
    """Zenith angles of source and viewer and relative azimuth, φ = 0 forward.

    Parameters
    ----------
    theta_h, theta_d, phi_d
        Half and difference angles; they broadcast.

    Returns
    -------
    theta_i, theta_r, phi
        Zenith angles in [0, π]: above π/2 a direction lies below the surface.
    """
    theta_i, azimuth_i, theta_r, azimuth_r = _spherical(theta_h, theta_d, phi_d)
    # Both directions point away from the surface, so forward is where the azimuths differ by π.
    return theta_i, theta_r, within_half_turn(azimuth_r - azimuth_i - np.pi)


def half_difference(theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> tuple[Array, Array, Array]:
    """Inverse of :func:`directions`; ``phi_d`` in [−π, π], one of its values where all mean the same."""
    theta_i, theta_r, phi = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64) for x in (theta_i, theta_r, phi))
    )
    i = np.stack([-np.sin(theta_i), np.zeros_like(theta_i), np.cos(theta_i)])
    o = np.stack([np.sin(theta_r) * np.cos(phi), np.sin(theta_r) * np.sin(phi), np.cos(theta_r)])
    h, d = i + o, i - o
    azimuth = np.arctan2(h[1], h[0])
    theta_h = np.arctan2(np.hypot(h[0], h[1]), h[2])
    along = np.cos(theta_h) * (np.cos(azimuth) * d[0] + np.sin(azimuth) * d[1]) - np.sin(theta_h) * d[2]
    across = np.cos(azimuth) * d[1] - np.sin(azimuth) * d[0]
    theta_d = np.arctan2(np.linalg.norm(d, axis=0), np.linalg.norm(h, axis=0))
    return theta_h, theta_d, np.arctan2(across, along)


def to_scattering_plane(
    mueller: ArrayLike, theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> NDArray[Any]:
    """Mueller matrices from the surface's frames (p, s) to those of the scattering plane.

    In the new frames s = ±i×o/|i×o| is normal to the plane of both rays and the same for both, p lies in the
    plane, and again p×s = k. This is the frame of the facet that mirrors i into o. At θ_d = 0, where i×o
    vanishes, it is the limit along ``phi_d``.

    Parameters
    ----------
    mueller
        Shape (..., 4, 4), the project's convention.
    theta_h, theta_d, phi_d
        Shape (...).
    """
    turn_i, turn_r = _turns(theta_h, theta_d, phi_d)
    return _turned(np.asarray(mueller), turn_i, turn_r, 1.0)


def from_scattering_plane(
    mueller: ArrayLike, theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> NDArray[Any]:
    """Inverse of :func:`to_scattering_plane`."""
    turn_i, turn_r = _turns(theta_h, theta_d, phi_d)
    return _turned(np.asarray(mueller), turn_i, turn_r, -1.0)


def _spherical(theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Zenith angle and azimuth of i, then of o, with h at azimuth 0."""
    theta_h, theta_d, phi_d = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64) for x in (theta_h, theta_d, phi_d))
    )
    x_h, z_h = np.sin(theta_h) * np.cos(theta_d), np.cos(theta_h) * np.cos(theta_d)
    x_d = np.cos(theta_h) * np.cos(phi_d) * np.sin(theta_d)
    y_d = np.sin(phi_d) * np.sin(theta_d)
    z_d = -np.sin(theta_h) * np.cos(phi_d) * np.sin(theta_d)
    angles = []
    for sign in (1.0, -1.0):
        x, y, z = x_h + sign * x_d, sign * y_d, z_h + sign * z_d
        angles += [np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)]
    return angles[0], angles[1], angles[2], angles[3]


def _turns(theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike) -> list[tuple[Array, Array]]:
    """cos2χ and sin2χ of the turn from the surface's frame to the scattering plane's, for i and for o."""
    theta_i, azimuth_i, theta_r, azimuth_r = _spherical(theta_h, theta_d, phi_d)
    theta_h, phi_d = np.asarray(theta_h), np.asarray(phi_d)
    # h×d, the normal of the scattering plane, whatever the size of θ_d.
    normal = (-np.sin(phi_d) * np.cos(theta_h), np.cos(phi_d), np.sin(phi_d) * np.sin(theta_h))
    turns = []
    for theta, azimuth, along_k in ((theta_i, azimuth_i, -1.0), (theta_r, azimuth_r, 1.0)):
        # k = along_k (sinθ cosα, sinθ sinα, cosθ); s = k×ẑ/|k×ẑ| and p = s×k are defined for θ = 0, too.
        s = (along_k * np.sin(azimuth), -along_k * np.cos(azimuth), 0.0)
        p = (-np.cos(theta) * np.cos(azimuth), -np.cos(theta) * np.sin(azimuth), np.sin(theta))
        # s' = cosχ s − sinχ p
        cosine = sum(a * b for a, b in zip(normal, s, strict=True))
        sine = -sum(a * b for a, b in zip(normal, p, strict=True))
        turns.append((cosine * cosine - sine * sine, 2.0 * cosine * sine))
    return turns


def _turned(
    mueller: NDArray[Any], turn_i: tuple[Array, Array], turn_r: tuple[Array, Array], sense: float
) -> NDArray[Any]:
    shape = np.broadcast_shapes(mueller.shape, (*turn_i[0].shape, 4, 4))
    turned = np.array(np.broadcast_to(mueller, shape), dtype=np.result_type(mueller, np.float64))
    for rows, (cosine, sine) in ((turned, turn_r), (turned.swapaxes(-1, -2), turn_i)):
        c, s = cosine[..., np.newaxis], sense * sine[..., np.newaxis]
        rows[..., 1, :], rows[..., 2, :] = (
            c * rows[..., 1, :] + s * rows[..., 2, :],
            c * rows[..., 2, :] - s * rows[..., 1, :],
        )
    return turned


def facet_tilt(theta_i: Array, theta_r: Array, phi: Array) -> Array:
    """Tilt of the facet that mirrors source into viewer, θ_h of :func:`half_difference`, radians; same shape."""
    sin_i, sin_r = np.sin(theta_i), np.sin(theta_r)
    across = np.hypot(sin_r * np.cos(phi) - sin_i, sin_r * np.sin(phi))
    found: Array = np.arctan2(across, np.cos(theta_i) + np.cos(theta_r))
    return found
