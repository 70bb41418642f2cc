"""Powers by polynomials, and their derivatives."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.optics.powers import exp2, log2, power


@pytest.fixture(scope="module")
def single():
    return sys.modules[get_backend().Float.__module__].Float32


def cases(count):
    """Bases as the diffuse shape has them, 1e-18 … 2, and exponents k − 1."""
    rng = np.random.default_rng(1)
    return (
        np.exp(rng.uniform(np.log(1e-18), np.log(2.0), count)).astype(np.float32),
        rng.uniform(-0.7, 3.0, count).astype(np.float32),
    )


def test_single_precision(single):
    """Relative error 1e-6·(1 + |y log2 x|): the rounding of the exponent, which any method has, and the polynomials."""
    x, y = cases(200_000)
    exact = x.astype(float) ** y.astype(float)
    found = power(single(x), single(y)).numpy()
    normal = exact > 1e-37
    bound = 1e-6 * (1.0 + np.abs(y * np.log2(x.astype(float))))
    assert normal.mean() > 0.9
    assert np.max((np.abs(found / exact - 1.0) / bound)[normal]) < 1.0


def test_single_precision_at_the_ends(single):
    """1^y = 1, x^0 = 1, and what is too small is 0 or nearly so, never a wrong sign or NaN."""
    y = single(np.linspace(-3.0, 19.0, 50).astype(np.float32))
    assert np.max(np.abs(power(single(1.0), y).numpy() - 1.0)) < 2e-5
    x, _ = cases(1000)
    assert np.max(np.abs(power(single(x), single(0.0)).numpy() - 1.0)) < 2e-7
    tiny = power(single(x), single(19.0)).numpy()
    assert np.isfinite(tiny).all() and np.all(tiny >= 0.0) and np.all(tiny[x < 1e-3] < 2e-38)


def test_single_precision_saturates(single):
    """What is too large for single precision stays large and positive."""
    found = power(single([1e5, 1e30]), single(19.0)).numpy()
    assert np.all(found > 1e38) and np.isfinite(found).all()


def test_logarithm(single, jit):
    """Absolute error 4e-7 and rounding in single precision; 2e-15 in double."""
    x, _ = cases(10_000)
    exact = np.log2(x.astype(float))
    assert np.max(np.abs(log2(single(x)).numpy() - exact) / (1.0 + np.abs(exact))) < 4e-7
    np.testing.assert_allclose(log2(jit(x.astype(float))).numpy(), exact, rtol=1e-14, atol=1e-14)


def test_double_precision_and_numbers(jit):
    x, y = (v.astype(float) for v in cases(1000))
    np.testing.assert_allclose(power(jit(x), jit(y)).numpy(), x**y, rtol=1e-12)
    assert power(0.3, 1.7) == pytest.approx(0.3**1.7, rel=1e-14)


def test_double_precision_at_the_ends(jit):
    """1^y and x^0 are exact; what is too small or too large is the least or largest power of two; NaN stays."""
    y = jit(np.linspace(-3.0, 19.0, 50))
    assert np.all(power(jit([1.0]), y).numpy() == 1.0)
    assert np.all(power(jit(np.geomspace(1e-18, 1e5, 50)), jit([0.0])).numpy() == 1.0)
    found = exp2(jit([-2000.0, 2000.0, np.nan])).numpy()
    assert found[0] == 2.0**-1022 and found[1] == 2.0**1023 and np.isnan(found[2])
    x = np.geomspace(1e-300, 1e300, 10_001)
    np.testing.assert_allclose(log2(jit(x)).numpy(), np.log2(x), rtol=1e-14, atol=3e-14)


@pytest.mark.parametrize("double", [False, True])
def test_derivatives(single, jit, double):
    """d(x^y)/dx = y x^(y−1) and d(x^y)/dy = x^y log x."""
    import drjit as dr

    x, y = cases(1000)
    x = np.maximum(x, np.float32(1e-3))
    Float, tolerance = (jit, 1e-12) if double else (single, 1e-4)
    a, b = Float(x), Float(y)
    dr.enable_grad(a, b)
    dr.backward(power(a, b))
    x, y = x.astype(float), y.astype(float)
    np.testing.assert_allclose(a.grad.numpy(), y * x ** (y - 1.0), rtol=tolerance, atol=1e-6)
    np.testing.assert_allclose(b.grad.numpy(), x**y * np.log(x), rtol=tolerance, atol=1e-6)
