"""MRPV shape, paper eqs (9)-(10)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrdf.optics.diffuse import minnaert_shape, mrpv


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
