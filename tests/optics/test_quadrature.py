"""Averages over the lit and seen facets against independent integrals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import norm

import independent as ref
from pbrdf.models import DoubleGauss
from pbrdf.optics import quadrature
from pbrdf.optics.diffuse import minnaert_shape
from pbrdf.optics.geometry import geometry_from_angles
from pbrdf.optics.quadrature import RULES, choose_rule, facet_average, wedge_distance

#: θ_i, θ_r, φ in degrees, σ, k: both rays near grazing on the same and on opposite sides, rough, nearly flat
HARD = [
    (85, 80, 10, 0.2, 1.25),
    (85, 80, 170, 0.2, 1.25),
    (89.5, 60, 90, 0.3, 0.8),
    (80, 80, 180, 0.5, 2.6),
    (70, 75, 0, 0.6, 0.7),
    (89.9, 89.9, 120, 0.1, 1.6),
    (0, 85, 45, 0.3, 3.0),
]
IDS = ["-".join(map(str, h)) for h in HARD]


@pytest.fixture(scope="module")
def average(jit):
    """(θ_i, θ_r, φ, σ, k, accuracy) → ∫P, ∫P W, ∫P W m_x, ∫P W m_x m_y over lit and seen facets, (4, N)."""

    def integrand(facet, geometry, args):
        m, W = facet.normal, minnaert_shape(facet.mu_i, facet.mu_r, args[0])
        return 1.0, W, W * m[0], W * m[0] * m[1]

    def function(theta_i, theta_r, phi, sigma, k, accuracy="default"):
        size = max(map(np.size, (theta_i, theta_r, phi, sigma, k)))
        theta_i, theta_r, phi, sigma, k = (
            jit(np.broadcast_to(x, (size,))) for x in (theta_i, theta_r, phi, sigma, k)
        )
        g = geometry_from_angles(theta_i, theta_r, phi)
        steepness = 6.0 * abs(k - 1.0)
        return np.array([x.numpy() for x in facet_average(integrand, 4, g, sigma, (k,), accuracy, steepness)])

    return function


def reference(theta_i, theta_r, phi, sigma, k):
    m, mu_i, mu_r, w = ref.slope_nodes(theta_i, theta_r, phi, sigma)
    wW = w * ref.shape(mu_i, mu_r, k)
    return np.array([w.sum(), wW.sum(), wW @ m[:, 0], wW @ (m[:, 0] * m[:, 1])])


@pytest.mark.parametrize("case", HARD[:3], ids=IDS[:3])
def test_the_reference_itself_against_dblquad(case):
    """SciPy's adaptive dblquad in Cartesian slopes agrees with the polar tanh-sinh reference of the tests."""
    *degrees, sigma, k = case
    theta_i, theta_r, phi = np.radians(degrees)
    w_i, w_r = ref.rays(theta_i, theta_r, phi)
    c_i = 1 / np.tan(theta_i) / sigma

    def density(y, x):
        m = np.array([sigma * x, sigma * y, 1.0])
        m /= np.sqrt(m @ m)
        mu_i, mu_r = m @ w_i, m @ w_r
        if mu_i <= 0 or mu_r <= 0:
            return 0.0
        return np.exp(-0.5 * (x * x + y * y)) / (2 * np.pi) * ref.shape(mu_i, mu_r, k)

    # seen: −(x cosφ + y sinφ) < c_r, sinφ > 0, bounds y from below
    def lowest(x):
        return max(-8.0, min(8.0, -(1 / np.tan(theta_r) / sigma + x * np.cos(phi)) / np.sin(phi)))

    found, _ = dblquad(density, -8, min(c_i, 8), lowest, 8, epsabs=1e-8, epsrel=1e-7)
    assert found == pytest.approx(reference(theta_i, theta_r, phi, sigma, k)[1], rel=2e-6)


def assert_averages(found, expected, tolerance):
    """∫P and E[W] relative; the facet-weighted means of m_x and m_x m_y absolute."""
    np.testing.assert_allclose(found[:2], expected[:2], rtol=tolerance)
    np.testing.assert_allclose(found[2:] / expected[1], expected[2:] / expected[1], atol=tolerance)


def test_high_accuracy_in_hard_geometries(average):
    """Accuracy ``high``: 1e-6 of the average in every one of the hard cases."""
    cases = np.array(HARD)
    angles = np.radians(cases[:, :3]).T
    found = average(*angles, cases[:, 3], cases[:, 4], "high")
    expected = np.array([reference(*np.radians(c[:3]), *c[3:]) for c in HARD]).T
    assert_averages(found, expected, 1e-6)


def test_default_accuracy_in_hard_geometries(average):
    """Default accuracy: 1e-3 of the average in every one of the hard cases."""
    cases = np.array(HARD)
    found = average(*np.radians(cases[:, :3]).T, cases[:, 3], cases[:, 4])
    expected = np.array([reference(*np.radians(c[:3]), *c[3:]) for c in HARD]).T
    assert_averages(found, expected, 1e-3)


@pytest.mark.parametrize(
    ("accuracy", "phi_max", "tolerance"),
    [("high", 150, 1e-6), ("high", 180, 1e-4), ("default", 180, 1.5e-3)],
)
def test_lit_and_seen_probability(average, accuracy, phi_max, tolerance):
    """∫P over lit and seen is a bivariate normal probability, known in closed form by Owen's T function.

    All geometries and all σ in bounds. Near backscatter the two edges are almost parallel: there the mapped
    wedge of ``high`` is good to 1e-4 (σ = 0.6, both rays at 89°: 6e-5), elsewhere to 1e-6.
    """
    rng = np.random.default_rng(8)
    theta_i, theta_r = np.radians(89.9) * rng.random((2, 6000)) ** 0.5
    phi, sigma = np.radians(phi_max) * (2 * rng.random(6000) - 1), 0.002 + 0.598 * rng.random(6000)
    found = average(theta_i, theta_r, phi, sigma, 1.0, accuracy)[0]
    expected = ref.wedge_probability(1 / np.tan(theta_i) / sigma, 1 / np.tan(theta_r) / sigma, phi)
    np.testing.assert_allclose(found, expected, atol=tolerance)


def test_moments_of_a_clear_wedge(average, jit):
    """Both rays near the normal: every facet is lit and seen; slopes have mean 0 and variance σ²."""

    def integrand(facet, geometry, args):
        x, y = (m / facet.normal[2] for m in facet.normal[:2])
        return 1.0, x, y, x * x, y * y, x * y, x * x * x * x

    for sigma in (0.04, 0.1):
        g = geometry_from_angles(jit([0.1, 0.2]), jit([0.2, 0.0]), jit([0.4, 2.0]))
        found = [x.numpy()[0] for x in facet_average(integrand, 7, g, jit([sigma, sigma]), ())]
        expected = [1, 0, 0, sigma**2, sigma**2, 0, 3 * sigma**4]
        np.testing.assert_allclose(found, expected, atol=1e-14)


def limits(sigma, k):
    """Distances of the edges where the default rule changes, for an average by itself."""
    spread, steep = np.sqrt(sigma), 6.0 * abs(k - 1.0) * sigma**1.5
    return [max(6.9, 28.0 * spread, steep / 0.003), max(4.5, 18.5 * spread, steep / 0.01), 4.5]


@pytest.mark.parametrize(("sigma", "k"), [(0.03, 1.2), (0.06, 1.2), (0.06, 2.5), (0.1, 0.8), (0.12, 2.5)])
def test_choice_of_rule_is_continuous(average, sigma, k):
    """Across the borders between the rules the result does not jump."""
    for limit in limits(sigma, k):
        for other in (0.3, np.arctan(1.0 / (limit * sigma)) - 0.001):
            theta = np.arctan(1.0 / (limit * sigma)) + np.array([-1e-7, 1e-7])
            found = average(theta, other, 2.0, sigma, k)
            scale = np.array([found[0, 0], *(found[1, 0],) * 3])
            assert np.all(abs(found[:, 0] - found[:, 1]) <= 2e-5 * scale)


def test_choice_of_rule_is_continuous_in_the_slopes(average):
    """From σ = 0.12 on no edge is ignored."""
    found = average(0.5, 0.4, 2.0, 0.12 + np.array([-1e-9, 1e-9]), 2.0)
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=2e-6)


def test_wedge_distance(jit):
    """Edges are cotθ/σ standard deviations out."""
    theta = np.radians([0.0, 30.0, 80.0, 89.9])
    found = wedge_distance(jit(np.cos(theta)), jit(np.sin(theta)), jit(np.full(4, 0.1))).numpy()
    np.testing.assert_allclose(found[1:], 1 / np.tan(theta[1:]) / 0.1, rtol=1e-12)
    assert found[0] == 50.0


@pytest.mark.parametrize(
    ("accuracy", "c_i", "c_r", "sigma", "k", "rule"),
    [
        ("default", 10.0, 7.0, 0.04, 1.25, "seven"),
        ("default", 7.0, 10.0, 0.05, 4.0, "twelve"),
        ("default", 10.0, 5.5, 0.04, 1.25, "twelve"),
        ("default", 10.0, 5.1, 0.1, 1.25, "many"),
        ("default", 10.0, 4.4, 0.04, 1.25, "one_edge"),
        ("default", 4.4, 10.0, 0.1, 1.25, "one_edge"),
        ("default", 4.4, 4.4, 0.04, 1.25, "both_edges"),
        ("default", 50.0, 10.0, 0.13, 1.25, "both_edges"),
        ("draft", 4.6, 10.0, 0.1, 3.0, "seven"),
        ("draft", 4.4, 10.0, 0.1, 3.0, "one_edge"),
        ("high", 50.0, 50.0, 0.01, 1.0, "one_edge"),
        ("high", 7.4, 7.4, 0.01, 1.0, "both_edges"),
    ],
)
def test_choice_of_rule(jit, accuracy, c_i, c_r, sigma, k, rule):
    """Far edges, fine facets and flat integrands take few nodes."""
    steepness = abs(k - 1.0)
    assert RULES[choose_rule(c_i, c_r, sigma, steepness, accuracy)] == rule
    arrays = (jit(x) for x in (c_i, c_r, sigma, steepness))
    assert RULES[choose_rule(*arrays, accuracy)[0]] == rule


def test_number_of_points():
    """What a direction costs: points of each of the default rules."""
    between, rows, along, edge_rows = quadrature._TABLES.places["default"]
    clear = [2 * length for _, length in quadrature._CLEAR_RANGES]
    both, one = (
        sum(2 * pairs for _, pairs in quadrature._TABLES.ranges[first : first + count])
        for first, count in ((between, rows), (along, edge_rows))
    )
    assert clear == [8, 14, 26] and (one, both) == (36, 128)


@pytest.mark.slow
def test_default_accuracy_of_random_paints():
    """docs/model.md, section 4: 1e-5 of f00 for σ ≤ 0.1 and zenith angles up to 75°, but for few cases."""
    rng = np.random.default_rng(77)
    count = 20_000
    angles = (*np.radians(rng.uniform(0.0, 75.0, (2, count))), rng.uniform(0.0, 2.0 * np.pi, count))
    sigma, n = rng.uniform(0.002, 0.1, count), rng.uniform(1.3, 2.2, count)
    k, t = rng.uniform(0.7, 4.0, count), rng.uniform(0.0, 1.0, count)
    models = (DoubleGauss(sigma, n, 1.0, k, 0.0, t, accuracy=a) for a in ("default", "high"))
    found, expected = (model.mueller(*angles) for model in models)
    error = abs(found - expected).max((1, 2)) / expected[:, 0, 0]
    assert np.quantile(error, 0.999) < 1e-5 and error.max() < 1e-4


def test_truncated_normal_variable(jit):
    """Φ to 2e-11 and the map between two bounds to 1e-9, also where the bounds lie far on one side."""
    x = np.linspace(-8.0, 8.0, 1001)
    np.testing.assert_allclose(quadrature._tail(jit(x)).numpy(), norm.sf(x), rtol=3e-11)
    z = np.linspace(-4.0, 4.0, 101)
    for low, high in ((-9.0, 9.0), (-9.0, 2.0), (-0.3, 0.1), (1.0, 2.0), (-3.0, -2.9)):
        tails = jit([norm.cdf(low)]), jit([norm.sf(high)])
        found, share = quadrature._between(jit(norm.cdf(z)), jit(norm.sf(z)), *tails)
        expected = norm.ppf(norm.cdf(low) + (norm.cdf(high) - norm.cdf(low)) * norm.cdf(z))
        np.testing.assert_allclose(found.numpy(), expected, atol=1e-8)
        assert share.numpy()[0] == pytest.approx(norm.cdf(high) - norm.cdf(low), rel=1e-9)
