"""The double-Gauss pBRDF in plain NumPy: a peer for ``benchmarks/evaluation.py``.

Written from the equations of the paper and independent of pbrdf's code, for a dielectric coating in
the readings ``weighted`` and ``flux``. Vectorised over the directions and the facets together, in blocks of
a size that was found to be the fastest; the rules for the facets are those of pbrdf's default accuracy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

__all__ = ["Paint", "Rule", "mueller"]

#: An edge of the wedge this many standard deviations out is out of reach.
FAR = 50.0
#: Evaluations of the integrand in a block: large enough to hide the overhead of NumPy's calls, small enough
#: for the processor's cache and for memory that the allocator hands out again without asking the system.
BLOCK = 12 * 4096


class Paint(NamedTuple):
    """Parameters of the model."""

    sigma: float
    n: float
    a: float
    k: float
    b: float
    t: float


class Rule(NamedTuple):
    r"""When to use which rule for the facets, and the trapezoidal rule where edges cut in.

    Attributes
    ----------
    clear_7, clear_12, clear_26
        Distances of the nearer edge, in standard deviations of slope, beyond which 7, 12 or 26 points do.
    far
        Distance beyond which the farther edge is ignored.
    rough
        Largest σ for which edges are ignored.
    spread_7, slope_7, spread_12, slope_12
        7 and 12 points do only beyond spread·√σ and beyond \|k − 1\| σ^{3/2}/slope.
    step, half
        Step, and half the number of nodes an axis.
    four, two
        Rows along one edge have four points, up to this one from the middle, then two.
    """

    clear_7: float
    clear_12: float
    clear_26: float
    far: float
    rough: float
    spread_7: float
    slope_7: float
    spread_12: float
    slope_12: float
    step: float
    half: int
    four: int
    two: int


class Directions(NamedTuple):
    """Directions and (p, s) frames of a block of geometries; every entry an array."""

    sin_i: np.ndarray
    cos_i: np.ndarray
    sin_r: np.ndarray
    cos_r: np.ndarray
    sin_phi: np.ndarray
    cos_phi: np.ndarray

    def take(self, index: np.ndarray) -> Directions:
        """Select some of the geometries."""
        return Directions(*(value[index] for value in self))


def mueller(
    theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray, paint: Paint, rule: Rule
) -> np.ndarray:
    """Mueller matrices (1/sr) for one-dimensional arrays of angles in radians, shape (N, 4, 4)."""
    result = np.zeros((theta_i.size, 4, 4))
    step = BLOCK // 12
    for start in range(0, theta_i.size, step):
        block = slice(start, start + step)
        angles = (theta_i[block], theta_r[block], phi[block])
        d = Directions(*(f(angle) for angle in angles for f in (np.sin, np.cos)))
        _set_specular(result[block], d, paint)
        _add_diffuse(result[block], d, paint, rule)
    return result


def _cubatures() -> tuple[tuple[np.ndarray, ...], ...]:
    """Nodes u (against the viewer's azimuth), v and weights for the normal density, as columns.

    Stroud's E2(r²) 5-1 and 7-1, and 5 Gauss-Hermite rows of 4, 6, 6, 6 and 4 points.
    """
    root3, r = np.sqrt(3.0), np.sqrt(6.0)
    seven = np.array([0, 0, 0, *(root3, root3, -root3, -root3)]), np.array([0, 2, -2, *(1, -1, 1, -1)])
    s, t = np.sqrt((9.0 - 3.0 * np.sqrt(5.0)) / 4.0), np.sqrt((9.0 + 3.0 * np.sqrt(5.0)) / 4.0)
    x = np.array([r, -r, 0.0, 0.0, s, s, -s, -s, t, t, -t, -t])
    y = np.array([0.0, 0.0, r, -r, s, -s, s, -s, t, -t, t, -t])
    w_s, w_t = (5.0 + 2.0 * np.sqrt(5.0)) / 45.0, (5.0 - 2.0 * np.sqrt(5.0)) / 45.0
    rows = []
    for u, w in zip(*_hermite(5), strict=True):
        v, w_v = _hermite(4 if abs(u) > 2.0 else 6)
        rows.append((np.full(v.size, u), v, w * w_v))
    return (
        tuple(a[:, None] for a in (*seven, np.array([0.5, *(1.0 / 12.0,) * 6]))),
        tuple(a[:, None] for a in (x, y, np.repeat([1.0 / 36.0, w_s, w_t], 4))),
        tuple(np.concatenate(column)[:, None] for column in zip(*rows, strict=True)),
    )


def _hermite(count: int) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.hermite_e.hermegauss(count)
    return x, w / w.sum()


def _facet_sums(
    d: Directions, paint: Paint, x: np.ndarray, y: np.ndarray, weight: np.ndarray, clear: bool
) -> np.ndarray:
    """Sums over the facets (first axis) of W, W T₊, W T₋ cos2χ and W T₋ sin2χ.

    ``clear`` says that all facets are lit and seen.
    """
    slope_x, slope_y = paint.sigma * x, paint.sigma * y
    m_z = 1.0 / np.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    m_x, m_y = slope_x * m_z, slope_y * m_z
    along = m_x * d.cos_phi + m_y * d.sin_phi  # in the plane of the reflected ray
    mu_i = m_z * d.cos_i - m_x * d.sin_i
    mu_r = m_z * d.cos_r + along * d.sin_r
    if not clear:
        hidden = (mu_i <= 0.0) | (mu_r <= 0.0)
        mu_i[hidden] = mu_r[hidden] = 1.0
        weight = np.where(hidden, 0.0, weight)
    W = (mu_i + mu_r) * mu_i
    W *= mu_r
    np.log(W, out=W)
    W *= paint.k - 1.0
    np.exp(W, out=W)
    W *= weight
    # Fresnel: T_s = 4cq/(c + q)², (T_p − T_s)/2 = half·sin²β with q² = ε − sin²β
    eps = paint.n**2
    sin2 = 1.0 - mu_r * mu_r
    q = np.sqrt(eps - sin2)
    sum_s = mu_r + q
    T_s = mu_r * q
    T_s *= 4.0
    T_s /= sum_s * sum_s
    ratio = (eps - 1.0) / (eps * mu_r + q)
    half = ratio * ratio
    half *= T_s
    half *= 0.5
    sin2 *= half
    sin2 += T_s  # T₊
    sin2 *= W
    half *= W
    # sin²β cos2χ and sin²β sin2χ, χ the turn from the surface's to the facet's frame
    along_p = m_z * d.sin_r - along * d.cos_r
    along_s = m_x * d.sin_phi - m_y * d.cos_phi
    u = along_p * along_s
    u *= 2.0 * half
    along_p *= along_p
    along_s *= along_s
    along_p -= along_s
    along_p *= half
    return np.stack([W.sum(0), sin2.sum(0), along_p.sum(0), u.sum(0)])


def _between(z: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map z to Φ⁻¹[Φ(low) + (Φ(high) − Φ(low)) Φ(z)]; that point and Φ(high) − Φ(low)."""
    below, above = ndtr(low), ndtr(-high)
    share = np.maximum(1.0 - below - above, 0.0)
    left, right = below + share * ndtr(z), above + share * ndtr(-z)
    tail = np.clip(np.minimum(left, right), 1e-18, 0.5)
    return np.copysign(ndtri(tail), left - right), share


def _trapezoid(step: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    z = step * (np.arange(count) - 0.5 * (count - 1))
    w = np.exp(-0.5 * z * z)
    return z, w / w.sum()


def _edge_axis(d: Directions, c_i: np.ndarray, c_r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction of slope across the nearer edge, and whether that is the edge of the lit facets."""
    nearer_i = c_i <= c_r
    return np.where(nearer_i, 1.0, -d.cos_phi), np.where(nearer_i, 0.0, -d.sin_phi), nearer_i


def _edge_sums(d: Directions, paint: Paint, rule: Rule, c_i: np.ndarray, c_r: np.ndarray) -> np.ndarray:
    """Rows along the nearer edge, the only one."""
    f_x, f_y, _ = _edge_axis(d, c_i, c_r)
    sums = np.zeros((4, c_i.size))
    rows = np.arange(-rule.half, rule.half + 1)
    for j, z, weight in zip(rows, *_trapezoid(rule.step, rows.size), strict=True):
        if abs(j) > rule.two:
            continue
        w, share = _between(z, np.full(c_i.size, -FAR), np.minimum(c_i, c_r))
        v, w_v = (column[:, None] for column in _hermite(4 if abs(j) <= rule.four else 2))
        sums += _facet_sums(d, paint, f_x * w - f_y * v, f_y * w + f_x * v, weight * share * w_v, clear=False)
    return sums


def _wedge_sums(d: Directions, paint: Paint, rule: Rule, c_i: np.ndarray, c_r: np.ndarray) -> np.ndarray:
    """Rows in the wedge x < c_i, −(x cosφ + y sinφ) < c_r."""
    # Opposite sides: the outer axis f runs into the corner, the inner axis e across the wedge. Same side: f
    # runs across the nearer edge, the farther one bounds e from above.
    # The wedge is w < w_max, low_0 + low_1 w < v < high_0 + high_1 w.
    opposite = d.cos_phi > 0.0
    cos_half = np.sqrt(0.5 * np.where(opposite, 1.0 + d.cos_phi, 1.0))
    sin_half = 0.5 * d.sin_phi / cos_half
    C = np.maximum(np.abs(sin_half), 1e-12)
    inverse = 1.0 / np.maximum(np.abs(d.sin_phi), 1e-12)
    e_x, e_y = cos_half, sin_half
    sign = np.where(sin_half > 0.0, 1.0, -1.0)
    f_x, f_y = sign * sin_half, -sign * cos_half
    same_f_x, same_f_y, nearer_i = _edge_axis(d, c_i, c_r)
    turn = np.where((d.sin_phi > 0.0) == nearer_i, -1.0, 1.0)
    e_x, e_y = np.where(opposite, e_x, -turn * same_f_y), np.where(opposite, e_y, turn * same_f_x)
    f_x, f_y = np.where(opposite, f_x, same_f_x), np.where(opposite, f_y, same_f_y)
    w_max = np.where(opposite, 0.5 * (c_i + c_r) / C, np.minimum(c_i, c_r))
    low_0, low_1 = np.where(opposite, -c_r / cos_half, -FAR), np.where(opposite, C / cos_half, 0.0)
    high_0 = np.where(opposite, c_i / cos_half, np.maximum(c_i, c_r) * inverse)
    high_1 = np.where(opposite, -C / cos_half, d.cos_phi * inverse)

    sums = np.zeros((4, c_i.size))
    rows = np.arange(-rule.half, rule.half + 1)
    columns, column_weights = _trapezoid(rule.step, 2 * rule.half)
    for j, z, weight in zip(rows, *_trapezoid(rule.step, rows.size), strict=True):
        inside = j * j + (columns / rule.step) ** 2 <= (rule.half + 0.4) ** 2
        w, share = _between(z, np.full(c_i.size, -FAR), w_max)
        v, inner_share = _between(columns[inside, None], low_0 + low_1 * w, high_0 + high_1 * w)
        node_weights = weight * share * inner_share * column_weights[inside, None]
        sums += _facet_sums(d, paint, f_x * w + e_x * v, f_y * w + e_y * v, node_weights, clear=False)
    return sums


def _clear_sums(d: Directions, paint: Paint, points: tuple[np.ndarray, ...]) -> np.ndarray:
    """A cubature of the whole plane, turned to the viewer."""
    u, v, weight = points
    return _facet_sums(
        d, paint, v * d.sin_phi - u * d.cos_phi, -u * d.sin_phi - v * d.cos_phi, weight, clear=True
    )


def _add_diffuse(f: np.ndarray, d: Directions, paint: Paint, rule: Rule) -> None:
    """Add the diffuse part, eqs (9)-(13), to the first column."""
    c_i = d.cos_i / np.maximum(paint.sigma * d.sin_i, d.cos_i / FAR)
    c_r = d.cos_r / np.maximum(paint.sigma * d.sin_r, d.cos_r / FAR)
    nearer, farther = np.minimum(c_i, c_r), np.maximum(c_i, c_r)
    root, steep = np.sqrt(paint.sigma), abs(paint.k - 1.0) * paint.sigma**1.5
    limits = (
        max(rule.clear_7, rule.spread_7 * root, steep / rule.slope_7),
        max(rule.clear_12, rule.spread_12 * root, steep / rule.slope_12),
        rule.clear_26,
    )
    masks = [nearer > limit for limit in limits] + [farther > rule.far]
    chosen = np.select(masks, range(4), 4) if paint.sigma <= rule.rough else np.full(c_i.size, 4)
    sums = np.empty((4, c_i.size))
    for j in np.unique(chosen):
        index = np.flatnonzero(chosen == j)
        part, near, other = (
            (d, c_i, c_r) if index.size == chosen.size else (d.take(index), c_i[index], c_r[index])
        )
        if j < 3:
            sums[:, index] = _clear_sums(part, paint, CUBATURES[j])
        else:
            sums[:, index] = (_edge_sums if j == 3 else _wedge_sums)(part, paint, rule, near, other)
    shape, intensity, q, u = sums
    cos_scattering = d.sin_i * d.sin_r * d.cos_phi - d.cos_i * d.cos_r
    f_rpv = (paint.a / np.pi) * np.exp(
        (paint.k - 1.0) * np.log((d.cos_i + d.cos_r) * d.cos_i * d.cos_r) + paint.b * cos_scattering
    )
    polarised = f_rpv * paint.t / shape
    f[:, 0, 0] += f_rpv * (1.0 - paint.t) + polarised * intensity
    f[:, 1, 0] += polarised * q
    f[:, 2, 0] += polarised * u


CUBATURES = _cubatures()


def _set_specular(f: np.ndarray, d: Directions, paint: Paint) -> None:
    """Write the specular part, eqs (2)-(8)."""
    h_x, h_y, h_z = d.sin_r * d.cos_phi - d.sin_i, d.sin_r * d.sin_phi, d.cos_i + d.cos_r
    tilt2 = h_x * h_x + h_y * h_y
    scale_h = 1.0 / np.sqrt(tilt2 + h_z * h_z)
    cos_theta = h_z * scale_h
    cos_beta = (d.cos_i * h_z - d.sin_i * h_x) * scale_h
    P = np.exp((-0.5 / paint.sigma**2) * tilt2 / (h_z * h_z))
    P /= 2.0 * np.pi * paint.sigma**2 * cos_theta**3
    G = np.minimum(1.0, 2.0 * cos_theta * np.minimum(d.cos_i, d.cos_r) / cos_beta)
    scale = P * G / (4.0 * cos_theta * d.cos_i * d.cos_r)

    eps = paint.n**2
    q = np.sqrt(eps - (1.0 - cos_beta * cos_beta))
    r_s = (cos_beta - q) / (cos_beta + q)
    r_p = (eps * cos_beta - q) / (eps * cos_beta + q)
    R_s, R_p = r_s * r_s, r_p * r_p
    A, B, C = 0.5 * scale * (R_p + R_s), 0.5 * scale * (R_p - R_s), scale * r_p * r_s

    # ω_r × ω_i is the facet's s direction for both rays; at exact backscatter any direction will do
    s_x = d.sin_r * d.sin_phi * d.cos_i
    s_y = -d.cos_r * d.sin_i - d.sin_r * d.cos_phi * d.cos_i
    s_z = d.sin_r * d.sin_phi * d.sin_i
    degenerate = s_x * s_x + s_y * s_y + s_z * s_z < 1e-30
    s_y[degenerate] = -1.0
    s_x[degenerate] = s_z[degenerate] = 0.0
    c1, s1 = _double_angle(-s_y, -(d.cos_i * s_x + d.sin_i * s_z))
    c2, s2 = _double_angle(
        d.sin_phi * s_x - d.cos_phi * s_y,
        d.cos_r * (d.cos_phi * s_x + d.sin_phi * s_y) - d.sin_r * s_z,
    )
    f[:, 0, 0] = A
    f[:, 0, 1] = B * c1
    f[:, 0, 2] = B * s1
    f[:, 1, 0] = B * c2
    f[:, 1, 1] = A * c1 * c2 + C * s1 * s2
    f[:, 1, 2] = A * s1 * c2 - C * c1 * s2
    f[:, 2, 0] = B * s2
    f[:, 2, 1] = A * c1 * s2 - C * s1 * c2
    f[:, 2, 2] = A * s1 * s2 + C * c1 * c2
    f[:, 3, 3] = C


def _double_angle(c: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """cos2χ and sin2χ from c ∝ cosχ and d ∝ sinχ."""
    scale = 1.0 / (c * c + d * d)
    return (c * c - d * d) * scale, 2.0 * c * d * scale
