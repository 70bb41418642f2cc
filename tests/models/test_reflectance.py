"""Directional-hemispherical reflectance against closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad

import independent as ref
import pbrdf
from pbrdf.errors import ModelError
from pbrdf.models.reflectance import albedo, directional_hemispherical_reflectance, with_albedo

DEGREES = np.array([0.0, 30.0, 60.0, 75.0])
LAMBERT = {"a": 0.7, "k": 1.0, "b": 0.0, "t": 0.0}


def dhr(model, degrees):
    return directional_hemispherical_reflectance(model, np.deg2rad(degrees))


def matched(**changes):
    """A coating of the index of air: no specular part at all."""
    return pbrdf.DoubleGauss(**{"sigma": 0.1, "n": 1.0, **LAMBERT, **changes})


def mirror(sigma, **options):
    """A facet that reflects everything, |r|² = 1 − 4e-6, without a body."""
    return pbrdf.DoubleGauss(sigma, 0.01 - 100j, 0.0, 1.0, 0.0, 0.0, **options)


def test_lambert_reflects_its_albedo():
    np.testing.assert_allclose(dhr(matched(), [0.0, 20.0, 50.0, 80.0, 89.0]), 0.7, rtol=1e-12)


def test_a_minnaert_body_has_its_closed_form():
    """k = 2, b = 0: DHR = 2a μ_i ∫(μ + μ_i) μ² dμ = 2a μ_i (1/4 + μ_i/3)."""
    mu = np.cos(np.deg2rad(DEGREES))
    np.testing.assert_allclose(dhr(matched(k=2.0), DEGREES), 1.4 * mu * (0.25 + mu / 3.0), rtol=1e-9)


@pytest.mark.parametrize(("k", "b"), [(0.3, 0.0), (0.7, 3.5), (1.3, -2.0)])
def test_a_singular_and_lopsided_body_agrees_with_adaptive_quadrature(k, b):
    theta = np.deg2rad(50.0)
    mu_i, sin_i = np.cos(theta), np.sin(theta)

    def integrand(phi, s):
        mu = s * s  # tames the singularity at grazing view
        scattering = -mu_i * mu + sin_i * np.sqrt(1.0 - mu * mu) * np.cos(phi)
        return (0.7 / np.pi) * ((mu + mu_i) * mu * mu_i) ** (k - 1.0) * np.exp(b * scattering) * mu * 2.0 * s

    expected = 2.0 * dblquad(integrand, 0.0, 1.0, 0.0, np.pi, epsabs=1e-10, epsrel=1e-10)[0]
    assert dhr(matched(k=k, b=b), 50.0) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("paint", "expected"),
    [
        ("white", [1.90, 1.84, 1.62, 1.41]),
        ("matte-white-thin", [1.64, 1.57, 1.27, 0.97]),
        ("matte-white-thick", [1.35, 1.30, 1.11, 0.92]),
        ("pearl-white", [1.04, 1.06, 0.70, 0.28]),
        ("cd-back", [1.25, 1.22, 1.12, 0.99]),
    ],
)
def test_the_bodies_of_table_1_reflect_more_than_they_receive(paint, expected):
    """Computed apart, LITERATURE.md 3f: the amplitudes are on a camera's scale."""
    body = pbrdf.load_paint(paint).replace(n=1.0, t=0.0)
    np.testing.assert_allclose(dhr(body, DEGREES), expected, atol=0.0051)


def furnace(sigma, theta_i, shadowed):
    """Brute force over the hemisphere with |r| = 1, written from the paper's eqs (2)-(4)."""
    theta = ((np.arange(800) + 0.5) * 0.5 * np.pi / 800)[:, None]
    phi = (np.arange(500) + 0.5) * np.pi / 500
    ci, cr = np.cos(theta_i), np.cos(theta)
    cos_beta = np.sqrt(0.5 * (1.0 + ci * cr - np.sin(theta_i) * np.sin(theta) * np.cos(phi)))
    c = (ci + cr) / (2.0 * cos_beta)
    P = np.exp(-(1.0 / c**2 - 1.0) / (2.0 * sigma**2)) / (2.0 * np.pi * sigma**2 * c**3)
    G = np.minimum(1.0, 2.0 * c * np.minimum(ci, cr) / cos_beta) if shadowed else 1.0
    return (P * G / (4.0 * c * ci) * np.sin(theta)).sum() * (0.5 * np.pi / 800) * (2.0 * np.pi / 500)


@pytest.mark.parametrize("sigma", [0.04, 0.1, 0.3])
@pytest.mark.parametrize("shadowed", [True, False])
def test_the_white_furnace_agrees_with_brute_force(sigma, shadowed):
    """So do the numbers of LITERATURE.md 2.1 up to 60°; its grazing ones are off by up to 0.03."""
    degrees = np.array([0.0, 35.0, 60.0, 75.0, 85.0])
    found = dhr(mirror(sigma, shadowing="v-cavity" if shadowed else "none"), degrees)
    expected = [furnace(sigma, theta, shadowed) for theta in np.deg2rad(degrees)]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    if shadowed:
        stated = {0.04: [1.0, 1.0, 1.0], 0.1: [1.0, 1.0, 0.991], 0.3: [0.950, 0.916, 0.898]}[sigma]
        np.testing.assert_allclose(found[:3], stated, atol=1e-3)


@pytest.mark.parametrize("sigma", [0.002, 0.006])
def test_a_narrow_lobe_carries_fresnels_reflectance(sigma):
    """However narrow the lobe, nothing of it is missed; corrections are of order σ²."""
    coating = pbrdf.DoubleGauss(sigma, 1.7984, 0.0, 1.0, 0.0, 0.0)
    fresnel = [ref.mirror_mueller(theta, 1.7984)[0, 0] for theta in np.deg2rad(DEGREES)]
    np.testing.assert_allclose(dhr(coating, DEGREES), fresnel, rtol=60.0 * sigma**2)


def test_shape_follows_the_angles_and_bad_angles_are_refused():
    assert dhr(matched(), 30.0).shape == ()
    assert dhr(matched(), [[0.0, 10.0, 20.0], [30.0, 40.0, 50.0]]).shape == (2, 3)
    for angle in (-0.1, 0.5 * np.pi, 30.0, np.nan):
        with pytest.raises(ModelError, match="theta_i must be within"):
            directional_hemispherical_reflectance(matched(), angle)
    with pytest.raises(ModelError, match="no maps"):
        dhr(pbrdf.DoubleGauss([0.1, 0.2], 1.5, 0.5, 1.0, 0.0, 0.5), 30.0)


@pytest.mark.slow
def test_albedo_of_a_lambertian_body_is_its_own():
    assert albedo(matched()) == pytest.approx(LAMBERT["a"], rel=1e-3)
    for share in (0.1, 0.6, 1.0):
        assert albedo(with_albedo(matched(), share)) == pytest.approx(share, rel=1e-9)


@pytest.mark.slow
def test_an_albedo_scales_what_the_amplitude_does_and_leaves_the_coating():
    paint = pbrdf.load_paint("white")
    scaled = with_albedo(paint, 0.6)
    assert scaled.values["a"] == pytest.approx(pbrdf.load_paint("white-scene").values["a"], abs=1e-4)
    assert {name for name in paint.values if paint.values[name] != scaled.values[name]} == {"a"}
    for share, words in ((0.0, "above 0"), (1.2, "at most 1"), (0.1, "reflects 0.13 already")):
        with pytest.raises(ModelError, match=words):
            with_albedo(paint, share)
    with pytest.raises(ModelError, match="no amplitude above 0"):
        with_albedo(paint.replace(a=0.0), 0.5)
