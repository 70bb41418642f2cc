"""Lobes of dielectric facets against the sources' formulas, by explicit angles; LITERATURE 2.4, 2.8."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.dielectric_facets import (
    CoatingFacets,
    DinerFacets,
    LitvinovLobe,
    MaignanLobe,
    PlasticLobe,
)
from pbrdf.models.parts.facets import GaussianSlopes, Uniform
from pbrdf.models.reflectance import directional_hemispherical_reflectance

UNIT = arrays(float, (6, 32), elements=st.floats(0.0, 1.0))


def lobe(part, **values):
    """A model of nothing but facets."""
    return type("Lobe", (ComposedModel,), {"name": "lobe", "parts": (part,)})(**values)


def case(unit):
    """θ_i, θ_r, φ away from where the explicit angles are undefined, index and slope."""
    angles = 0.02 + 1.45 * unit[0], 0.02 + 1.4 * unit[1], 0.01 + 3.0 * unit[2]
    return angles, 1.2 + 1.4 * unit[3], 0.05 + 0.5 * unit[4]


def fresnel(angles, n):
    """β, tilt θ, and M(−α2) M_r M(α1) in the surface's frames."""
    beta, theta, a1, a2 = ref.explicit_angles(*angles)
    return beta, theta, ref.paper_rotation(-a2) @ ref.mirror_mueller(beta, n) @ ref.paper_rotation(a1)


def check(model, angles, factor, matrix):
    expected = factor[:, None, None] * matrix
    np.testing.assert_allclose(
        model.mueller(*angles), expected, rtol=0, atol=1e-10 * np.abs(expected).max() + 1e-300
    )


@given(UNIT)
def test_diner_is_eqs_13_and_14(unit):
    """πf = ζ exp(−tan²θ/2σ²)/(8σ² μ_i μ_r cos⁴θ) M, and ζ/(8 μ_i μ_r cosθ) M for uniform facets."""
    angles, n, sigma = case(unit)
    zeta, mu = 0.1 + unit[5], np.cos(angles[0]) * np.cos(angles[1])
    _, theta, M = fresnel(angles, n)
    gauss = np.exp(-0.5 * (np.tan(theta) / sigma) ** 2) / (8 * sigma**2 * mu * np.cos(theta) ** 4)
    check(
        lobe(DinerFacets(GaussianSlopes()), strength=zeta, sigma=sigma, n=n), angles, zeta * gauss / np.pi, M
    )
    check(
        lobe(DinerFacets(Uniform()), strength=zeta, n=n), angles, zeta / (8 * mu * np.cos(theta)) / np.pi, M
    )


@given(UNIT)
def test_maignan(unit):
    """BRF = C e^(−NDVI) e^(−tanγ) R_F(γ)/(4 (μ_i + μ_r)), here with C = 5, NDVI = 0.8 of eradiate."""
    angles, n, _ = case(unit)
    beta, _, M = fresnel(angles, n)
    brf = 5 * np.exp(-0.8) * np.exp(-np.tan(beta)) / (4 * (np.cos(angles[0]) + np.cos(angles[1])))
    check(lobe(MaignanLobe(), strength=5 * np.exp(-0.8), n=n), angles, brf / np.pi, M)


def test_maignan_is_eradiates(maignan_table):
    """40 matrices (scripts/make_eradiate_numbers.py), some of them near backscatter."""
    angles = [maignan_table[name] for name in ("theta_i", "theta_r", "phi")]
    C, ndvi, n = (maignan_table[name] for name in ("C", "ndvi", "n"))
    expected = maignan_table["M"]
    found = lobe(MaignanLobe(), strength=C * np.exp(-ndvi), n=n).mueller(*angles)
    assert (np.abs(found - expected).max((1, 2)) < 1e-10 * expected[:, 0, 0]).all()


@given(UNIT)
def test_litvinov(unit):
    """BRF = α f_sh exp(−tan²θ/2σ²)/(8σ² cos⁴θ (μ_i + μ_r)) R_F, f_sh = [½(1 + cos(k_γ(π − Θ)))]³."""
    angles, n, sigma = case(unit)
    k_gamma, alpha = unit[5], 0.8
    _, theta, M = fresnel(angles, n)
    theta_i, theta_r, phi = angles
    # Θ between the directions of propagation
    scattering = np.arccos(
        np.clip(-np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi), -1, 1)
    )
    f_sh = (0.5 * (1 + np.cos(k_gamma * (np.pi - scattering)))) ** 3
    brf = np.exp(-0.5 * (np.tan(theta) / sigma) ** 2) / (
        8 * sigma**2 * np.cos(theta) ** 4 * (np.cos(theta_i) + np.cos(theta_r))
    )
    model = lobe(LitvinovLobe(), strength=alpha, sigma=sigma, k_gamma=k_gamma, n=n)
    check(model, angles, alpha * f_sh * brf / np.pi, M)


@pytest.mark.parametrize("shadowing", ["v-cavity", "smith", "none"])
@given(UNIT)
def test_coating_is_the_paper_without_absorption(shadowing, unit):
    angles, n, sigma = case(unit)
    found = lobe(CoatingFacets(), sigma=sigma, n=n, shadowing=shadowing).mueller(*angles)
    expected = ref.specular(*angles, sigma, n, shadowing)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max() + 1e-300)


def test_ggx_of_plastic_is_normalised():
    """∫D cosθ dω = 1, from the matrix at normal view and light: f00 4 cosθ_i cosθ_r/(G R) = D."""
    alpha = 0.3
    beta = (np.arange(4000) + 0.5) * (np.pi / 4) / 4000
    # light from 2β, view along the normal: the facet is tilted by β
    f = lobe(PlasticLobe(), strength=1.0, roughness=alpha, n=100.0, distribution="ggx").mueller(2 * beta, 0.0)
    r_p, r_s = ref.fresnel_r(beta, 100.0)
    G = 2 / (1 + np.sqrt(1 + alpha**2 * np.tan(2 * beta) ** 2))
    D = f[:, 0, 0] * 4 * np.cos(2 * beta) / (G * 0.5 * (abs(r_p) ** 2 + abs(r_s) ** 2))
    share = (D * np.cos(beta) * np.sin(beta)).sum() * 2 * np.pi * (np.pi / 4) / 4000
    # facets tilted by up to 45°: tan² = 1
    assert share == pytest.approx(1 / (1 + alpha**2), abs=1e-6)


@pytest.mark.parametrize(
    ("part", "values", "most"),
    [
        (MaignanLobe(), {"strength": 8.0, "n": 1.5}, 0.07),
        (LitvinovLobe(), {"strength": 1.0, "sigma": 0.05, "k_gamma": 0.0, "n": 1.5}, 0.05),
        (LitvinovLobe(), {"strength": 1.0, "sigma": 0.6, "k_gamma": 0.0, "n": 1.5}, 0.05),
        (PlasticLobe(), {"strength": 1.0, "roughness": 0.3, "n": 100.0}, 1.0),
        (CoatingFacets(), {"sigma": 0.3, "n": 100.0}, 1.0),
    ],
    ids=lambda x: type(x).__name__ if not isinstance(x, dict | float) else "",
)
def test_energy_as_documented(part, values, most):
    theta = np.radians([0.0, 30.0, 60.0, 75.0, 85.0, 88.0])
    reflectance = directional_hemispherical_reflectance(lobe(part, **values), theta)
    assert (reflectance < most).all() and (reflectance > 0.0).all()


def test_unshadowed_facets_reflect_too_much_at_grazing_incidence():
    reflectance = directional_hemispherical_reflectance(
        lobe(DinerFacets(Uniform()), strength=1.0, n=1.5), np.radians(88)
    )
    assert reflectance == pytest.approx(2.1, abs=0.05)
