"""Averages over the facets that are lit and seen.

P dω is exactly a Gaussian density in the facet's two slopes (docs/model.md, section 4), so an average over
the facets is E[g(x, y); lit and seen] with m ∝ (x, y, 1) and x, y ~ N(0, σ²). "Lit" and "seen" are two
half-planes in slope space, at c_i = cotθ_i/σ and c_r = cotθ_r/σ standard deviations from the origin.

* Where both are far out (the paints below about 75°) a small cubature for the full Gaussian plane is
  enough: 12 points of degree 7 (Stroud, *Approximate Calculation of Multiple Integrals*, E2^{r²} 7-1) for
  σ ≤ 0.045, 5 x 5 Gauss-Hermite points for σ ≤ 0.12.
* Elsewhere the wedge between the two half-planes is mapped smoothly onto the whole plane and the
  trapezoidal rule is used there, which converges exponentially for analytic integrands, with algebraic
  singularities at the edges of the wedge included: the map bends with softplus functions at the edges, so
  that it is the identity inside. Axes are chosen so that the limits of the inner integral are linear and
  do not cross inside the wedge: for rays on opposite sides (φ near 0) the inner axis runs across the wedge
  and the outer axis into its corner; for rays on the same side the outer axis runs across the nearer edge.

The rule is chosen for each lane of the computation apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr

from pbrdf.optics.geometry import Geometry
from pbrdf.optics.summation import differentiated, summed
from pbrdf.optics.transport import transported_rows

__all__ = ["ACCURACIES", "CLEAR_WEDGE", "facet_average", "needs_wedge", "table", "wedge_distance"]

#: Distance, in standard deviations of slope, beyond which the edge of the lit and seen wedge is ignored.
CLEAR_WEDGE = 4.5
#: Largest σ for the 12-point and for the 25-point rule.
SIGMA_12, SIGMA_25 = 0.045, 0.12
#: Bounds beyond this many standard deviations are out of reach of every node.
_FAR = 50.0


class _Accuracy(NamedTuple):
    """Trapezoidal rule of the mapped wedge, and whether the cubatures of the whole plane are used.

    ``step`` and ``steepness`` of the map are in standard deviations of slope; there are 2·``half`` + 1 nodes
    an axis.
    """

    step: float
    half: int
    steepness: float
    clear: bool = True


#: ``draft`` is for searching (errors up to 1 % where the wedge cuts in), ``high`` for reference values, ``fast``
#: for rendering: a rule of its own, see :mod:`pbrdf.optics.transport`.
ACCURACIES: dict[str, _Accuracy | None] = {
    "default": _Accuracy(0.8, 7, 2.0),
    "high": _Accuracy(0.3, 24, 4.0, clear=False),
    "draft": _Accuracy(1.5, 3, 1.3),
    "fast": None,
}


def _clear_rules() -> tuple[list[float], list[float], list[float]]:
    """Orbits of four nodes under quarter turns: one node (in standard deviations) and the weight of each.

    First the three orbits of the 12-point rule, then the seven of the 25-point rule, whose centre counts as
    an orbit of a quarter of its weight.
    """
    s, t = (math.sqrt((9.0 - sign * 3.0 * math.sqrt(5.0)) / 4.0) for sign in (1.0, -1.0))
    x, y = [math.sqrt(6.0), s, t], [0.0, s, t]
    w = [1.0 / 36.0, (5.0 + 2.0 * math.sqrt(5.0)) / 45.0, (5.0 - 2.0 * math.sqrt(5.0)) / 45.0]
    # Gauss-Hermite, five points, for the normal density: roots of He5 = z(z⁴ − 10z² + 15)
    inner, outer = math.sqrt(5.0 - math.sqrt(10.0)), math.sqrt(5.0 + math.sqrt(10.0))
    w_in, w_out = (7.0 + 2.0 * math.sqrt(10.0)) / 60.0, (7.0 - 2.0 * math.sqrt(10.0)) / 60.0
    axis = [(0.0, 8.0 / 15.0), (inner, w_in), (outer, w_out)]
    for node_x, weight_x in axis:
        for node_y, weight_y in axis:
            if node_x > 0.0 or node_y == 0.0:
                x.append(node_x)
                y.append(node_y)
                w.append(weight_x * weight_y * (0.25 if node_x == 0.0 else 1.0))
    return x, y, w


_RULES = _clear_rules()


def table(F: type, column: list[float]) -> Callable[..., Any]:
    """Numbers to look up by index: a function of the index and, if not always wanted, of a mask."""
    if F is float:
        return lambda index, active=True: column[index]
    values = F(column)
    return lambda index, active=True: dr.gather(F, values, index, active)


def wedge_distance(cos_theta: Any, sin_theta: Any, sigma: Any) -> Any:
    """Distance of the edge of the lit (or seen) half-plane from the origin, cotθ/σ, at most 50."""
    return cos_theta / dr.maximum(sigma * sin_theta, cos_theta / _FAR)


def _edges(geometry: Geometry, sigma: Any) -> tuple[Any, Any]:
    """Distances of the edges of the lit and of the seen half-plane."""
    return (
        wedge_distance(geometry.cos_i, geometry.sin_i, sigma),
        wedge_distance(geometry.cos_r, geometry.sin_r, sigma),
    )


def needs_wedge(c_i: Any, c_r: Any, sigma: Any) -> Any:
    """Tell where the default accuracy takes the mapped wedge instead of a small cubature."""
    return (dr.minimum(c_i, c_r) <= CLEAR_WEDGE) | (sigma > SIGMA_25)


def facet_average(
    integrand: Callable[..., tuple[Any, ...]],
    size: int,
    geometry: Geometry,
    sigma: Any,
    args: tuple[Any, ...],
    accuracy: str = "default",
) -> list[Any]:
    """Integrate functions of the facet normal over the lit and seen facets, ∫ P g dω.

    Parameters
    ----------
    integrand
        ``integrand(m, mu_i, mu_r, geometry, args)`` returns a tuple of ``size`` floats: the values for the
        facet normal m = (m_x, m_y, m_z), with the local cosines μ_i' = m·ω_i > 0 and μ_r' = m·ω_r > 0.
    size
        Number of functions integrated.
    geometry, sigma
        Geometry and slope standard deviation.
    args
        Differentiable values that the integrand needs: what it captures counts as constant.
    accuracy
        One of ``ACCURACIES``.

    Returns
    -------
    list
        The ``size`` integrals.
    """
    F = type(sigma)
    UInt = dr.uint32_array_t(F)
    c_i, c_r = _edges(geometry, sigma)
    vectors = tuple(geometry)

    def weighted(m: Any, weight: Any, vectors: Any, args: Any, check: bool) -> list[Any]:
        geometry = Geometry(*vectors)
        mu_i = dr.fma(m[0], geometry.omega_i[0], m[2] * geometry.omega_i[2])
        mu_r = dr.fma(
            m[0], geometry.omega_r[0], dr.fma(m[1], geometry.omega_r[1], m[2] * geometry.omega_r[2])
        )
        if check:
            valid = (mu_i > 0.0) & (mu_r > 0.0)
            mu_i, mu_r = dr.select(valid, mu_i, 1.0), dr.select(valid, mu_r, 1.0)
            weight = dr.select(valid, weight, 0.0)
        return [weight * value for value in integrand(m, mu_i, mu_r, geometry, args)]

    rule = ACCURACIES[accuracy]
    if rule is None:
        return _transported_average(integrand, size, geometry, sigma, c_i, c_r, args)

    # the rule enters as opaque data, so that the accuracies share one kernel
    step, steepness = dr.opaque(F, rule.step), dr.opaque(F, rule.steepness)
    flatness = dr.rcp(steepness)
    half, axis_nodes = dr.opaque(F, float(rule.half)), dr.opaque(UInt, 2 * rule.half + 1)
    wedge_lanes = needs_wedge(c_i, c_r, sigma) | (dr.opaque(UInt, int(rule.clear)) == 0)
    narrow = sigma <= SIGMA_12
    offset = dr.select(narrow, UInt(0), UInt(3))
    count = dr.select(wedge_lanes, UInt(0), dr.select(narrow, UInt(3), UInt(7)))
    nodes = [table(F, column) for column in _RULES]

    def quarter_turns(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        x, y, weight = (node(offset + j, j < count) for node in nodes)
        mx, my = x * sigma, y * sigma
        inverse = dr.rsqrt(dr.fma(mx, mx, dr.fma(my, my, 1.0)))
        mx, my = mx * inverse, my * inverse
        turned = [
            weighted((m_x, m_y, inverse), weight, vectors, args, False)
            for m_x, m_y in ((mx, my), (-my, mx), (-mx, -my), (my, -mx))
        ]
        return [a + b + c + d for a, b, c, d in zip(*turned, strict=True)]

    clear = summed(quarter_turns, count, size, (sigma, vectors, args), label="facets")

    def row(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        # the axes are found anew in each row: their derivatives are then those by what they depend on
        f, e, w_max, lower, upper = _wedge_axes(Geometry(*vectors), sigma)
        w, dw = _squeeze_below((F(j) - half) * step, w_max, steepness, flatness)
        low = dr.clip(dr.fma(lower[1], w, lower[0]), -_FAR, _FAR)
        high = dr.maximum(dr.minimum(dr.fma(upper[1], w, upper[0]), _FAR), low)
        # (1 − exp(low − high)): with it the derivative of the map has no cancellation in a narrow interval
        narrowness = 1.0 - dr.exp(steepness * (low - high))
        row_weight = (step * step * (0.5 / math.pi)) * dr.exp(-0.5 * w * w) * dw * narrowness

        def column(j: Any, sigma: Any, vectors: Any, args: Any, axes: Any, limits: Any) -> list[Any]:
            f, e = axes
            w, low, high, row_weight = limits
            v, dv = _squeeze_between((F(j) - half) * step, low, high, steepness, flatness)
            weight = row_weight * dv * dr.exp(-0.5 * v * v)
            x, y = sigma * dr.fma(f[0], w, e[0] * v), sigma * dr.fma(f[1], w, e[1] * v)
            inverse = dr.rsqrt(dr.fma(x, x, dr.fma(y, y, 1.0)))
            return weighted((x * inverse, y * inverse, inverse), weight, vectors, args, True)

        by = differentiated((sigma, vectors, args))
        state = (sigma, vectors, args, (f, e), (w, low, high, row_weight))
        return summed(column, axis_nodes, size, state, by, label="wedge columns")

    rows = dr.select(wedge_lanes, axis_nodes, 0)
    wedge = summed(row, rows, size, (sigma, vectors, args), label="wedge rows")
    return [a + b for a, b in zip(clear, wedge, strict=True)]


def _squeeze_below(z: Any, high: Any, steepness: Any, flatness: Any) -> tuple[Any, Any]:
    """Map z ∈ ℝ smoothly onto (−∞, high), the identity well inside; return the point and the derivative."""
    above = steepness * (z - high)
    e = dr.exp(-dr.abs(above))
    one_e = 1.0 + e
    point = z - (dr.maximum(above, 0.0) + dr.log(one_e)) * flatness
    return point, dr.select(above > 0.0, e, 1.0) / one_e


def _squeeze_between(z: Any, low: Any, high: Any, steepness: Any, flatness: Any) -> tuple[Any, Any]:
    """Map z ∈ ℝ smoothly onto (low, high); return the point and the derivative over 1 − exp(low − high)."""
    below, above = steepness * (low - z), steepness * (z - high)
    e_below, e_above = dr.exp(-dr.abs(below)), dr.exp(-dr.abs(above))
    one_above = 1.0 + e_above
    ratio = dr.rcp(one_above)
    one_below = 1.0 + e_below
    bend = dr.maximum(below, 0.0) - dr.maximum(above, 0.0) + dr.log(one_below * ratio)
    inside = dr.select(below > 0.0, e_below, 1.0) * dr.select(above > 0.0, e_above, 1.0)
    return z + bend * flatness, inside * ratio / one_below


def _transported_average(
    integrand: Callable[..., tuple[Any, ...]],
    size: int,
    geometry: Geometry,
    sigma: Any,
    c_i: Any,
    c_r: Any,
    args: tuple[Any, ...],
) -> list[Any]:
    """Average with the few nodes of :mod:`pbrdf.optics.transport`."""
    total: list[Any] = [0.0] * size
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    across = dr.abs(sin_phi)
    turned_cosine = dr.select(sin_phi < 0.0, -cos_phi, cos_phi)
    for row in transported_rows(c_r, c_i, -cos_phi, across):
        u = sigma * row.u
        length2 = dr.fma(u, u, 1.0)
        # one exit angle for the whole row, that of the mean square across
        mu_r = dr.fma(-u, geometry.sin_r, geometry.cos_r) * dr.rsqrt(dr.fma(sigma, sigma, length2))
        mu_r = dr.maximum(mu_r, 1e-6)
        for v, weight in row.nodes:
            v = sigma * v
            x, y = dr.fma(-u, cos_phi, across * v), dr.fma(-u, sin_phi, -turned_cosine * v)
            inverse = dr.rsqrt(dr.fma(v, v, length2))
            mu_i = dr.maximum(inverse * dr.fma(-x, geometry.sin_i, geometry.cos_i), 1e-6)
            values = integrand((x * inverse, y * inverse, inverse), mu_i, mu_r, geometry, args)
            total = [dr.fma(weight, value, t) for value, t in zip(values, total, strict=True)]
    return total


def _nearer_edge_axes(geometry: Geometry, c_i: Any, c_r: Any) -> tuple[Any, ...]:
    """Axes across and along the nearer edge, distances of both edges, and the angle between their normals.

    Lit: a_i·z < c_i with a_i = (1, 0); seen: a_r·z < c_r with a_r = −(cosφ, sinφ).

    Returns
    -------
    (f, e), c_near, c_far, cos_d, sin_d
        As :func:`pbrdf.optics.transport.transported_rows` takes them.
    """
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    nearer_i = c_i <= c_r
    f = (dr.select(nearer_i, 1.0, -cos_phi), dr.select(nearer_i, 0.0, -sin_phi))
    # e = ±(−f_y, f_x), the sign such that the farther edge bounds it from above
    turn = dr.select((sin_phi > 0.0) == nearer_i, -1.0, 1.0)
    e = (-turn * f[1], turn * f[0])
    return (f, e), dr.minimum(c_i, c_r), dr.maximum(c_i, c_r), -cos_phi, dr.abs(sin_phi)


def _wedge_axes(geometry: Geometry, sigma: Any) -> tuple[Any, ...]:
    """Outer axis f, inner axis e, outer limit and the inner limits (constant, slope in the outer variable)."""
    c_i, c_r = _edges(geometry, sigma)
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    cos_d = -cos_phi  # a_i·a_r
    same_side = cos_d >= 0.0

    # same side: f across the nearer edge
    (f_same, e_same), c_near, c_far, _, sin_d = _nearer_edge_axes(geometry, c_i, c_r)
    clearance: Any = dr.maximum(sin_d, 1e-12)
    inverse = dr.rcp(clearance)

    # opposite sides: e ∝ a_i − a_r, f ∝ a_i + a_r towards the corner
    S = dr.sqrt(dr.maximum(0.5 * (1.0 - cos_d), 0.25))  # ≥ 0.5 wherever this branch is taken
    C = dr.sqrt(dr.maximum(0.5 * (1.0 + cos_d), 0.0))
    e_opposite = (0.5 * (1.0 + cos_phi) / S, 0.5 * sin_phi / S)
    mirror = dr.select(e_opposite[1] > 0.0, -1.0, 1.0)
    f_opposite = (-mirror * e_opposite[1], mirror * e_opposite[0])

    def choose(a: Any, b: Any) -> Any:
        return dr.select(same_side, a, b)

    f = (choose(f_same[0], f_opposite[0]), choose(f_same[1], f_opposite[1]))
    e = (choose(e_same[0], e_opposite[0]), choose(e_same[1], e_opposite[1]))
    corner = 0.5 * (c_i + c_r) / dr.maximum(C, 1e-12)
    w_max = dr.minimum(choose(c_near, corner), _FAR)
    lower = (choose(-_FAR, -c_r / S), choose(0.0, C / S))
    upper = (choose(c_far * inverse, c_i / S), choose(-cos_d * inverse, -C / S))
    return f, e, w_max, lower, upper
