"""Body light through the facets, paper eqs (11)-(13): exit and entry polarisation, ``visible_means``."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad
from scipy.special import beta, betainc

import independent as ref
from pbrdf.optics.geometry import geometry_from_angles
from pbrdf.optics.transmission import _tail, _tail_coefficients, visible_means

#: θ_i, θ_r, φ in degrees, k
CASES = [
    (47, 3.4, 73, 0.70), (4.2, 28, -162, 0.76), (76, 52, 5, 0.77), (20, 60, 0, 1.25),
    (60, 50, 180, 0.8), (35, 60, 0, 2.64), (85, 80, 100, 0.6), (89, 20, -30, 1.0), (50, 80, 0, 1.16),
    (1, 1, 40, 2.0), (30, 30, 179, 1.5), (60, 60, 180, 1.0), (60, 60, 180, 2.64), (0, 0, 0, 1.2),
]  # fmt: skip


@pytest.fixture(scope="module")
def means(jit):
    def function(theta_i, theta_r, phi, k, accuracy="high"):
        area, integral = visible_means(
            geometry_from_angles(jit(theta_i), jit(theta_r), jit(phi)), jit(k), accuracy
        )
        return area.numpy(), integral.numpy()

    return function


def test_visible_means_against_raw_vectors(means):
    """∫dω and ∫W dω of the letter of eq. (13), from m·ω_i and m·ω_r on a product tanh-sinh grid: 1e-9."""
    angles, k = np.radians([c[:3] for c in CASES]).T, np.array([c[3] for c in CASES])
    area, integral = means(*angles, k)
    expected = np.array([ref.visible_integrals(*np.radians(c[:3]), c[3]) for c in CASES])
    np.testing.assert_allclose(area, expected[:, 0], rtol=1e-9)
    np.testing.assert_allclose(integral, expected[:, 1], rtol=1e-9)


@pytest.mark.parametrize("case", [(47, 3.4, 73, 0.70), (60, 60, 150, 1.6)], ids=str)
def test_visible_means_against_adaptive_integration_about_the_source(means, case):
    """A third route: SciPy's adaptive quad in polar coordinates about ω_i, nothing shared with the other two.

    m = (μ, azimuth) about ω_i; at given μ = μ_i', the seen facets and those of the upper hemisphere are two
    arcs. The integrand's end points (μ_r')^(k−1) and μ^(k−1) are taken by substitutions.
    """
    theta_i, theta_r, phi = np.radians(case[:3])
    k = case[3]
    w_i, w_r = ref.rays(theta_i, theta_r, phi)
    e1 = w_r - (w_r @ w_i) * w_i
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(w_i, e1)
    cos_b, sin_b = w_r @ w_i, w_r @ e1
    z = np.array([0, 0, 1.0])
    up, up_azimuth = np.hypot(z @ e1, z @ e2), np.arctan2(z @ e2, z @ e1)

    def arc(mu, across, along, centre):
        """Interval of azimuths where μ·along + √(1−μ²)·across·cos(a − centre) > 0."""
        x = -mu * along / max(np.sqrt(1 - mu * mu) * across, 1e-300)
        return centre - np.arccos(np.clip(x, -1, 1)), centre + np.arccos(np.clip(x, -1, 1))

    x, w = np.polynomial.legendre.leggauss(60)

    def inner(u):
        mu = u**4  # takes μ^(k−1)
        low, high = arc(mu, sin_b, cos_b, 0.0)
        up_low, up_high = arc(mu, up, np.cos(theta_i), up_azimuth)
        total = 0.0
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            a, b = max(low, up_low + turn), min(high, up_high + turn)
            for end, far in ((a, 0.5 * (a + b)), (b, 0.5 * (a + b))):
                if b > a:
                    s = (0.5 * (x + 1)) ** 4  # takes (μ_r')^(k−1) at the arc's end
                    ds = 4 * (0.5 * (x + 1)) ** 3 * 0.5 * w
                    az = end + (far - end) * s
                    mu_r = mu * cos_b + np.sqrt(1 - mu * mu) * sin_b * np.cos(az)
                    total += abs(far - end) * (ds * ref.shape(mu, np.maximum(mu_r, 1e-15), k)).sum()
        return total * 4 * u**3

    expected, _ = quad(inner, 0, 1, epsabs=1e-9, epsrel=1e-9, limit=400)
    _, integral = means(*(np.full(2, v) for v in (theta_i, theta_r, phi, k)))
    assert integral[0] == pytest.approx(expected, rel=2e-7)


@given(arrays(float, (3, 64), elements=st.floats(0.0, 0.999)))
def test_solid_angle_of_lit_and_seen_facets(means, unit):
    """∫dω is a spherical triangle, 2π less the angles between the three axes; k = 1 makes ∫W dω the same."""
    theta_i, theta_r, phi = np.pi / 2 * unit[0], np.pi / 2 * unit[1], np.pi * (2 * unit[2] - 1)
    area, integral = means(theta_i, theta_r, phi, np.ones(64))
    w_i, w_r = ref.rays(theta_i, theta_r, phi)
    between = np.arctan2(np.linalg.norm(np.cross(w_i, w_r), axis=-1), (w_i * w_r).sum(-1))
    np.testing.assert_allclose(area, 2 * np.pi - theta_i - theta_r - between, atol=1e-9)
    # its shortest side limits how thin a triangle the rule can meet: nearly opposite grazing rays
    fat = area > 0.05
    np.testing.assert_allclose(integral[fat], area[fat], rtol=1e-6)


@pytest.mark.parametrize(
    "k",
    [0.8, 1.0, 1.5, 2.64, 4.0, 8.0, 20.0],
)
def test_normal_incidence_and_view_in_closed_form(means, k):
    """θ_i = θ_r = 0: W = (2μ³)^(k−1), so ∫W dω = 2π 2^(k−1)/(3k − 2); it diverges for k ≤ 2/3."""
    _, integral = means(np.zeros(2), np.zeros(2), np.zeros(2), np.full(2, k))
    np.testing.assert_allclose(integral, 2 * np.pi * 2 ** (k - 1) / (3 * k - 2), rtol=1e-8)


@pytest.mark.parametrize(
    ("k", "expected"),
    [
        (1.1627, (1.33, 1.31, 1.25, 1.27, 1.16)),
        (1.3759, (1.76, 1.72, 1.58, 1.62, 1.33)),
        (1.2504, (1.51, 1.47, 1.39, 1.41, 1.24)),
        (2.6395, (3.87, 4.31, 3.21, 3.76, 1.61)),
        (1.1945, (1.39, 1.37, 1.30, 1.32, 1.19)),
        (2.0, (2.90, 2.99, 2.45, 2.67, 1.59)),
    ],
)
def test_smooth_limit_factor_of_literature_3d(means, k, expected):
    """g = W(flat facet) ∫dω/∫W dω at (θ_i, θ_r) = (35, 0), (35, 35), (35, 60), (60, 60), (50, 80)°, in plane.

    The table is right to one unit of its last printed digit (the integral itself is checked to 1e-9 above).
    """
    theta_i, theta_r = np.radians([35, 35, 35, 60, 50.0]), np.radians([0, 35, 60, 60, 80.0])
    area, integral = means(theta_i, theta_r, np.zeros(5), np.full(5, k))
    g = ref.shape(np.cos(theta_i), np.cos(theta_r), k) * area / integral
    np.testing.assert_allclose(g, expected, atol=0.0101)


@pytest.mark.parametrize(
    ("accuracy", "range_of_k", "tolerance"),
    [
        ("default", (0.7, 4.0), 1e-5),
        ("default", (4.0, 20.0), 3e-5),
        ("fast", (0.7, 3.0), 2e-4),
        ("fast", (3.0, 20.0), 4e-4),
        ("draft", (0.7, 4.0), 5e-3),
        ("draft", (4.0, 20.0), 2e-2),
    ],
)
@pytest.mark.parametrize("where", ["anywhere", "near the source", "near the plane", "near the normal"])
def test_means_agree_with_high(means, accuracy, range_of_k, tolerance, where):
    """Greatest error of the normaliser at θ ≤ 75°, also where the horizon is a step or zeros of W lie side by side."""
    rng = np.random.default_rng(4)
    theta_i, theta_r = np.radians(75) * rng.random((2, 2000))
    phi = np.pi * rng.random(2000)
    near = 10.0 ** rng.uniform(-3.0, -1.0, (2, 2000))
    if where == "near the source":
        theta_r, phi = np.abs(theta_i - near[0]), np.pi - near[1]
    elif where == "near the plane":
        phi = np.where(rng.random(2000) < 0.5, near[0], np.pi - near[0])
    elif where == "near the normal":
        theta_i = near[0]
    k = rng.uniform(*range_of_k, 2000)
    found, expected = (means(theta_i, theta_r, phi, k, a)[1] for a in (accuracy, "high"))
    np.testing.assert_allclose(found, expected, rtol=tolerance)


@pytest.mark.parametrize("a", [-0.9, -0.5, 0.0, 1.0, 5.0, 28.5])
def test_polynomial_of_the_incomplete_beta_function(jit, a):
    """∫ₓ¹ (1 − t²)^a dt with the degree of ``high``, to 1e-8 of the whole."""
    x = np.linspace(0.0, 1.0, 50)[:-1]
    y = 1.0 - x * x
    tail = _tail(jit(1.0 - x), jit(y), jit(a), _tail_coefficients(jit(a), 18)).numpy()
    whole = beta(0.5, a + 1.0)
    np.testing.assert_allclose(tail / whole, 0.5 * betainc(a + 1.0, 0.5, y), atol=1e-8)
