"""Limits with closed forms: Lambert, smooth coating, perfect mirror, energy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

UNIT = arrays(float, (3, 32), elements=st.floats(0.0, 0.999))


@given(UNIT, st.floats(1e-3, 100.0))
@pytest.mark.parametrize("model", [DoubleGauss, ReciprocalDoubleGauss])
def test_lambert_limit_is_exact(model, unit, a):
    """k = 1, b = 0, t = 0: a/π in every geometry, to the last digit, and nothing but intensity."""
    theta_i, theta_r, phi = np.pi / 2 * unit[0], np.pi / 2 * unit[1], np.pi * (2 * unit[2] - 1)
    f = model(0.3, 1.6, a, 1.0, 0.0, 0.0).mueller(theta_i, theta_r, phi, part="diffuse")
    np.testing.assert_array_max_ulp(f[:, 0, 0], np.full(32, a / np.pi), maxulp=1)
    f[:, 0, 0] = 0
    assert not f.any()


@pytest.mark.parametrize("transmittance", ["flux", "amplitude"])
def test_smooth_limit_of_the_diffuse_dolp(transmittance):
    """σ → 0, t = 1: DoLP is the closed form of MODEL section 6, whatever the transmittance and θ_i.

    At σ = 0.001, the smallest allowed; what is left is of order σ² tan²θ = 1e-5 at 80°.
    """
    theta = np.radians(np.linspace(0, 80, 17))
    for n in (1.3, 1.6207, 2.2):
        model = DoubleGauss(0.001, n, 1.0, 1.25, 0.2, 1.0, transmittance=transmittance)
        f = model.mueller(0.5, theta, 1.0, part="diffuse")
        np.testing.assert_allclose(ref.dolp(f), ref.diffuse_dolp(theta, n), atol=1e-5)
        assert (f[1:, 1, 0] > 0).all()
        np.testing.assert_allclose(f[:, 2, 0], 0, atol=1e-6 * f[:, 0, 0].max())


def test_smooth_limit_converges_quadratically():
    """The deviation from the closed form falls as σ²."""
    error = []
    for sigma in (0.04, 0.02, 0.01):
        f = DoubleGauss(sigma, 1.6207, 1.0, 1.25, 0.2, 1.0, accuracy="high").mueller(
            0.5, 1.0, 1.0, part="diffuse"
        )
        error.append(abs(ref.dolp(f) - ref.diffuse_dolp(1.0, 1.6207)))
    np.testing.assert_allclose(np.array(error[:-1]) / error[1:], 4.0, rtol=0.05)


def test_smooth_limit_with_absorption():
    """Complex n: the flux form is T = 1 − |r|² of the flat coating."""
    theta, n = np.radians([10.0, 40.0, 70.0]), 2 - 1.5j
    f = DoubleGauss(0.001, n, 1.0, 1.0, 0.0, 1.0).mueller(0.5, theta, 0.3, part="diffuse")
    T_p, T_s = ref.transmittance(theta, n, "flux")
    np.testing.assert_allclose(f[:, 0, 0] * np.pi, 0.5 * (T_p + T_s), atol=1e-5)
    np.testing.assert_allclose(f[:, 1, 0] * np.pi, 0.5 * (T_p - T_s), atol=1e-5)


def test_smooth_limit_of_the_reciprocal_model():
    """σ → 0, k = 1, b = 0, t = 1: the outer product of two Fresnel transmissions over π (Baek et al.)."""
    theta_i, theta_r, n = 0.7, 1.1, 1.6207
    f = ReciprocalDoubleGauss(0.001, n, 1.0, 1.0, 0.0, 1.0).mueller(theta_i, theta_r, 0.8, part="diffuse")
    vectors = []
    for theta in (theta_r, theta_i):
        T_p, T_s = ref.transmittance(theta, n, "flux")
        vectors.append([0.5 * (T_p + T_s), 0.5 * (T_p - T_s), 0.0, 0.0])
    np.testing.assert_allclose(f * np.pi, np.outer(*vectors), atol=1e-5)


def test_peak_of_the_specular_lobe_in_closed_form():
    """At the mirror direction f = R(θ)/(8πσ² cos²θ) for the flat facet, tan²θ_m = 0, G = 1."""
    theta = np.radians([0.0, 20.0, 50.0, 59.0])
    for sigma in (0.002, 0.04):
        f = DoubleGauss(sigma, 1.6, 1.0, 1.0, 0.0, 0.0).mueller(theta, theta, 0.0, part="specular")
        R = ref.mirror_mueller(theta, 1.6)[:, 0, 0]
        np.testing.assert_allclose(f[:, 0, 0], R / (8 * np.pi * sigma**2 * np.cos(theta) ** 2), rtol=1e-12)


@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_smooth_limit_reflects_fresnels_share(degrees):
    """σ = 0.01: the specular part integrates over the viewing hemisphere to Fresnel's R(θ_i)."""
    theta_i, sigma, n = np.radians(degrees), 0.01, 1.6
    x, w = np.polynomial.hermite_e.hermegauss(31)
    slopes = sigma * np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    weight = np.outer(w, w).ravel() / (2 * np.pi)
    m = np.concatenate([slopes, np.ones((len(slopes), 1))], 1)
    m /= np.linalg.norm(m, axis=1, keepdims=True)
    w_i = np.array([-np.sin(theta_i), 0, np.cos(theta_i)])
    cos_beta = m @ w_i
    w_r = 2 * cos_beta[:, None] * m - w_i
    theta_r, phi = np.arccos(np.minimum(w_r[:, 2], 1)), np.arctan2(w_r[:, 1], w_r[:, 0])
    f = DoubleGauss(sigma, n, 1, 1, 0, 0).mueller(theta_i, theta_r, phi, part="specular")[:, 0, 0]
    P = np.exp(-(1 / m[:, 2] ** 2 - 1) / (2 * sigma**2)) / (2 * np.pi * sigma**2 * m[:, 2] ** 3)
    total = (weight * f / P * w_r[:, 2] * 4 * cos_beta).sum()
    assert total == pytest.approx(ref.mirror_mueller(theta_i, n)[0, 0], rel=2e-3)


def test_lambert_body_with_transmission_keeps_less_than_it_gets():
    """a = 1, k = 1, b = 0: directional-hemispherical reflectance of the diffuse part is below 1 for any t."""
    x, w = np.polynomial.legendre.leggauss(24)
    theta, phi = np.pi / 4 * (x + 1), np.pi / 2 * (x + 1)
    weight = 2 * np.outer(np.pi / 4 * w * np.cos(theta) * np.sin(theta), np.pi / 2 * w)
    for model in (DoubleGauss, ReciprocalDoubleGauss):
        for t, limit in ((0.0, 1 + 1e-9), (0.5, 1.0), (1.0, 0.96)):
            f = model(0.1, 1.6, 1.0, 1.0, 0.0, t).mueller(0.5, theta[:, None], phi[None, :], part="diffuse")
            assert 0.5 < (f[..., 0, 0] * weight).sum() < limit


def test_amplitude_exceeds_flux_by_the_beam_factor():
    """|t|²/T = n cosβ'/cosβ at σ → 0 (LITERATURE 3e)."""
    theta, n = np.radians([0.0, 30.0, 60.0, 80.0]), 1.6207
    f = [
        DoubleGauss(0.001, n, 1, 1, 0, 1, transmittance=x).mueller(0.2, theta, 0, part="diffuse")[:, 0, 0]
        for x in ("amplitude", "flux")
    ]
    beam = n * np.cos(np.arcsin(np.sin(theta) / n)) / np.cos(theta)
    np.testing.assert_allclose(f[0] / f[1], beam, rtol=1e-4)


def test_k_equal_one_makes_both_normalizations_differ_by_sigma_squared_only():
    """k = 1: W = 1, so ``weighted`` and ``visible`` are the same up to unlit facets."""
    theta = np.radians(np.linspace(0, 70, 8))
    f = [
        DoubleGauss(0.05, 1.6, 1, 1, 0.3, 1, normalization=x).mueller(0.6, theta, 0.4, part="diffuse")
        for x in ("weighted", "visible")
    ]
    np.testing.assert_allclose(f[0], f[1], atol=1e-9)
