"""From a renderer's directions to the model's geometry, and from the model's Stokes frames to Mitsuba's.

The model refers a Mueller matrix to the (p, s) frames of the surface (docs/conventions.md). Mitsuba refers it to
the implicit axes ``stokes_basis(k)`` of both rays and counts V > 0 right circular; once these axes are turned to
x = s, its matrix is D f D with D = diag(1, −1, −1, −1).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from pbrdf.models.arrays import Matrix
from pbrdf.optics.geometry import Geometry, geometry_from_sines

__all__ = ["LightPath", "light_path", "to_mitsuba"]


class LightPath(NamedTuple):
    """Light that is reflected at a surface.

    Attributes
    ----------
    geometry
        The two rays in the azimuth of the model.
    omega_i, omega_r
        Unit vectors towards the source and along the reflected light, in the renderer's shading frame.
    s_i, s_r
        Their s vectors k×ẑ/|k×ẑ| in the shading frame; these are horizontal, so x and y only.
    """

    geometry: Geometry
    omega_i: Any
    omega_r: Any
    s_i: tuple[Any, Any]
    s_r: tuple[Any, Any]


def light_path(omega_i: Any, omega_r: Any) -> LightPath:
    """Describe light that comes from ``omega_i`` and leaves along ``omega_r``, both above the horizon."""
    sin_i, x_i, y_i = _azimuth(omega_i, -1.0, 0.0)
    # along the normal any azimuth will do: the forward half-plane of ω_i
    sin_r, x_r, y_r = _azimuth(omega_r, -x_i, -y_i)
    sin_phi = dr.fma(y_i, x_r, -x_i * y_r)
    cos_phi = -dr.fma(x_i, x_r, y_i * y_r)
    # near the mirror direction the sum of the rays keeps the digits that the angles lose
    x, y, z = (omega_i[j] + omega_r[j] for j in range(3))
    h = (-dr.fma(x_i, x, y_i * y), dr.fma(y_i, x, -x_i * y), z)
    geometry = geometry_from_sines(sin_i, omega_i[2], sin_r, omega_r[2], sin_phi, cos_phi, h)
    return LightPath(geometry, omega_i, omega_r, (-y_i, x_i), (y_r, -x_r))


def _azimuth(omega: Any, x: Any, y: Any) -> tuple[Any, Any, Any]:
    """sinθ and the horizontal unit vector of a direction; that vector is (x, y) where it runs along the normal."""
    square = dr.fma(omega[0], omega[0], omega[1] * omega[1])
    flat = square < 1e-30
    inverse = dr.rsqrt(dr.maximum(square, 1e-30))
    return (
        dr.select(flat, 0.0, square * inverse),
        dr.select(flat, x, omega[0] * inverse),
        dr.select(flat, y, omega[1] * inverse),
    )


def to_mitsuba(f: Matrix, path: LightPath) -> Matrix:
    """Turn a Mueller matrix of the model to Mitsuba's conventions.

    Parameters
    ----------
    f
        Mueller matrix between the surface's (p, s) frames, Q = I_p − I_s.
    path
        The light it belongs to.

    Returns
    -------
    list of list
        Mueller matrix between ``stokes_basis(-omega_i)`` and ``stokes_basis(omega_r)``.
    """
    sign = (1.0, -1.0, -1.0, -1.0)
    M = [[f[i][j] if sign[i] == sign[j] else -f[i][j] for j in range(4)] for i in range(4)]
    c, s = _turn(path.omega_r, path.s_r)
    M[1], M[2] = (
        [dr.fma(c, a, s * b) for a, b in zip(M[1], M[2], strict=True)],
        [dr.fma(c, b, -s * a) for a, b in zip(M[1], M[2], strict=True)],
    )
    c, s = _turn(-path.omega_i, path.s_i)
    for row in M:
        row[1], row[2] = dr.fma(c, row[1], s * row[2]), dr.fma(c, row[2], -s * row[1])
    return M


def _turn(k: Any, s: tuple[Any, Any]) -> tuple[Any, Any]:
    """cos2χ and sin2χ of the turn about k that leads from the horizontal vector s to ``stokes_basis(k)``."""
    import mitsuba as mi

    b = mi.mueller.stokes_basis(k)
    along = dr.fma(s[0], b[0], s[1] * b[1])
    across = dr.fma(b[2], k[0] * s[1] - k[1] * s[0], k[2] * (s[0] * b[1] - s[1] * b[0]))
    return dr.fma(along, along, -across * across), 2.0 * along * across
