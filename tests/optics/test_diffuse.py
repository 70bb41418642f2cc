"""MRPV shape, paper eqs (9)-(10), and the RPV function with its hot spot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrdf.optics.diffuse import henyey_greenstein, hot_spot, minnaert_shape, mrpv, rpv
from pbrdf.optics.geometry import geometry_from_angles


@given(arrays(float, (6, 32), elements=st.floats(0.01, 1.0)))
def test_formula(jit, unit):
    """f_rpv = (a/π) [(μ_r + μ_i) μ_r μ_i]^(k−1) exp(b cosω)."""
    i, r, w, a, k, b = unit[0], unit[1], 2 * unit[2] - 1, 5 * unit[3], 0.3 + 3.7 * unit[4], 7 * unit[5] - 3
    found = mrpv(*(jit(x) for x in (i, r, w, a, k, b))).numpy()
    np.testing.assert_allclose(found, a / np.pi * ((r + i) * r * i) ** (k - 1) * np.exp(b * w), rtol=1e-12)
    np.testing.assert_allclose(
        minnaert_shape(jit(i), jit(r), jit(k)).numpy(),
        minnaert_shape(jit(r), jit(i), jit(k)).numpy(),
        rtol=1e-13,
    )


def test_lambert_limit_is_exact(jit):
    """k = 1, b = 0 is a Lambertian surface: f = a/π to the last digit, at any angle."""
    mu = np.linspace(0.01, 1, 50)
    one, zero, a = np.ones(50), np.zeros(50), np.full(50, 0.37)
    found = mrpv(*(jit(x) for x in (mu, mu[::-1].copy(), mu - 0.5, a, one, zero))).numpy()
    np.testing.assert_array_max_ulp(found, a / np.pi, maxulp=1)


def test_positive_b_leans_forward(jit):
    """b > 0 is forward scattering: more at cosω = +1 (forward) than at −1 (back)."""
    args = (0.5, 0.5, np.array([1.0, -1.0]), 1.0, 1.2, 0.7)
    forward, back = mrpv(*(jit(np.broadcast_to(x, 2)) for x in args)).numpy()
    assert forward / back == pytest.approx(np.exp(2 * 0.7))


def rahman(theta_i, theta_r, phi, rho_0, k, asymmetry, rho_c):
    """BRF as VLIDORT, GRASP and i3rc write it: azimuth ϕ = 0 in backscatter, phase angle g (LITERATURE 2.6)."""
    azimuth = phi + np.pi
    mu_i, mu_r = np.cos(theta_i), np.cos(theta_r)
    cos_g = mu_i * mu_r + np.sin(theta_i) * np.sin(theta_r) * np.cos(azimuth)
    F = (1 - asymmetry**2) / (1 + 2 * asymmetry * cos_g + asymmetry**2) ** 1.5
    t_i, t_r = np.tan(theta_i), np.tan(theta_r)
    G = np.sqrt(np.maximum(t_i**2 + t_r**2 - 2 * t_i * t_r * np.cos(azimuth), 0.0))
    return rho_0 * (mu_i * mu_r * (mu_i + mu_r)) ** (k - 1) * F * (1 + (1 - rho_c) / (1 + G))


@given(arrays(float, (7, 32), elements=st.floats(0.0, 1.0)))
def test_rpv_is_that_of_the_radiative_transfer_codes(jit, unit):
    """In their convention of azimuths; eradiate's default grassland among the parameters."""
    angles = 1.5 * unit[0], 1.5 * unit[1], np.pi * (2 * unit[2] - 1)
    drawn = 0.01 + unit[3], 0.3 + unit[4], 1.8 * unit[5] - 0.9, unit[6]
    grassland = 0.183, 0.78, -0.1, 0.183
    for values in (drawn, tuple(np.full(32, x) for x in grassland)):
        found = rpv(geometry_from_angles(*(jit(x) for x in angles)), *(jit(x) for x in values)).numpy()
        # G comes by cancellation there where both rays nearly agree
        np.testing.assert_allclose(np.pi * found, rahman(*angles, *values), rtol=1e-6)


def test_rpv_of_a_lambertian_surface_is_exact(jit):
    geometry = geometry_from_angles(*(jit(np.linspace(0.0, x, 50)) for x in (1.5, 1.2, 3.0)))
    found = rpv(geometry, *(jit(np.full(50, x)) for x in (0.37, 1.0, 0.0, 1.0))).numpy()
    np.testing.assert_array_max_ulp(found, np.full(50, 0.37 / np.pi), maxulp=2)


def test_the_hot_spot_stands_in_backscatter(jit):
    """2 − ρ_c at θ_i = θ_r, φ = π, falling off on every side; nothing special in the mirror direction."""
    theta, rho_c = np.full(4, 0.6), 0.2
    angles = theta, np.array([0.6, 0.65, 0.6, 0.6]), np.array([np.pi, np.pi, np.pi - 0.1, 0.0])
    factor = hot_spot(geometry_from_angles(*(jit(x) for x in angles)), jit(rho_c)).numpy()
    assert factor[0] == pytest.approx(2.0 - rho_c, abs=1e-12)
    assert factor[0] > factor[1] > factor[3] > 1.0 and factor[0] > factor[2] > factor[3]


@pytest.mark.parametrize("asymmetry", [-0.7, -0.1, 0.4])
def test_henyey_greenstein_scatters_all_light_and_leans_by_its_asymmetry(jit, asymmetry):
    """½∫F d(cosω) = 1, the mean of cosω is Θ."""
    x, w = np.polynomial.legendre.leggauss(200)
    F = henyey_greenstein(jit(x), jit(asymmetry)).numpy()
    assert 0.5 * (w * F).sum() == pytest.approx(1.0, abs=1e-12)
    assert 0.5 * (w * x * F).sum() == pytest.approx(asymmetry, abs=1e-12)
