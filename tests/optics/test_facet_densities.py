"""Densities of facets: normalised, one a limit of the other, differentiable in every parameter."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest
from scipy.integrate import quad

from pbrdf.backend import get_backend
from pbrdf.optics.facets import (
    generalised_gaussian_density,
    ggx_density,
    projected_area_density,
    uniform_density,
)

GENERALISED = [(0.02, 0.5), (0.1, 1.0), (0.3, 1.4), (0.1, 3.0), (0.7, 0.3), (0.05, 8.0)]


def by_tilt(density, *parameters):
    """The density as a function of a tilt, in NumPy."""
    Float = get_backend().Float

    def function(theta):
        theta = np.atleast_1d(theta)
        given = [Float(np.full(theta.shape, p)) for p in parameters]
        return density(Float(np.cos(theta)), Float(np.tan(theta) ** 2), *given).numpy()

    return function


def total(density, width):
    """∫ P dω over the hemisphere; slopes in units of the width, their logarithm as the variable."""

    def of_log(u):
        slope = width * np.exp(u)
        theta = np.arctan(slope)
        # dω = 2π sinθ dθ, dθ = slope du/(1 + slope²)
        return float(density(theta)[0]) * 2.0 * np.pi * np.sin(theta) * slope / (1.0 + slope**2)

    return sum(quad(of_log, a, a + 2.0, epsabs=1e-10)[0] for a in range(-24, 24, 2))


@pytest.mark.parametrize("alpha", [0.005, 0.1, 0.5, 2.0])
def test_ggx_integrates_to_one_and_half_of_it_is_steeper_than_alpha(alpha):
    density = by_tilt(ggx_density, alpha)
    assert total(density, alpha) == pytest.approx(1.0, abs=1e-7)
    middle = quad(
        lambda u: float(density(np.arctan(alpha * u))[0]) * alpha**2 * u * (1 + (alpha * u) ** 2) ** -1.5,
        0.0,
        1.0,
    )[0]
    assert 2.0 * np.pi * middle == pytest.approx(0.5, abs=1e-7)


@pytest.mark.parametrize(("alpha", "exponent"), GENERALISED)
def test_generalised_gaussian_integrates_to_one(alpha, exponent):
    assert total(by_tilt(generalised_gaussian_density, alpha, exponent), alpha) == pytest.approx(
        1.0, abs=1e-6
    )


def test_uniform_facets_integrate_to_one():
    density = by_tilt(lambda cosine, _: uniform_density(cosine))
    assert total(density, 1.0) == pytest.approx(1.0, abs=1e-7)


def test_generalised_gaussian_of_exponent_two_is_gaussian():
    """α = √2 σ; and with exponent 1 it is exp(−tanθ/α)/(2πα² cos³θ)."""
    theta, sigma = np.linspace(0.0, 1.3, 60), 0.2
    found = by_tilt(generalised_gaussian_density, np.sqrt(2.0) * sigma, 2.0)(theta)
    np.testing.assert_allclose(found, by_tilt(projected_area_density, sigma)(theta), rtol=1e-10)
    found = by_tilt(generalised_gaussian_density, 0.1, 1.0)(theta)
    exponential = np.exp(-np.tan(theta) / 0.1) / (2.0 * np.pi * 0.01 * np.cos(theta) ** 3)
    np.testing.assert_allclose(found, exponential, rtol=1e-10)


def test_small_tilts_have_the_density_of_fmbrdf():
    """P ∝ cosθ exp(−(θ/α)^β), normalised numerically (published code of FMBRDF): the same for small α but O(α²)."""
    alpha, exponent = 0.03, 1.3
    theta = np.linspace(0.0, 0.2, 50)

    def theirs(t):
        return np.cos(t) * np.exp(-((t / alpha) ** exponent))

    norm = 2.0 * np.pi * quad(lambda t: theirs(t) * np.sin(t), 0.0, np.pi / 2, points=[0.05, 0.2])[0]
    found = by_tilt(generalised_gaussian_density, alpha, exponent)(theta)
    np.testing.assert_allclose(found, theirs(theta) / norm, atol=2e-2 * found.max())


@pytest.mark.parametrize(("alpha", "exponent"), GENERALISED)
@pytest.mark.parametrize("widths", [0.0, 0.1, 1.0, 1.6])
def test_derivatives_of_the_generalised_gaussian(alpha, exponent, widths):
    """In α and β, the norm's gamma function included; at θ = 0, too, where the logarithm has its limit."""
    Float = get_backend().Float
    tilt = np.arctan(alpha * widths)
    cosine, tan2 = Float(np.cos(tilt)), Float(np.tan(tilt) ** 2)
    inputs = [Float(alpha), Float(exponent)]
    dr.enable_grad(*inputs)
    value = generalised_gaussian_density(cosine, tan2, *inputs)
    dr.backward(value)
    for i, x in enumerate(inputs):
        step = 1e-5 * (alpha, exponent)[i]
        ends = []
        for sign in (-1.0, 1.0):
            p = [alpha, exponent]
            p[i] += sign * step
            ends.append(by_tilt(generalised_gaussian_density, *p)(tilt)[0])
        scale = value.numpy()[0] / (alpha, exponent)[i]
        assert dr.grad(x)[0] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-5, abs=1e-8 * scale)


def test_single_precision_agrees():
    from drjit.llvm import Float

    theta = np.linspace(0.0, 1.2, 40)
    arguments = Float(np.cos(theta)), Float(np.tan(theta) ** 2), Float(0.1), Float(0.7)
    expected = by_tilt(generalised_gaussian_density, 0.1, 0.7)(theta)
    np.testing.assert_allclose(generalised_gaussian_density(*arguments).numpy(), expected, rtol=1e-4)
