"""Body light that leaves (and enters) the coating through its facets, paper eqs (11)-(13).

The light scattered inside the coating is unpolarised until it leaves through a facet, by Fresnel
transmission at the local exit angle. The facets are averaged with the relative diffuse intensity
W = [(μ_r' + μ_i') μ_r' μ_i']^(k−1) of local cosines. Only the first column of D_v is other than zero, because
the body light is depolarised before it leaves (docs/model.md, section 3).

Two readings of eq. (13) are kept (docs/model.md, section 3): ``weighted``, D_v = E[W M_t]/E[W], and
``visible``, D_v = E[W M_t]·∫dω/∫W dω with plain means over the lit and seen facets of the upper hemisphere.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from pbrdf.optics.diffuse import minnaert_shape
from pbrdf.optics.fresnel import transmittances
from pbrdf.optics.geometry import Geometry, dot
from pbrdf.optics.quadrature import facet_average, table
from pbrdf.optics.reference_planes import tilt_rotation

__all__ = [
    "NORMALIZATIONS",
    "TRANSMITTANCES",
    "average_steepness",
    "exit_and_entry_polarisation",
    "exit_polarisation",
    "visible_means",
]

NORMALIZATIONS = ("weighted", "visible")
TRANSMITTANCES = ("flux", "amplitude")
#: E[W M_t] by itself, not over E[W], is as exact as that ratio if W counts as this many times steeper.
_UNWEIGHTED = 6.0


def exit_polarisation(
    geometry: Geometry,
    sigma: Any,
    n: Any,
    kappa: Any | None,
    k: Any,
    normalization: str = "weighted",
    transmittance: str = "flux",
    accuracy: str = "default",
    rule: str | None = None,
) -> tuple[Any, Any, Any]:
    """First column (I, Q, U) of D_v, paper eqs (12)-(13), in the surface's frame of the reflected ray.

    Parameters
    ----------
    geometry
        Illumination and view.
    sigma, n, kappa, k
        Slope standard deviation, index n − iκ (``kappa=None`` for a dielectric), Minnaert-type exponent.
    normalization, transmittance
        Reading of eq. (13) and of M_t, see the module.
    accuracy
        Accuracy of the average over the facets.
    rule
        How all lanes average, where that is known, see :func:`pbrdf.optics.quadrature.facet_average`.
    """

    unit = _unit_of_weights(geometry, sigma)

    def integrand(m: Any, mu_i: Any, mu_r: Any, geometry: Geometry, args: Any) -> tuple[Any, ...]:
        n, kappa, k = args
        W = minnaert_shape(mu_i, mu_r, k, unit)
        mean, half = transmittances(mu_r, n, kappa, transmittance)
        q, u = tilt_rotation(m, geometry.p_r, geometry.s_r)
        half = W * half
        values = (W * mean, half * q, half * u)
        return (*values, W) if weighted else values

    # W only where it is used: Dr.Jit 1.5 crashes on derivatives of a loop of which an output was dropped
    weighted = normalization == "weighted"
    steepness = average_steepness(dr.detach(k), normalization)
    size = 4 if weighted else 3
    found = facet_average(integrand, size, geometry, sigma, (n, kappa, k), accuracy, steepness, rule)
    intensity, q, u = found[:3]
    if weighted:
        scale = _inverse(found[3])
    else:
        solid_angle, integral = visible_means(geometry, k, accuracy, unit)
        scale = solid_angle * _inverse(integral)
    return intensity * scale, q * scale, u * scale


def exit_and_entry_polarisation(
    geometry: Geometry,
    sigma: Any,
    n: Any,
    kappa: Any | None,
    k: Any,
    accuracy: str = "default",
    rule: str | None = None,
) -> list[list[Any]]:
    """3 x 3 block (I, Q, U) of D_b = E[W T_out D_s T_in]/E[W]: light enters and leaves through the facet.

    Beyond the paper (docs/model.md, section 3): with the transmittance of flux on both ways and both frame
    rotations, Helmholtz reciprocity holds for the whole Mueller matrix.
    """

    unit = _unit_of_weights(geometry, sigma)

    def integrand(m: Any, mu_i: Any, mu_r: Any, geometry: Geometry, args: Any) -> tuple[Any, ...]:
        n, kappa, k = args
        W = minnaert_shape(mu_i, mu_r, k, unit)
        column = _transmission_vector(m, mu_r, geometry.p_r, geometry.s_r, n, kappa)
        row = _transmission_vector(m, mu_i, geometry.p_i, geometry.s_i, n, kappa)
        return (W, *(W * out * enter for out in column for enter in row))

    steepness = average_steepness(dr.detach(k))
    E_W, *block = facet_average(integrand, 10, geometry, sigma, (n, kappa, k), accuracy, steepness, rule)
    scale = _inverse(E_W)
    return [[block[3 * i + j] * scale for j in range(3)] for i in range(3)]


def average_steepness(k: Any, normalization: str = "weighted") -> Any:
    """Steepness of W for :func:`pbrdf.optics.quadrature.facet_average`."""
    return dr.abs(k - 1.0) * (1.0 if normalization == "weighted" else _UNWEIGHTED)


def _unit_of_weights(geometry: Geometry, sigma: Any) -> Any:
    """Factor on the products of local cosines after which those of most facets are near 1.

    Near the horizon W would leave the range of floating-point numbers for large k. The averages do not depend on it.
    """
    # no facet has local cosines of a sum above 2 cosβ
    mu_i, mu_r = (
        dr.minimum(dr.maximum(c, 0.25 * sigma), geometry.cos_beta) for c in (geometry.cos_i, geometry.cos_r)
    )
    return dr.rcp(dr.detach((mu_i + mu_r) * mu_i * mu_r))


def _transmission_vector(m: Any, mu: Any, p: Any, s: Any, n: Any, kappa: Any | None) -> tuple[Any, Any, Any]:
    """(T_+, T_− cos2χ, T_− sin2χ) of a facet for the ray with frame (p, s): first column or first row."""
    mean, half = transmittances(mu, n, kappa, "flux")
    q, u = tilt_rotation(m, p, s)
    return mean, half * q, half * u


def _tanh_sinh(step: float, half: int) -> tuple[list[float], list[float], list[float]]:
    """Double-exponential rule on (−1, 1): distances of the points from both ends, and weights.

    The distances are given rather than the points, because an integrand with an algebraic end point needs them
    to full relative precision.
    """
    from_low, from_high, weights = [], [], []
    for j in range(-half, half + 1):
        u = 0.5 * math.pi * math.sinh(j * step)
        from_low.append(math.exp(u) / math.cosh(u))
        from_high.append(math.exp(-u) / math.cosh(u))
        weights.append(step * 0.5 * math.pi * math.cosh(j * step) / math.cosh(u) ** 2)
    return from_low, from_high, weights


_VISIBLE_RULES = {
    "default": _tanh_sinh(0.13, 32),
    "high": _tanh_sinh(0.06, 70),
    "draft": _tanh_sinh(0.26, 14),
    "fast": _tanh_sinh(0.2, 20),
}
_SERIES_TERMS = {"default": 20, "high": 32, "draft": 10, "fast": 12}


def visible_means(geometry: Geometry, k: Any, accuracy: str = "default", scale: Any = 1.0) -> tuple[Any, Any]:
    """∫dω and ∫W dω over the lit and seen facets of the upper hemisphere, k > 1/3; ``scale`` is W's factor c.

    The first is the spherical triangle of three half-spaces, 2π − θ_i − θ_r − 2β. For the second, take lune
    coordinates about the half vector h, m = (cosλ cosψ, cosλ sinψ, sinλ) along h, q (in the plane of the two
    rays) and h×q: (μ_i' + μ_r') μ_i' μ_r' = cos³λ · 2 cosβ cosψ cos(ψ−β) cos(ψ+β). The λ integral from the
    horizon up is an incomplete beta function; the ψ integral is split where the horizon crosses the plane of
    the rays and done by the tanh-sinh rule, which takes the algebraic end points.
    """
    F = type(k)
    UInt = dr.uint32_array_t(F)
    difference = tuple(b - a for a, b in zip(geometry.omega_i, geometry.omega_r, strict=True))
    length2 = dot(difference, difference)
    sin_beta = 0.5 * dr.sqrt(length2)
    cos_beta = geometry.cos_beta
    beta = dr.atan2(sin_beta, cos_beta)
    theta_i, theta_r = (
        dr.atan2(geometry.sin_i, geometry.cos_i),
        dr.atan2(geometry.sin_r, geometry.cos_r),
    )
    solid_angle = 2.0 * math.pi - theta_i - theta_r - 2.0 * beta

    h_z = geometry.facet[2]
    q_z = difference[2] * dr.rsqrt(dr.maximum(length2, 1e-30))
    s_z2 = dr.maximum(1.0 - h_z * h_z - q_z * q_z, 0.0)
    limit = 0.5 * math.pi - beta
    # g(ψ) = cosψ h_z + sinψ q_z changes sign at the horizon; positive at ψ = 0
    crossing = dr.clip(-dr.atan2(h_z * dr.select(q_z < 0.0, -1.0, 1.0), dr.abs(q_z)), -limit, limit)
    from_low, from_high, weights = (table(F, column) for column in _VISIBLE_RULES[accuracy])
    count = len(_VISIBLE_RULES[accuracy][0])
    terms = _SERIES_TERMS[accuracy]
    a = 1.5 * (k - 1.0)
    half_y = dr.full(F, 0.5, dr.width(k)) if dr.is_jit_v(F) else 0.5
    whole = 2.0 * (_from_zero(half_y, a, terms) + _to_one(half_y, a, terms))

    def body(j: Any, total: Any, state: Any) -> tuple[Any, ...]:
        a, k, whole, beta, cos_beta, scale, limit, crossing, h_z, q_z, s_z2 = state
        second = j >= count
        index = dr.select(second, j - count, j)
        above, below, weight = (column(index) for column in (from_low, from_high, weights))
        low, high = dr.select(second, crossing, -limit), dr.select(second, limit, crossing)
        half_width = 0.5 * (high - low)
        # distances of ψ from −limit and from +limit, without cancellation at the segment's own end there
        above = dr.fma(half_width, above, dr.select(second, crossing + limit, 0.0))
        below = dr.fma(half_width, below, dr.select(second, 0.0, limit - crossing))
        psi = 0.5 * (above - below)
        sin_psi = dr.sin(psi)
        cos_psi = dr.sin(dr.minimum(above, below) + beta)
        # cos(ψ+β) = sin(above) and cos(ψ−β) = sin(below), by whichever distance is the smaller angle
        cos_plus = dr.sin(dr.minimum(above, below + 2.0 * beta))
        cos_minus = dr.sin(dr.minimum(below, above + 2.0 * beta))
        product = cos_psi * cos_plus * cos_minus * 2.0 * cos_beta * scale
        g = dr.fma(cos_psi, h_z, sin_psi * q_z)
        y = s_z2 / dr.maximum(dr.fma(g, g, s_z2), 1e-300 if _double(F) else 1e-30)  # 1 − x0²
        near_end = y <= 0.5
        upper = dr.select(near_end, _to_one(dr.minimum(y, 0.5), a, terms), 0.0)
        lower = dr.select(near_end, 0.0, _from_zero(dr.minimum(1.0 - y, 0.5), a, terms))
        tail = dr.select(near_end, upper, 0.5 * whole - lower)
        inner = dr.select(g > 0.0, whole - tail, tail)
        valid = (product > 0.0) & (half_width > 0.0)
        shape = dr.exp((k - 1.0) * dr.log(dr.select(valid, product, 1.0)))
        return j + 1, dr.fma(dr.select(valid, weight * half_width, 0.0), shape * inner, total), state

    state = (a, k, whole, beta, cos_beta, scale, limit, crossing, h_z, q_z, s_z2)
    integral = dr.while_loop(
        (UInt(0), dr.zeros(F, 1), state), lambda j, *_: j < 2 * count, body, label="lune", max_iterations=-1
    )[1]
    return solid_angle, integral


def _from_zero(x2: Any, a: Any, terms: int) -> Any:
    """∫₀ˣ (1 − t²)^a dt = x ₂F₁(½, −a; 3/2; x²) as a series, for x² ≤ ½."""
    total = 1.0
    for j in reversed(range(terms)):
        total = dr.fma((j - a) * ((j + 0.5) / ((j + 1.5) * (j + 1.0))) * x2, total, 1.0)
    return dr.sqrt(dr.maximum(x2, 1e-30)) * total


def _to_one(y: Any, a: Any, terms: int) -> Any:
    """∫ₓ¹ (1 − t²)^a dt = ½ y^(a+1) Σ (½)_j/j! y^j/(a+1+j) with y = 1 − x² ≤ ½, a > −1."""
    total = 0.0
    coefficients = [1.0]
    for j in range(1, terms):
        coefficients.append(coefficients[-1] * (j - 0.5) / j)
    for j in reversed(range(terms)):
        total = dr.fma(y, total, coefficients[j] * dr.rcp(a + (1.0 + j)))
    return 0.5 * dr.exp((a + 1.0) * dr.log(dr.maximum(y, 1e-30))) * total


def _inverse(weight: Any) -> Any:
    """1/weight; not infinite where all weights are too small for floating-point numbers, as f_rpv then is, too."""
    return dr.rcp(dr.maximum(weight, 1e-300 if _double(type(weight)) else 1e-37))


def _double(F: Any) -> bool:
    return dr.type_v(F) == dr.VarType.Float64
