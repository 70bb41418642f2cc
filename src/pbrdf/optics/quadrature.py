"""Averages over the facets that are lit and seen.

P dω is exactly a Gaussian density in the facet's two slopes (docs/model.md, section 4), so an average over
the facets is E[g(x, y); lit and seen] with m ∝ (x, y, 1) and x, y ~ N(0, σ²). "Lit" and "seen" are two
half-planes in slope space, at c_i = cotθ_i/σ and c_r = cotθ_r/σ standard deviations from the origin.

* Where both are far out a small cubature for the full Gaussian plane is enough: Stroud's E2^{r²} 5-1 of 7 points and
  7-1 of 12 (*Approximate Calculation of Multiple Integrals*), or 26 points, Gauss-Hermite by Gauss-Hermite. How far
  out is enough depends on σ and on how steeply the integrand changes. The points come in rows across the slope
  towards the viewer, two at a time, which therefore share the local exit angle.
* Where only the nearer edge cuts in, rows of Gauss-Hermite points run along it.
* Elsewhere the wedge between the two half-planes is mapped onto the whole plane. Axes are chosen so that the limits
  of the inner integral are linear and do not cross inside the wedge: for rays on opposite sides (φ near 0) the inner
  axis runs across the wedge and the outer axis into its corner; for rays on the same side the outer axis runs across
  the nearer edge.

A variable that an edge cuts off is mapped onto a normal one, x = Φ⁻¹[Φ(low) + (Φ(high) − Φ(low)) Φ(z)], and z is
summed over by the trapezoidal rule, which converges exponentially for analytic integrands, with algebraic
singularities at the edges included: there 1 − Φ(z) falls off as a Gaussian. Well inside, the map is the identity.

The rule is chosen for each lane of the computation apart. In a renderer's packets of rays every lane waits for all
others, so the ``packet`` rule, for σ ≤ 0.12, has as few kinds of lanes as possible: seven rows of four points along the
nearer edge, and rows between both where the farther edge cuts in.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from pbrdf.optics.geometry import Geometry, Vector
from pbrdf.optics.powers import exp2, is_single, log2, polynomial, with_slope
from pbrdf.optics.reference_planes import tilt_rotation
from pbrdf.optics.summation import differentiated, summed
from pbrdf.optics.transport import transported_rows

__all__ = [
    "ACCURACIES",
    "CARE",
    "PACKET_RULE",
    "RULES",
    "Facet",
    "choose_rule",
    "facet_average",
    "table",
    "wedge_distance",
]

_LN2 = math.log(2.0)
#: Edges beyond this many standard deviations count as this far.
_FAR = 50.0
#: Bounds beyond this many standard deviations are out of reach of every node.
_REACH = 9.0


class Facet(NamedTuple):
    """What an integrand gets to know of a facet.

    Attributes
    ----------
    normal
        Unit normal m.
    mu_i, mu_r
        Local cosines m·ω_i > 0 and m·ω_r > 0.
    turn_i, turn_r
        sin²β cos2χ and sin²β sin2χ for either ray, see :func:`pbrdf.optics.reference_planes.tilt_rotation`.
    """

    normal: Vector
    mu_i: Any
    mu_r: Any
    turn_i: tuple[Any, Any]
    turn_r: tuple[Any, Any]


class _Accuracy(NamedTuple):
    """Rules of an accuracy, and where they are used; distances are in standard deviations of slope.

    Attributes
    ----------
    step, half
        The trapezoidal rule has 2·``half`` + 1 nodes an axis.
    across
        Numbers of nodes, even, in rows along the only near edge: in the middle row, in those beside it, and so on.
    clear
        Distances of the nearer edge beyond which it is ignored by the rules of 7, of 12 and of 26 points.
    far
        Distance beyond which the farther edge is ignored.
    rough
        Largest σ for which edges are ignored.
    care
        1 where the distances for 7 and 12 points grow with σ and with the steepness of the integrand, else 0.
    """

    step: float
    half: int
    across: tuple[int, ...]
    clear: tuple[float, float, float]
    far: float
    rough: float
    care: float


#: ``draft`` is for searching (errors up to 1 % where the wedge cuts in), ``high`` for reference values, ``fast``
#: for rendering: a rule of its own, see :mod:`pbrdf.optics.transport`.
ACCURACIES: dict[str, _Accuracy | None] = {
    "default": _Accuracy(0.9, 6, (4, 4, 4, 4, 2, 2, 0), (6.9, 4.5, 4.5), 4.5, 0.12, 1.0),
    "high": _Accuracy(0.55, 12, (16,) * 8 + (8,) * 5, (1e3, 1e3, 1e3), 7.5, 0.3, 0.0),
    "draft": _Accuracy(1.2, 3, (4, 4, 2, 2), (4.5, 4.5, 4.5), 4.5, 0.12, 0.0),
    "fast": None,
}
#: Cubatures of the whole plane of 7, 12 and 26 points, rows along the nearer edge, rows between both.
RULES = ("seven", "twelve", "many", "one_edge", "both_edges")
#: A rule for packets of rays in place of choosing one of ``RULES``.
PACKET_RULE = "packet"
#: Its rows along the nearer edge, where the farther one is beyond ``_PACKET_FAR``: z, positive towards the edge, and
#: weights; two pairs ±v in each row with the weight of each point. Both were fitted to averages of body light, σ ≤ 0.12
#: and 0.7 ≤ k ≤ 4, with the edge at any distance.
_PACKET_ROWS = (
    (-3.5877, 0.000922),
    (-2.3485, 0.029788),
    (-1.1615, 0.241352),
    (0.0088, 0.458168),
    (1.132, 0.231013),
    (2.2214, 0.037086),
    (3.3951, 0.001671),
)
_PACKET_PAIRS = ((0.7418, 0.454151), (2.3358, 0.045849))
_PACKET_FAR = 4.3
#: Elsewhere it takes rows between both edges: these where the farther edge is beyond ``_PACKET_COARSE``, else those of
#: ``default``.
_PACKET_ACCURACY = _Accuracy(1.1, 4, (0, 0, 0, 0, 0), (0.0, 0.0, 0.0), _PACKET_FAR, 0.12, 0.0)
_PACKET_COARSE = 2.0
#: For 7 and for 12 points: distance over √σ, and steepness times σ^{3/2} over distance, that are just exact enough.
CARE = ((28.0, 0.003), (18.5, 0.01))


def _hermite(count: int) -> list[tuple[float, float]]:
    """Gauss-Hermite rule for the normal density."""
    points, weights = np.polynomial.hermite_e.hermegauss(count)
    return [(float(x), float(w)) for x, w in zip(points, weights / weights.sum(), strict=True)]


def _pairs(count: int) -> list[tuple[float, float]]:
    """Positive points of a Gauss-Hermite rule of an even number of points."""
    if count == 0:
        return []
    return [(x, w) for x, w in _hermite(count) if x > 0.0]


def _clear_rules() -> tuple[list[tuple[float, ...]], list[tuple[int, int]]]:
    """Rules of 7, 12 and 26 points.

    Returns
    -------
    pairs, ranges
        Pairs (u, ±v), weight of each of the two points and u² + v²; where each rule begins, and its length.
    """
    three = math.sqrt(3.0)
    seven = [(0.0, 0.0, 0.25), (0.0, 2.0, 1.0 / 12.0), (three, 1.0, 1.0 / 12.0), (-three, 1.0, 1.0 / 12.0)]
    s, t = (math.sqrt((9.0 - sign * 3.0 * math.sqrt(5.0)) / 4.0) for sign in (1.0, -1.0))
    w_s, w_t = ((5.0 + sign * 2.0 * math.sqrt(5.0)) / 45.0 for sign in (1.0, -1.0))
    six = math.sqrt(6.0)
    twelve = [(0.0, six, 1.0 / 36.0), (six, 0.0, 1.0 / 72.0), (-six, 0.0, 1.0 / 72.0)]
    twelve += [(sign * x, x, w) for x, w in ((s, w_s), (t, w_t)) for sign in (1.0, -1.0)]
    rows = zip(_hermite(5), (4, 6, 6, 6, 4), strict=True)
    product = [(u, v, w * w_v) for (u, w), count in rows for v, w_v in _pairs(count)]
    ranges: list[tuple[int, int]] = []
    pairs: list[tuple[float, ...]] = []
    for rule in (seven, twelve, product):
        ranges.append((len(pairs), len(rule)))
        # rounded, so that points that are as far out share what depends on it
        pairs.extend((u, v, w, round(u * u + v * v, 14)) for u, v, w in rule)
    return pairs, ranges


class _Tables(NamedTuple):
    """Rows of all accuracies.

    Attributes
    ----------
    places
        By accuracy: first row between both edges and number of rows, first row along one edge and number of these.
    rows
        Φ(z), 1 − Φ(z) and weight, z on a trapezoidal rule; and 0.
    ranges
        First pair of points of a row, and number of its pairs: between both edges the corners of the square are left
        out. Rows along one edge that have as many points follow each other.
    pairs
        Φ(v) and 1 − Φ(v) of each of the points ±v, the weight of each, and v.
    """

    places: dict[str, tuple[int, int, int, int]]
    rows: list[tuple[float, ...]]
    ranges: list[tuple[float, ...]]
    pairs: list[tuple[float, ...]]


def _row_rules() -> _Tables:
    tables = _Tables({}, [], [], [])
    first: dict[int, int] = {}
    for name, rule in (*ACCURACIES.items(), (PACKET_RULE, _PACKET_ACCURACY)):
        if rule is None:
            continue
        trapezoid = _trapezoid(rule.step, 2 * rule.half + 1)
        rows = {j: (_phi(z), _phi(-z), weight, 0.0) for j, (z, weight) in enumerate(trapezoid, -rule.half)}
        # from the middle on; rows without points are left out
        along = [j for j in sorted(rows, key=abs) if rule.across[abs(j)] > 0]
        begin = len(tables.rows)
        tables.places[name] = begin, len(rows), begin + len(rows), len(along)
        tables.rows.extend([*rows.values(), *(rows[j] for j in along)])
        for j in rows:
            reach = math.sqrt((rule.half + 0.4) ** 2 - j * j)
            tables.ranges.append((len(tables.pairs), min(rule.half, int(reach + 0.5))))
        columns = _trapezoid(rule.step, 2 * rule.half)[rule.half :]
        tables.pairs.extend((_phi(v), _phi(-v), weight, v) for v, weight in columns)
        for count in (rule.across[abs(j)] for j in along):
            if count not in first:
                first[count] = len(tables.pairs)
                tables.pairs.extend((_phi(v), _phi(-v), weight, v) for v, weight in _pairs(count))
            tables.ranges.append((first[count], count // 2))
    return tables


def _phi(z: float) -> float:
    """Φ(z)."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


def _trapezoid(step: float, count: int) -> list[tuple[float, float]]:
    """Equidistant points about 0 and their weights for the normal density."""
    z = [(j - 0.5 * (count - 1)) * step for j in range(count)]
    weights = [math.exp(-0.5 * x * x) for x in z]
    total = math.fsum(weights)
    return [(x, w / total) for x, w in zip(z, weights, strict=True)]


_CLEAR, _CLEAR_RANGES = _clear_rules()
_TABLES = _row_rules()


def table(F: type, column: list[float]) -> Callable[..., Any]:
    """Numbers to look up by index."""
    if F is float:
        return lambda index: column[index]
    values = F(column)
    return lambda index: dr.gather(F, values, index)


def _packets(F: type, rows: list[tuple[float, ...]]) -> Callable[[Any], Any]:
    """Rows of two or four numbers to look up by index, faster than one number at a time."""
    if F is float:
        return lambda index: rows[index]
    values = F([x for row in rows for x in row])
    name = f"Array{len(rows[0])}f" + ("64" if dr.type_v(F) == dr.VarType.Float64 else "")
    Packet = getattr(sys.modules[F.__module__], name)
    return lambda index: dr.gather(Packet, values, index)


def wedge_distance(cos_theta: Any, sin_theta: Any, sigma: Any) -> Any:
    """Distance of the edge of the lit (or seen) half-plane from the origin, cotθ/σ, at most 50."""
    return cos_theta / dr.maximum(sigma * sin_theta, cos_theta / _FAR)


def _edges(geometry: Geometry, sigma: Any) -> tuple[Any, Any]:
    """Distances of the edges of the lit and of the seen half-plane."""
    return (
        wedge_distance(geometry.cos_i, geometry.sin_i, sigma),
        wedge_distance(geometry.cos_r, geometry.sin_r, sigma),
    )


def choose_rule(
    c_i: Any, c_r: Any, sigma: Any, steepness: Any, accuracy: str, number: Callable[[float], Any] = float
) -> Any:
    """Tell which of ``RULES`` each lane takes, by index: the farther the edges and the smaller σ, the lower.

    Parameters
    ----------
    c_i, c_r, sigma
        Distances of the edges and slope standard deviation.
    steepness
        See :func:`facet_average`.
    accuracy
        One of ``ACCURACIES`` other than ``fast``.
    number
        How a number of the accuracy enters.
    """
    rule = ACCURACIES[accuracy]
    assert rule is not None
    UInt = dr.uint32_array_t(type(sigma))
    nearer, farther = dr.minimum(c_i, c_r), dr.maximum(c_i, c_r)
    root, care = dr.sqrt(sigma), number(rule.care)
    steep = care * steepness * sigma * root
    seven, twelve, many = (number(x) for x in rule.clear)
    (spread_7, slope_7), (spread_12, slope_12) = CARE
    seven = dr.maximum(seven, dr.maximum(care * spread_7 * root, steep * (1.0 / slope_7)))
    twelve = dr.maximum(twelve, dr.maximum(care * spread_12 * root, steep * (1.0 / slope_12)))
    index: Any = UInt(4)
    for place, mask in (
        (3, farther > number(rule.far)),
        (2, nearer > many),
        (1, nearer > twelve),
        (0, nearer > seven),
    ):
        index = dr.select(mask, UInt(place), index)
    return dr.select(sigma <= number(rule.rough), index, UInt(4))


def facet_average(
    integrand: Callable[..., tuple[Any, ...]],
    size: int,
    geometry: Geometry,
    sigma: Any,
    args: tuple[Any, ...],
    accuracy: str = "default",
    steepness: Any = 1.0,
    rule: str | None = None,
) -> list[Any]:
    """Integrate functions of the facet normal over the lit and seen facets, ∫ P g dω.

    Parameters
    ----------
    integrand
        ``integrand(facet, geometry, args)`` returns a tuple of ``size`` floats, the values for a :class:`Facet`.
    size
        Number of functions integrated.
    geometry, sigma
        Geometry and slope standard deviation.
    args
        Differentiable values that the integrand needs: what it captures counts as constant.
    accuracy
        One of ``ACCURACIES``.
    steepness
        Size of the exponent of the local cosines' product with which the integrand goes, |k − 1|: where it is small,
        fewer nodes do. For the ratio of two such integrals; each of them by itself needs six times that.
    rule
        The one of ``RULES`` that all lanes take, where it is known: what is compiled is shorter then. Or
        ``PACKET_RULE``, for σ ≤ 0.12, with about the errors of ``default`` whatever the accuracy.

    Returns
    -------
    list
        The ``size`` integrals.
    """
    F = type(sigma)
    UInt = dr.uint32_array_t(F)
    if accuracy == "fast":
        return _transported_average(integrand, size, geometry, sigma, args)
    if rule == PACKET_RULE:
        return _packet_average(integrand, size, geometry, sigma, args)
    state = sigma, tuple(geometry), args
    if rule in RULES[:3]:
        return _sum_clear(integrand, size, state, _CLEAR.__getitem__, *_CLEAR_RANGES[RULES.index(rule)])
    tables = [_packets(F, numbers) for numbers in _TABLES[1:]]
    place = _TABLES.places[accuracy]
    if rule == "one_edge":
        # a loop over rows of as many points, without another one within them
        own = _TABLES.ranges[place[2] : place[2] + place[3]]
        rows = _Rows(*place, *tables)._replace(pairs=_TABLES.pairs.__getitem__)
        return _added(
            *(_sum_edge(integrand, size, state, _alike(rows, own, pairs)) for pairs in sorted(set(own)))
        )

    # the accuracy enters as opaque data, so that all share one kernel
    rows = _Rows(*(dr.opaque(UInt, x) for x in place), *tables)
    if rule == "both_edges":
        return _sum_wedge(integrand, size, state, True, False, rows)
    index = choose_rule(*_edges(geometry, sigma), sigma, steepness, accuracy, lambda x: dr.opaque(F, x))
    start, count = UInt(0), UInt(0)
    for j, (first, length) in enumerate(_CLEAR_RANGES):
        start = dr.select(index == j, UInt(first), start)
        count = dr.select(index == j, UInt(length), count)
    along = index == RULES.index("one_edge")
    return _added(
        _sum_clear(integrand, size, state, _packets(F, _CLEAR), start, count),
        _sum_wedge(integrand, size, state, along | (index == RULES.index("both_edges")), along, rows),
    )


def _alike(rows: _Rows, ranges: list[tuple[float, ...]], own: tuple[float, ...]) -> _Rows:
    """Those of the rows along one edge that have this range of pairs; they follow each other."""
    return rows._replace(
        first_along=rows.first_along + ranges.index(own),
        count_along=ranges.count(own),
        ranges=lambda _: own,
    )


def _pair(
    integrand: Callable[..., Any], u: Any, v: Any, inverse: Any, weight: Any, vectors: Any, args: Any
) -> list[Any]:
    """Two facets of slope u towards the viewer and ±v across, 1/√(1 + u² + v²) given: both see the same exit angle."""
    geometry = Geometry(*vectors)
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    mu_r = inverse * dr.fma(-u, geometry.sin_r, geometry.cos_r)
    q, twist = tilt_rotation(inverse * dr.fma(u, geometry.cos_r, geometry.sin_r), inverse * v)
    x, y = -u * cos_phi, -u * sin_phi
    sides = []
    # both are one where v is the number 0
    for turn, side in ((twist, v), (-twist, -v))[: 2 if dr.is_jit_v(v) or v else 1]:
        slopes = dr.fma(side, sin_phi, x), dr.fma(-side, cos_phi, y)
        sides.append(integrand(_facet(*slopes, inverse, geometry, mu_r, (q, turn)), geometry, args))
    return [weight * (a + b) for a, b in zip(sides[0], sides[-1], strict=True)]


def _facet(x: Any, y: Any, inverse: Any, geometry: Geometry, mu_r: Any, turn_r: Any) -> Facet:
    """A facet of slopes x and y, 1/√(1 + x² + y²) given, and what is known of it as seen by the viewer."""
    mu_i = inverse * dr.fma(-x, geometry.sin_i, geometry.cos_i)
    turn_i = tilt_rotation(inverse * dr.fma(x, geometry.cos_i, geometry.sin_i), -inverse * y)
    return Facet((x * inverse, y * inverse, inverse), mu_i, mu_r, turn_i, turn_r)


def _within(
    integrand: Callable[..., Any], x: Any, y: Any, inverse: Any, weight: Any, vectors: Any, args: Any
) -> list[Any]:
    """A facet of slopes x and y within the wedge, 1/√(1 + x² + y²) given."""
    geometry = Geometry(*vectors)
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    # slopes towards the viewer and across
    u, v = -dr.fma(x, cos_phi, y * sin_phi), dr.fma(x, sin_phi, -y * cos_phi)
    mu_r = inverse * dr.fma(-u, geometry.sin_r, geometry.cos_r)
    turn_r = tilt_rotation(inverse * dr.fma(u, geometry.cos_r, geometry.sin_r), inverse * v)
    facet = _facet(x, y, inverse, geometry, mu_r, turn_r)
    valid = (facet.mu_i > 0.0) & (mu_r > 0.0)  # but for rounding
    facet = facet._replace(mu_i=dr.select(valid, facet.mu_i, 1.0), mu_r=dr.select(valid, mu_r, 1.0))
    weight = dr.select(valid, weight, 0.0)
    return [weight * value for value in integrand(facet, geometry, args)]


def _added(*values: list[Any]) -> list[Any]:
    return [sum(x[1:], x[0]) for x in zip(*values, strict=True)]


def _sum_clear(
    integrand: Callable[..., Any], size: int, state: Any, points: Callable[[Any], Any], start: Any, count: Any
) -> list[Any]:
    """Pairs of points of the whole plane."""

    def pair(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        u, v, weight, length2 = points(start + j)
        inverse = dr.rsqrt(dr.fma(length2 * sigma, sigma, 1.0))
        v = sigma * v if dr.is_jit_v(v) or v else 0.0
        return _pair(integrand, sigma * u, v, inverse, weight, vectors, args)

    return summed(pair, count, size, state, label="facets")


class _Rows(NamedTuple):
    """Rows of an accuracy: the first between both edges, their number, the same along one edge, and the tables."""

    first: Any
    count: Any
    first_along: Any
    count_along: Any
    rows: Callable[[Any], Any]
    ranges: Callable[[Any], Any]
    pairs: Callable[[Any], Any]


# Where there are derivatives, the edges and axes are found anew in each row: their derivatives are then those by what
# they depend on.


def _sum_edge(integrand: Callable[..., Any], size: int, state: Any, rows: _Rows) -> list[Any]:
    """Rows along the nearer edge, as many points in each, in all lanes."""
    UInt = dr.uint32_array_t(type(state[0]))
    first, count = rows.ranges(0)

    def row(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        f, e, beyond = _edge_axes(sigma, vectors)
        below, above, weight, _ = rows.rows(rows.first_along + j)
        w, share = _between(below, above, 0.0, beyond)
        w = sigma * w

        def pair(j: Any, sigma: Any, vectors: Any, args: Any, row: Any) -> list[Any]:
            (x, y), length2, e, row_weight = row
            _, _, weight, v = rows.pairs(first + j)
            weight, v = row_weight * weight, sigma * v
            # e is perpendicular to (x, y)
            inverse = dr.rsqrt(dr.fma(v, v, length2))
            sides = ((dr.fma(e[0], side, x), dr.fma(e[1], side, y)) for side in (v, -v))
            return _added(*(_within(integrand, *slopes, inverse, weight, vectors, args) for slopes in sides))

        inner = sigma, vectors, args, ((w * f[0], w * f[1]), dr.fma(w, w, 1.0), e, weight * share)
        return summed(pair, count, size, inner, differentiated((sigma, vectors, args)), "edge pairs")

    return summed(row, UInt(rows.count_along), size, state, label="edge rows")


def _sum_wedge(
    integrand: Callable[..., Any], size: int, state: Any, lanes: Any, along: Any, rows: _Rows
) -> list[Any]:
    """Rows between both edges, or in the lanes ``along`` along the nearer one: one loop, which is compiled once.

    Where ``along`` is False, of all lanes, the two points of a pair are taken together, which is faster.
    """
    UInt = type(rows.count)
    begin = dr.select(along, rows.first_along, rows.first)
    number = dr.select(along, rows.count_along, rows.count)

    def axes(sigma: Any, vectors: Any) -> tuple[Any, ...]:
        geometry = Geometry(*vectors)
        return _wedge_axes(geometry, *_edges(geometry, sigma), along)

    known = None if differentiated(state) else axes(*state[:2])

    def row(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        f, e, beyond, lower, upper = known or axes(sigma, vectors)
        below, above, weight, _ = rows.rows(begin + j)
        first, count = (UInt(x) for x in rows.ranges(begin + j))
        w, share = _between(below, above, 0.0, beyond)
        ends = _tail(-dr.fma(lower[1], w, lower[0])), _tail(dr.fma(upper[1], w, upper[0]))
        ends = tuple(dr.select(along, 0.0, tail) for tail in ends)
        w = sigma * w

        def node(row: Any, v: Any, weight: Any, vectors: Any, args: Any) -> list[Any]:
            (x, y), length2, e, row_weight, _ = row
            inverse = dr.rsqrt(dr.fma(v, v, length2))
            slopes = dr.fma(e[0], v, x), dr.fma(e[1], v, y)
            return _within(integrand, *slopes, inverse, row_weight * weight, vectors, args)

        def point(j: Any, sigma: Any, vectors: Any, args: Any, row: Any) -> list[Any]:
            # of the two of a pair one by one: what is compiled is shorter
            below, above, weight, whole = rows.pairs(first + (j >> 1))
            odd = (j & 1) == 1
            v, share = _between(dr.select(odd, above, below), dr.select(odd, below, above), *row[-1])
            v = sigma * dr.select(along, dr.select(odd, -whole, whole), v)
            return node(row, v, weight * share, vectors, args)

        def pair(j: Any, sigma: Any, vectors: Any, args: Any, row: Any) -> list[Any]:
            below, above, weight, _ = rows.pairs(first + j)
            found = []
            for tails in ((below, above), (above, below)):
                v, share = _between(*tails, *row[-1])
                found.append(node(row, sigma * v, weight * share, vectors, args))
            return _added(*found)

        inner = sigma, vectors, args, ((w * f[0], w * f[1]), dr.fma(w, w, 1.0), e, weight * share, ends)
        by = differentiated((sigma, vectors, args))
        if along is False:
            return summed(pair, count, size, inner, by, "row pairs")
        return summed(point, 2 * count, size, inner, by, "row points")

    return summed(row, dr.select(lanes, number, UInt(0)), size, state, label="rows")


def _packet_average(
    integrand: Callable[..., Any], size: int, geometry: Geometry, sigma: Any, args: Any
) -> list[Any]:
    """The rule ``packet``: as many rows along the nearer edge in nearly all lanes, between both edges in the others."""
    F = type(sigma)
    UInt = dr.uint32_array_t(F)
    state = sigma, tuple(geometry), args
    edge_rows = _packets(F, [(_phi(z), _phi(-z), weight, 0.0) for z, weight in _PACKET_ROWS])

    known = None if differentiated(state) else _edge_axes(*state[:2])

    def row(j: Any, sigma: Any, vectors: Any, args: Any) -> list[Any]:
        f, e, beyond = known or _edge_axes(sigma, vectors)
        below, above, row_weight, _ = edge_rows(j)
        w, share = _between(below, above, 0.0, beyond)
        w, row_weight = sigma * w, share * row_weight
        x, y, length2 = w * f[0], w * f[1], dr.fma(w, w, 1.0)
        found = []
        for v, weight in _PACKET_PAIRS:
            v = sigma * v
            inverse = dr.rsqrt(dr.fma(v, v, length2))
            for side in (v, -v):
                slopes = dr.fma(e[0], side, x), dr.fma(e[1], side, y)
                found.append(_within(integrand, *slopes, inverse, row_weight * weight, vectors, args))
        return _added(*found)

    c_far = dr.maximum(*_edges(geometry, sigma))
    one_edge = c_far > _PACKET_FAR
    count = dr.select(one_edge, UInt(len(_PACKET_ROWS)), UInt(0))
    along = summed(row, count, size, state, label="packet rows")
    places = zip(_TABLES.places[PACKET_RULE], _TABLES.places["default"], strict=True)
    level = (dr.select(c_far > _PACKET_COARSE, UInt(few), UInt(many)) for few, many in places)
    rows = _Rows(*level, *(_packets(F, numbers) for numbers in _TABLES[1:]))
    return _added(along, _sum_wedge(integrand, size, state, c_far <= _PACKET_FAR, False, rows))


_MILLS_NUMERATOR = (
    1.25331413729191,
    1.22693620522328,
    0.588547556159811,
    0.162228791476981,
    0.0255232844587275,
    0.00185705961251411,
)
_MILLS_DENOMINATOR = (
    1.0,
    1.77683801405806,
    1.3873046605167,
    0.61389110696835,
    0.164097870514857,
    0.0255227910158189,
    0.00185706893118594,
)


def _tail(x: Any) -> Any:
    """1 − Φ(x), ends at ±9; relative error 2e-11 for x > 0 (minimax)."""
    place = dr.detach(x)
    t = dr.minimum(dr.abs(place), _REACH)
    ratio = polynomial(t, _MILLS_NUMERATOR) / polynomial(t, _MILLS_DENOMINATOR)
    density = (1.0 / math.sqrt(2.0 * math.pi)) * exp2((-0.5 / _LN2) * t * t)
    tail = density * ratio
    return with_slope(dr.select(place < 0.0, 1.0 - tail, tail), x, lambda: -density)


_SLOPE_NUMERATOR = (
    -3.43760451973217,
    -18.438503171531,
    -9.69881617592677,
    13.2296727606752,
    7.92947712010424,
    0.777710450327081,
)
_SLOPE_DENOMINATOR = (
    1.0,
    9.38584347737195,
    16.533558085708,
    7.96195665155451,
    0.777140343555566,
    6.82996118313344e-06,
)

#: The same in single precision: absolute error 6e-6 within ±6 (minimax).
_SINGLE_NUMERATOR = (-2.85858608, -2.0104773, 2.65279296, 0.9485245)
_SINGLE_DENOMINATOR = (1.0, 2.74584828, 0.9462086)


def _between(below: Any, above: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Map a normal variable z onto one between two bounds.

    Parameters
    ----------
    below, above
        Φ(z) and 1 − Φ(z).
    low, high
        Probability below the lower bound and above the upper one.

    Returns
    -------
    x, share
        Point between the bounds, absolute error 4e-10 (minimax) within ±9, in single precision without derivatives 6e-6
        within ±6; probability between the bounds.
    """
    share = dr.maximum((1.0 - low) - high, 0.0)
    left, right = dr.fma(share, below, low), dr.fma(share, above, high)
    # x with the smaller of the two tails p, as a rational function of √(−2 log p)
    lower = left < right
    p = dr.select(lower, left, right)
    single = is_single(p) and not dr.grad_enabled(p)
    least = 1e-9 if single else 1e-18
    p = dr.select(p < least, least, dr.select(p > 0.5, 0.5, p))
    t = dr.sqrt((-2.0 * _LN2) * log2(dr.detach(p)))
    if single:
        x = polynomial(t, _SINGLE_NUMERATOR) / polynomial(t, _SINGLE_DENOMINATOR)
    else:
        x = polynomial(t, _SLOPE_NUMERATOR) / polynomial(t, _SLOPE_DENOMINATOR)
        # that of the normal distribution, which is shorter than that of the rational function
        x = with_slope(
            x, p, lambda: -math.sqrt(2.0 * math.pi) * exp2((0.5 / _LN2) * dr.detach(x) * dr.detach(x))
        )
    return dr.select(lower, -x, x), share


def _transported_average(
    integrand: Callable[..., tuple[Any, ...]],
    size: int,
    geometry: Geometry,
    sigma: Any,
    args: tuple[Any, ...],
) -> list[Any]:
    """Average with the few nodes of :mod:`pbrdf.optics.transport`."""
    c_i, c_r = _edges(geometry, sigma)
    total: list[Any] = [0.0] * size
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    mirror = dr.select(sin_phi < 0.0, -1.0, 1.0)
    across, turned_cosine = mirror * sin_phi, mirror * cos_phi
    for row in transported_rows(c_r, c_i, -cos_phi, across):
        u = sigma * row.u
        length2 = dr.fma(u, u, 1.0)
        # one exit angle for the whole row, that of the mean square across
        mu_r = dr.fma(-u, geometry.sin_r, geometry.cos_r) * dr.rsqrt(dr.fma(sigma, sigma, length2))
        mu_r = dr.maximum(mu_r, 1e-6)
        along = dr.fma(u, geometry.cos_r, geometry.sin_r)
        for v, weight in row.nodes:
            v = sigma * v
            x, y = dr.fma(-u, cos_phi, across * v), dr.fma(-u, sin_phi, -turned_cosine * v)
            inverse = dr.rsqrt(dr.fma(v, v, length2))
            q, twist = tilt_rotation(inverse * along, inverse * v)
            facet = _facet(x, y, inverse, geometry, mu_r, (q, mirror * twist))
            facet = facet._replace(mu_i=dr.maximum(facet.mu_i, 1e-6))
            values = integrand(facet, geometry, args)
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


def _edge_axes(sigma: Any, vectors: Any) -> tuple[Any, ...]:
    """Axes across and along the nearer edge, and the probability beyond it."""
    geometry = Geometry(*vectors)
    (f, e), c_near, *_ = _nearer_edge_axes(geometry, *_edges(geometry, sigma))
    return f, e, _tail(c_near)


def _wedge_axes(geometry: Geometry, c_i: Any, c_r: Any, along: Any) -> tuple[Any, ...]:
    """Outer axis f, inner axis e, probability beyond the outer limit, inner limits (constant, slope in the outer).

    The inner axis is the nearer edge's where ``along``, else where that edge is the outer limit.
    """
    cos_phi, sin_phi = -geometry.s_r[1], geometry.s_r[0]
    cos_d = -cos_phi  # a_i·a_r
    same_side = along | (cos_d >= -1e-9)  # at a right angle, whichever way it is rounded

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
    beyond = _tail(choose(c_near, corner))
    lower = (choose(-_FAR, -c_r / S), choose(0.0, C / S))
    upper = (choose(c_far * inverse, c_i / S), choose(-cos_d * inverse, -C / S))
    return f, e, beyond, lower, upper
