"""Directions of illumination and view, and the angles between them.

Conventions (docs/model.md, section 1): ẑ is the surface normal; ω_i and ω_r point away from the surface,
ω_i = (−sinθ_i, 0, cosθ_i), ω_r = (sinθ_r cosφ, sinθ_r sinφ, cosθ_r), so that φ = 0 is the forward
(specular) half-plane. Light propagates along k_i = −ω_i and k_r = ω_r. In both propagation frames
s = k×ẑ/|k×ẑ|, p = s×k, hence p×s = k; they are written out from the angles, so they stay defined at
normal incidence and at normal view.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

__all__ = [
    "Geometry",
    "Vector",
    "cross",
    "dot",
    "geometry_from_angles",
    "geometry_from_sines",
    "mirror_facet",
]

Vector = tuple[Any, Any, Any]


def dot(a: Vector, b: Vector) -> Any:
    """Scalar product of two 3-vectors."""
    return dr.fma(a[0], b[0], dr.fma(a[1], b[1], a[2] * b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class Geometry(NamedTuple):
    """One illumination and view geometry, as vectors.

    As the state of a symbolic loop it goes as a plain ``tuple(geometry)`` and is made again in the body: within another
    symbolic loop, Dr.Jit 1.5 drops the derivatives of the fields of a named tuple without a word.

    Attributes
    ----------
    omega_i, omega_r
        Unit vectors from the surface towards the source and towards the viewer.
    p_i, s_i, p_r, s_r
        Unit vectors of the surface's polarisation frames of the incident and the reflected ray, p×s = k.
    sin_i, sin_r
        sinθ_i and sinθ_r (cosθ_i and cosθ_r are the z components of ``omega_i`` and ``omega_r``).
    facet
        Unit normal of the facet that mirrors ω_i into ω_r (the half vector).
    cos_beta
        Cosine of the local angle of incidence β on that facet, cosβ = ω_i·facet.
    cos_scattering
        Cosine of the scattering angle, cosω = k_i·k_r (paper eq. 10).
    """

    omega_i: Vector
    omega_r: Vector
    p_i: Vector
    s_i: Vector
    p_r: Vector
    s_r: Vector
    sin_i: Any
    sin_r: Any
    facet: Vector
    cos_beta: Any
    cos_scattering: Any

    @property
    def cos_i(self) -> Any:
        """cosθ_i."""
        return self.omega_i[2]

    @property
    def cos_r(self) -> Any:
        """cosθ_r."""
        return self.omega_r[2]


def mirror_facet(h: Vector) -> tuple[Vector, Any]:
    """Normal of the facet that mirrors ω_i into ω_r, and cosβ on it, from the sum ``h`` of the two unit vectors.

    cosβ = |h|/2: ω_i·facet would cancel between rays that graze from opposite sides.
    """
    length2 = dot(h, h)
    inverse = dr.rsqrt(length2)
    return (h[0] * inverse, h[1] * inverse, h[2] * inverse), 0.5 * length2 * inverse


def geometry_from_angles(theta_i: Any, theta_r: Any, phi: Any) -> Geometry:
    """Build the vectors of a geometry from its angles.

    Parameters
    ----------
    theta_i, theta_r
        Zenith angles of source and viewer in radians, within [0, π/2).
    phi
        Relative azimuth in radians, 0 in the forward half-plane.
    """
    return geometry_from_sines(*dr.sincos(theta_i), *dr.sincos(theta_r), *dr.sincos(phi))


def geometry_from_sines(
    sin_i: Any,
    cos_i: Any,
    sin_r: Any,
    cos_r: Any,
    sin_phi: Any,
    cos_phi: Any,
    h: Vector | None = None,
) -> Geometry:
    """Build the vectors of a geometry from sines and cosines of θ_i, θ_r and φ (both θ below π/2).

    The sum ``h`` = ω_i + ω_r may be given where it is known more exactly than it follows from these numbers.
    """
    zero = dr.zeros(type(sin_i), dr.width(sin_i)) if dr.is_jit_v(sin_i) else 0.0
    omega_i = (-sin_i, zero, cos_i)
    omega_r = (sin_r * cos_phi, sin_r * sin_phi, cos_r)
    if h is None:
        h = (omega_i[0] + omega_r[0], omega_r[1], cos_i + cos_r)
    facet, cos_beta = mirror_facet(h)
    return Geometry(
        omega_i=omega_i,
        omega_r=omega_r,
        p_i=(cos_i, zero, sin_i),
        s_i=(zero, zero - 1.0, zero),
        p_r=(-cos_r * cos_phi, -cos_r * sin_phi, sin_r),
        s_r=(sin_phi, -cos_phi, zero),
        sin_i=sin_i,
        sin_r=sin_r,
        facet=facet,
        cos_beta=cos_beta,
        cos_scattering=sin_i * sin_r * cos_phi - cos_i * cos_r,
    )
