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
from typing import Any, NamedTuple

import drjit as dr

from pbrdf.optics.diffuse import minnaert_shape
from pbrdf.optics.fresnel import transmittances
from pbrdf.optics.geometry import Geometry, dot
from pbrdf.optics.powers import polynomial, power
from pbrdf.optics.quadrature import Facet, facet_average, table

__all__ = [
    "NORMALIZATIONS",
    "TRANSMITTANCES",
    "average_steepness",
    "exit_and_entry_polarisation",
    "exit_and_entry_sums",
    "exit_polarisation",
    "exit_sums",
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
    sums: list[Any] | None = None,
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
    sums
        What :func:`exit_sums` gave, if it was asked before.
    """
    if sums is None:
        sums = exit_sums(geometry, sigma, n, kappa, k, normalization, transmittance, accuracy)
    intensity, q, u = sums[:3]
    if normalization == "weighted":
        scale = _inverse(sums[3])
    else:
        solid_angle, integral = visible_means(geometry, k, accuracy, _unit_of_weights(geometry, sigma))
        scale = solid_angle * _inverse(integral)
    return intensity * scale, q * scale, u * scale


def exit_sums(
    geometry: Geometry,
    sigma: Any,
    n: Any,
    kappa: Any | None,
    k: Any,
    normalization: str = "weighted",
    transmittance: str = "flux",
    accuracy: str = "default",
    rule: str | None = None,
) -> list[Any]:
    """Averages over the facets that :func:`exit_polarisation` is made of, parameters as there.

    ``rule`` says how all lanes average, where that is known, see :func:`pbrdf.optics.quadrature.facet_average`.
    """
    unit = _unit_of_weights(geometry, sigma)

    def integrand(facet: Facet, geometry: Geometry, args: Any) -> tuple[Any, ...]:
        n, kappa, k = args
        W = minnaert_shape(facet.mu_i, facet.mu_r, k, unit)
        column = _transmission_vector(facet.mu_r, facet.turn_r, n, kappa, transmittance)
        values = tuple(W * x for x in column)
        return (*values, W) if weighted else values

    # W only where it is used: Dr.Jit 1.5 crashes on derivatives of a loop of which an output was dropped
    weighted = normalization == "weighted"
    steepness = average_steepness(dr.detach(k), normalization)
    size = 4 if weighted else 3
    return facet_average(integrand, size, geometry, sigma, (n, kappa, k), accuracy, steepness, rule)


def exit_and_entry_polarisation(
    geometry: Geometry,
    sigma: Any,
    n: Any,
    kappa: Any | None,
    k: Any,
    accuracy: str = "default",
    sums: list[Any] | None = None,
) -> list[list[Any]]:
    """3 x 3 block (I, Q, U) of D_b = E[W T_out D_s T_in]/E[W]: light enters and leaves through the facet.

    Beyond the paper (docs/model.md, section 3): with the transmittance of flux on both ways and both frame
    rotations, Helmholtz reciprocity holds for the whole Mueller matrix. ``sums`` are those of
    :func:`exit_and_entry_sums`, if it was asked before.
    """
    if sums is None:
        sums = exit_and_entry_sums(geometry, sigma, n, kappa, k, accuracy)
    E_W, *block = sums
    scale = _inverse(E_W)
    return [[block[3 * i + j] * scale for j in range(3)] for i in range(3)]


def exit_and_entry_sums(
    geometry: Geometry,
    sigma: Any,
    n: Any,
    kappa: Any | None,
    k: Any,
    accuracy: str = "default",
    rule: str | None = None,
) -> list[Any]:
    """Averages that :func:`exit_and_entry_polarisation` is made of; ``rule`` as in :func:`exit_sums`."""
    unit = _unit_of_weights(geometry, sigma)

    def integrand(facet: Facet, geometry: Geometry, args: Any) -> tuple[Any, ...]:
        n, kappa, k = args
        W = minnaert_shape(facet.mu_i, facet.mu_r, k, unit)
        column = _transmission_vector(facet.mu_r, facet.turn_r, n, kappa)
        row = _transmission_vector(facet.mu_i, facet.turn_i, n, kappa)
        return (W, *(W * out * enter for out in column for enter in row))

    steepness = average_steepness(dr.detach(k))
    return facet_average(integrand, 10, geometry, sigma, (n, kappa, k), accuracy, steepness, rule)


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


def _transmission_vector(
    mu: Any, turn: tuple[Any, Any], n: Any, kappa: Any | None, transmittance: str = "flux"
) -> tuple[Any, Any, Any]:
    """(T_+, T_− cos2χ, T_− sin2χ) of a facet for a ray: first column or first row."""
    mean, half = transmittances(mu, n, kappa, transmittance)
    q, u = turn
    return mean, half * q, half * u


class _Rule(NamedTuple):
    """Rule of ``visible_means`` for one accuracy: double-exponential, x = 1/(1 + exp(−u)) with u = rate·sinhτ.

    Attributes
    ----------
    points, weights
        Equidistant in τ, ascending: u, and du.
    reach
        Facets where the logarithm of W has fallen by this much below its largest value are left out.
    degree
        Of the polynomial for the integral over λ.
    """

    points: list[float]
    weights: list[float]
    reach: float
    degree: int


def _rule(count: int, rate: float, end: float, reach: float, degree: int) -> _Rule:
    """Rule with ``count`` points from τ = −``end`` to ``end``."""
    h = 2.0 * end / (count - 1)
    tau = [h * j - end for j in range(count)]
    return _Rule([rate * math.sinh(t) for t in tau], [h * rate * math.cosh(t) for t in tau], reach, degree)


_VISIBLE_RULES = {
    "default": _rule(32, 2.0, 2.6, 16.0, 10),
    "high": _rule(100, 2.5, 3.6, 28.0, 18),
    "draft": _rule(10, 1.6, 2.1, 10.0, 5),
    "fast": _rule(16, 1.6, 2.4, 12.0, 7),
}


def visible_means(geometry: Geometry, k: Any, accuracy: str = "default", scale: Any = 1.0) -> tuple[Any, Any]:
    """∫dω and ∫W dω over the lit and seen facets of the upper hemisphere, k > 1/3; ``scale`` is W's factor c.

    The first is the spherical triangle of three half-spaces, 2π − θ_i − θ_r − 2β. For the second, take lune
    coordinates about the half vector h, m = (cosλ cosψ, cosλ sinψ, sinλ) along h, q (in the plane of the two
    rays) and h×q: (μ_i' + μ_r') μ_i' μ_r' = cos³λ · 2 cosβ cosψ cos(ψ−β) cos(ψ+β). The λ integral from the
    horizon up is an incomplete beta function; the ψ integral is split where the horizon crosses the plane of
    the rays and done by a double-exponential rule. The rule stops well before the algebraic end points: what is left
    is the sum of a geometric series. For large k the ends are moved to where W vanishes.
    """
    F = type(k)
    UInt = dr.uint32_array_t(F)
    rule = _VISIBLE_RULES[accuracy]
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
    p = k - 1.0
    limit = 0.5 * math.pi - beta
    # −ln of the product above rises from its least value by at least ψ² (1/2 + 1/cos²β)
    fall = dr.fma(dr.rcp(cos_beta), dr.rcp(cos_beta), 0.5) * (1.0 / rule.reach)
    end = dr.minimum(limit, dr.rsqrt(dr.maximum(p * fall, 0.01)))
    # g(ψ) = cosψ h_z + sinψ q_z changes sign at the horizon; positive at ψ = 0
    crossing = dr.clip(-dr.atan2(h_z * dr.select(q_z < 0.0, -1.0, 1.0), dr.abs(q_z)), -end, end)
    points, weights = table(F, rule.points), table(F, rule.weights)
    last = len(rule.points) - 1
    # the smaller k, the more lies near the ends; beyond e^−80 single precision has no numbers
    stretch = dr.clip(dr.rcp(k), 1.0, 80.0 / rule.points[-1])
    nearest = dr.rcp(1.0 + dr.exp(stretch * rule.points[-1]))
    step = stretch * rule.weights[-1]
    tails = _tail_coefficients(1.5 * p, rule.degree)
    whole = 2.0 * sum(tails)
    # the segments below and above the crossing: width, distances of their two ends from the edge of the lune next to
    # them, factors of the last points for what lies beyond
    margin = limit - end
    segments: list[tuple[Any, ...]] = []
    for sign in (1.0, -1.0):
        width = dr.fma(sign, crossing, end)
        across = dr.fma(-sign, crossing, limit)
        ends = (_beyond(width * nearest, step, gap, beta, p) for gap in (margin, across))
        segments.append((width, across, *ends))

    def body(j: Any, total: Any, state: Any) -> tuple[Any, ...]:
        p, stretch, tails, whole, sin_beta, cos_beta, scale, margin, h_z, q_z, s_z2, segments = state
        grown = dr.exp(stretch * points(j))
        inner = dr.rcp(1.0 + grown)
        outer = grown * inner
        weight = stretch * weights(j) * outer * inner
        for sign, (width, gap, at_outer, at_inner) in zip((1.0, -1.0), segments, strict=True):
            # distances of ψ from the two edges of the lune
            here, there = dr.fma(width, outer, margin), dr.fma(width, inner, gap)
            sin_near, cos_near = dr.sincos(dr.minimum(here, there))
            cos_psi = dr.fma(sin_near, cos_beta, cos_near * sin_beta)
            sin_psi = dr.fma(cos_near, cos_beta, -sin_near * sin_beta)  # its magnitude
            twice = 2.0 * cos_beta * cos_psi  # cos(ψ−β) + cos(ψ+β), of which the smaller is sin_near
            product = sin_near * (twice - sin_near) * twice * scale
            g = dr.fma(cos_psi, h_z, dr.select(here < there, -sign, sign) * sin_psi * q_z)
            inverse = dr.rsqrt(dr.maximum(dr.fma(g, g, s_z2), 1e-30))
            tail = _tail(1.0 - dr.abs(g) * inverse, s_z2 * inverse * inverse, 1.5 * p, tails)
            inner_integral = dr.select(g > 0.0, whole - tail, tail)
            valid = (product > 0.0) & (width > 0.0)
            shape = power(dr.select(valid, product, 1.0), p)
            factor = width * dr.select(j == 0, at_outer, dr.select(j == last, at_inner, 1.0))
            total = dr.fma(dr.select(valid, weight * factor, 0.0), shape * inner_integral, total)
        return j + 1, total, state

    state = (p, stretch, tails, whole, sin_beta, cos_beta, scale, margin, h_z, q_z, s_z2, segments)
    integral = dr.while_loop(
        (UInt(0), dr.zeros(F, 1), state), lambda j, *_: j <= last, body, label="lune", max_iterations=-1
    )[1]
    return solid_angle, integral


def _beyond(d: Any, step: Any, gap: Any, beta: Any, p: Any) -> Any:
    """Factor on the outermost point of a segment for the part beyond it, a geometric series.

    The point lies at the distance ``d`` from the segment's end, the next one e^``step`` times as near. There the
    integrand goes like d^p if the end is the edge of the lune; in general that edge lies at the distance ``gap`` behind
    the end, and the other zeros of the product β and 2β behind the edge.
    """
    slopes = sum(d / dr.maximum(d + gap + far, 1e-30) for far in (0.0, beta, 2.0 * beta))
    return dr.rcp(1.0 - dr.exp(-step * dr.maximum(dr.fma(p, slopes, 1.0), 0.1)))


def _tail_coefficients(a: Any, degree: int) -> tuple[Any, ...]:
    """Coefficients in w = 1 − x of T = (1 − x²)^−(a+1) ∫ₓ¹ (1 − t²)^a dt on 0 ≤ x ≤ 1, a > −1.

    Lanczos' τ method: w(1 − w/2) T' + (a+1)(1 − w) T = 1/2 but for a multiple of a Chebyshev polynomial that lets the
    power series end.
    """
    chebyshev = _shifted_chebyshev(degree + 1)
    series, response = [0.5 * dr.rcp(a + 1.0)], [chebyshev[0] * dr.rcp(a + 1.0)]
    for j in range(1, degree + 1):
        inverse, factor = dr.rcp(a + (1.0 + j)), a + 0.5 * (j + 1)
        series.append(series[-1] * factor * inverse)
        response.append(dr.fma(response[-1], factor, chebyshev[j]) * inverse)
    factor = a + (1.0 + 0.5 * degree)
    tau = -series[-1] * factor / dr.fma(response[-1], factor, chebyshev[-1])
    return tuple(dr.fma(tau, r, s) for s, r in zip(series, response, strict=True))


def _shifted_chebyshev(n: int) -> list[float]:
    """Coefficients of cos(n arccos(2w − 1)) as a polynomial in w."""
    return [(-1.0) ** (n + j) * 4.0**j * n / (n + j) * math.comb(n + j, 2 * j) for j in range(n + 1)]


def _tail(w: Any, y: Any, a: Any, coefficients: tuple[Any, ...]) -> Any:
    """∫ₓ¹ (1 − t²)^a dt with w = 1 − x, y = 1 − x²."""
    return power(dr.maximum(y, 1e-30), a + 1.0) * polynomial(w, coefficients)


def _inverse(weight: Any) -> Any:
    """1/weight; not infinite where all weights are too small for floating-point numbers, as f_rpv then is, too."""
    return dr.rcp(dr.maximum(weight, 1e-300 if _double(type(weight)) else 1e-37))


def _double(F: Any) -> bool:
    return dr.type_v(F) == dr.VarType.Float64
