"""Fresnel reflection and transmission at a facet between air and a coating of index n − iκ.

Source: paper eqs (6)-(8) (after Diner et al., Atmosphere 3, 591 (2012), eqs 17-18), with q = n cosβ' =
√(ε − sin²β), ε = (n − iκ)², principal root (Re q ≥ 0, Im q ≤ 0), and c = cosβ:
r_s = (c − q)/(c + q), r_p = (εc − q)/(εc + q). The Stokes frame is p-positive, Q = I_p − I_s.

For light leaving the coating the transmittances are the same as for light entering it (T = 1 − |r|²).
From q² = ε − sin²β follows r_p = r_s (sin²β − cq)/(sin²β + cq), so the difference of the transmittances
carries a factor sin²β in closed form; it is returned without that factor, which takes the singularity
out of the rotation that follows (:func:`pbrdf.optics.reference_planes.tilt_rotation`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

__all__ = [
    "Reflection",
    "internal_diffuse_reflectance",
    "mueller_reflection",
    "refraction_root",
    "transmittances",
]

#: Gauss-Legendre rule on (−1, 1) of :func:`internal_diffuse_reflectance`.
_GAUSS = [(float(x), float(w)) for x, w in zip(*np.polynomial.legendre.leggauss(16), strict=True)]


class Reflection(NamedTuple):
    """Elements of the reflection Mueller matrix of eq. (6) in the facet's frame.

    ``M00 = M11 = mean``, ``M01 = M10 = difference``, ``M22 = M33 = real``, ``M23 = −imaginary``,
    ``M32 = +imaginary``; real and imaginary are those of r_p r_s*.
    """

    mean: Any
    difference: Any
    real: Any
    imaginary: Any


def refraction_root(cos_beta: Any, n: Any, kappa: Any | None) -> tuple[Any, Any | None]:
    """Return q = √(ε − sin²β) as (Re q, −Im q), the second None for a dielectric (``kappa`` None)."""
    sin2 = dr.maximum(dr.fma(-cos_beta, cos_beta, 1.0), 0.0)
    if kappa is None:
        return dr.sqrt(n * n - sin2), None
    real = n * n - kappa * kappa - sin2
    imaginary = 2.0 * n * kappa
    modulus = dr.sqrt(dr.fma(real, real, imaginary * imaginary))
    # the larger of the two parts comes from the sum without cancellation, the other from their product
    # (both are 0 where n = 1, κ = 0 and the ray grazes the facet)
    large = dr.maximum(dr.sqrt(0.5 * (modulus + dr.abs(real))), 1e-18)
    small = 0.5 * imaginary / large
    dielectric = real >= 0.0
    return dr.select(dielectric, large, small), dr.select(dielectric, small, large)


def mueller_reflection(cos_beta: Any, n: Any, kappa: Any | None = None) -> Reflection:
    """Reflection Mueller matrix elements for local incidence β, paper eqs (6)-(8).

    Parameters
    ----------
    cos_beta
        Cosine of the local angle of incidence.
    n, kappa
        Real part and extinction of the index n − iκ; ``kappa=None`` for a dielectric.
    """
    c = cos_beta
    q, qi = refraction_root(c, n, kappa)
    if kappa is None or qi is None:
        r_s = (c - q) / (c + q)
        eps_c = n * n * c
        r_p = (eps_c - q) / (eps_c + q)
        R_s, R_p = r_s * r_s, r_p * r_p
        return Reflection(0.5 * (R_p + R_s), 0.5 * (R_p - R_s), r_p * r_s, None)
    # (a − ib)/(d + if) for r_s with numerator c − q, denominator c + q, and likewise r_p
    eps_r, eps_i = n * n - kappa * kappa, 2.0 * n * kappa  # ε = eps_r − i eps_i
    s_num, s_den = (c - q, qi), (c + q, -qi)
    p_num, p_den = (eps_r * c - q, qi - eps_i * c), (eps_r * c + q, -qi - eps_i * c)
    rs_re, rs_im = _divide(s_num, s_den)
    rp_re, rp_im = _divide(p_num, p_den)
    R_s = dr.fma(rs_re, rs_re, rs_im * rs_im)
    R_p = dr.fma(rp_re, rp_re, rp_im * rp_im)
    return Reflection(
        0.5 * (R_p + R_s),
        0.5 * (R_p - R_s),
        dr.fma(rp_re, rs_re, rp_im * rs_im),
        rp_im * rs_re - rp_re * rs_im,
    )


def transmittances(cos_beta: Any, n: Any, kappa: Any | None = None, kind: str = "flux") -> tuple[Any, Any]:
    """Mean transmittance of a facet, and half the difference p − s over sin²β.

    Parameters
    ----------
    cos_beta
        Cosine of the angle between the ray outside the coating and the facet's normal.
    n, kappa
        Real part and extinction of the index; ``kappa=None`` for a dielectric.
    kind
        ``"flux"``: T_x = 1 − |r_x|², the share of the power that crosses the facet; ``"amplitude"``: |t_x|²,
        the letter of the paper's "replace r by t", for light that leaves the coating.

    Returns
    -------
    mean, difference
        (T_p + T_s)/2 and (T_p − T_s)/(2 sin²β).
    """
    c = cos_beta
    sin2 = dr.fma(-c, c, 1.0)
    if kappa is None:
        # q² = ε − sin²β; T_s = 4cq/(c + q)² and T_p = T_s (1 + ratio² sin²β) with ratio = (ε − 1)/(εc + q)
        # over one common denominator: one division for both
        eps = n * n
        q = dr.sqrt(dr.fma(c, c, eps - 1.0))
        den_p = dr.fma(eps, c, q)
        inverse = dr.rcp((c + q) * den_p)
        common = 4.0 * q * (c if kind == "flux" else q) * (inverse * inverse)
        half = 0.5 * (eps - 1.0) * (eps - 1.0) * common
        return dr.fma(half, sin2, common * den_p * den_p), half
    q, qi = refraction_root(c, n, kappa)
    assert qi is not None
    sin2 = dr.maximum(sin2, 0.0)
    den_s = dr.fma(c + q, c + q, qi * qi)
    if kind == "flux":
        T_s = 4.0 * c * q / den_s
        R_s = dr.fma(c - q, c - q, qi * qi) / den_s
        den = dr.fma(sin2 + c * q, sin2 + c * q, c * c * qi * qi)
        half = 2.0 * R_s * c * q / den
        return dr.fma(half, sin2, T_s), half
    # |t_s|² = 4|q|²/|q + c|², |t_p|² = 4|n|²|q|²/|q + εc|²; with A = n(q + c), B = q + εc the difference
    # |A|² − |B|² is Re[(A − B)(A + B)*] = sin²β Re[(n − 1)(ε − 1)(n + 1)* (q + nc)*/(q + nc)]
    eps_r, eps_i = n * n - kappa * kappa, 2.0 * n * kappa
    q2 = dr.fma(q, q, qi * qi)
    den_p = dr.fma(eps_r * c + q, eps_r * c + q, (eps_i * c + qi) * (eps_i * c + qi))
    T_s = 4.0 * q2 / den_s
    g = _multiply((n - 1.0, -kappa), (eps_r - 1.0, -eps_i))
    g = _multiply(g, (n + 1.0, kappa))
    z = (q + n * c, -(qi + kappa * c))
    g = _multiply(g, _divide((z[0], -z[1]), z))
    half = 2.0 * q2 * g[0] / (den_s * den_p)
    return dr.fma(half, sin2, T_s), half


def internal_diffuse_reflectance(n: Any) -> Any:
    """Share ρ_int of diffuse light inside a medium of index n that its flat surface to air sends back.

    Outside, diffuse light is reflected by ρ_ext = ∫₀¹ R(μ) 2μ dμ. Radiance over n² is conserved through the surface
    and its transmittance is the same both ways, so what enters from outside, 1 − ρ_ext, is n² times what leaves from
    inside: ρ_int = 1 − (1 − ρ_ext)/n² = 1 − n⁻² ∫₀¹ T(μ) 2μ dμ, total reflection included. With μ = s² a Gauss rule of
    16 points takes the integral to 1e-12 for 1.05 ≤ n ≤ 3 and to 1e-8 for any n ≥ 1.

    Parameters
    ----------
    n
        Real index, at least 1.
    """
    total: Any = 0.0
    for x, weight in _GAUSS:
        s = 0.5 * (x + 1.0)
        mean, _ = transmittances(s * s, n)
        total = total + (2.0 * weight * s**3) * mean
    return 1.0 - total / (n * n)


def _multiply(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _divide(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    scale = dr.rcp(dr.fma(b[0], b[0], b[1] * b[1]))
    return (a[0] * b[0] + a[1] * b[1]) * scale, (a[1] * b[0] - a[0] * b[1]) * scale
