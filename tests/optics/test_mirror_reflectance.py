"""Reflectance of facets that are perfect mirrors: the table against integrals over view directions."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

import independent as ref
from pbrdf.backend import get_backend
from pbrdf.optics.mirror_reflectance import mirror_reflectance


def table(degrees, sigma):
    Float = get_backend().Float
    theta = np.radians(np.atleast_1d(degrees).astype(float))
    return mirror_reflectance(Float(np.cos(theta)), Float(np.sin(theta)), Float(sigma)).numpy()


def by_view(degrees, sigma, n=240):
    """∫ f cosθ_r dω_r by the printed eqs (2)-(4) over θ_r and φ, in NumPy alone."""
    theta_i = np.radians(degrees)
    x, w = np.polynomial.legendre.leggauss(n)
    theta_r, phi = np.pi / 4 * (x + 1)[:, None], np.pi / 2 * (x + 1)[None, :]
    beta, theta, _, _ = ref.explicit_angles(theta_i, theta_r, phi)
    P = np.exp(-(np.tan(theta) ** 2) / (2 * sigma**2)) / (2 * np.pi * sigma**2 * np.cos(theta) ** 3)
    f_cos = P * ref.shadowing(theta_i, theta_r, theta, beta, sigma, "v-cavity")
    f_cos = f_cos / (4 * np.cos(theta) * np.cos(theta_i))
    return 2 * np.einsum("ij,i,j->", f_cos * np.sin(theta_r), np.pi / 4 * w, np.pi / 2 * w)


@pytest.mark.parametrize("sigma", [0.1, 0.17, 0.3, 0.6, 0.95])
def test_the_table_is_the_integral(sigma):
    degrees = (1.0, 35.0, 60.0, 70.0, 75.0, 80.0, 85.0)
    expected = [by_view(d, sigma) for d in degrees]
    np.testing.assert_allclose(table(degrees, sigma), expected, atol=1e-3)


def test_a_smooth_mirror_reflects_everything():
    np.testing.assert_allclose(table([0.0, 30.0, 60.0, 80.0], 0.002), 1.0, atol=1e-3)


def test_grazing_light_is_reflected_once():
    """Towards 90° both shadowing and its cure by the light's slope end at 1."""
    np.testing.assert_allclose([table(89.99, s)[0] for s in (0.01, 0.1, 0.5)], 1.0, atol=2e-3)


def test_derivatives_are_those_of_the_values():
    Float = get_backend().Float
    sigma, theta = Float(0.23), Float(1.1)
    dr.enable_grad(sigma, theta)
    value = mirror_reflectance(dr.cos(theta), dr.sin(theta), sigma)
    dr.backward(value)
    h = 1e-5

    def at(t, s):
        return table(np.degrees(t), s)[0]

    assert dr.grad(sigma)[0] == pytest.approx((at(1.1, 0.23 + h) - at(1.1, 0.23 - h)) / (2 * h), rel=1e-5)
    assert dr.grad(theta)[0] == pytest.approx((at(1.1 + h, 0.23) - at(1.1 - h, 0.23)) / (2 * h), rel=1e-5)
