"""Rotation of Stokes vectors between the facet's and the surface's frames, paper eq. (5).

A Stokes vector refers to the frame (p, s) about its ray. Turning the frame by the angle χ, so that
p' = cosχ p + sinχ s, changes (Q, U) into Q' = cos2χ Q + sin2χ U, U' = −sin2χ Q + cos2χ U and leaves I and V.
The paper's M(α) is the case χ = −α. Only cos2χ and sin2χ are ever needed, and they come from scalar
products: the angles themselves are undefined where a ray runs along a normal, the matrices are not.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from pbrdf.optics.geometry import Geometry, cross, dot

__all__ = ["facet_rotations", "tilt_rotation"]


def facet_rotations(geometry: Geometry) -> tuple[Any, Any, Any, Any]:
    """Turn from the surface's to the mirror facet's frame, for both rays.

    The facet's s direction is k_i×m = k_r×m ∝ ω_r×ω_i: one vector serves both rays. At exact backscatter
    it vanishes; any direction across the ray then gives the same Mueller matrix, and that of the surface's
    own s is taken.

    Returns
    -------
    cos_i, sin_i, cos_r, sin_r
        cos2χ and sin2χ for the incident and for the reflected ray.
    """
    normal = cross(geometry.omega_r, geometry.omega_i)
    length2 = dot(normal, normal)
    degenerate = length2 < 1e-30 if _is_double(length2) else length2 < 1e-13
    s = tuple(dr.select(degenerate, a, b) for a, b in zip(geometry.s_i, normal, strict=True))

    def double_angle(p_surface: Any, s_surface: Any) -> tuple[Any, Any]:
        # s_facet = cosχ s − sinχ p
        c, d = dot(s, s_surface), -dot(s, p_surface)
        scale = dr.rcp(dr.fma(c, c, d * d))
        return (c * c - d * d) * scale, 2.0 * c * d * scale

    return (*double_angle(geometry.p_i, geometry.s_i), *double_angle(geometry.p_r, geometry.s_r))


def tilt_rotation(along_p: Any, along_s: Any) -> tuple[Any, Any]:
    """Return sin²β cos2χ and sin²β sin2χ for a facet whose normal has these components in a ray's frame (p, s).

    β is the angle between the ray and m, χ the turn from the surface's frame to the facet's. The factor
    sin²β makes both polynomials in the normal, without the singularity at β = 0; the difference of the two Fresnel
    transmittances brings that factor (see :func:`pbrdf.optics.fresnel.transmittances`).
    """
    return along_p * along_p - along_s * along_s, 2.0 * along_p * along_s


def _is_double(x: Any) -> bool:
    return dr.type_v(x) == dr.VarType.Float64 if dr.is_array_v(x) else True
