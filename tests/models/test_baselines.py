"""Named models of others: numbers of Mitsuba, energy, reciprocity, what is held."""

from __future__ import annotations

import numpy as np
import pytest

import independent as ref
from pbrdf.models import (
    MODELS,
    Baek2018,
    Diner2012,
    DoubleGauss,
    GermerSubsurface,
    Litvinov2011,
    Maignan2009,
    RPVHotSpot,
)
from pbrdf.models.reflectance import directional_hemispherical_reflectance

NAMES = (
    "baek-2018",
    "germer-subsurface",
    "rpv-hot-spot",
    "diner-2012",
    "diner-2012-uniform",
    "maignan-2009",
    "litvinov-2011",
)
RECIPROCAL = np.diag([1.0, 1.0, -1.0, 1.0])


def walter(theta, alpha):
    """Mitsuba's G₁ of Beckmann's distribution, the rational approximation of Walter et al. 2007."""
    a = 1.0 / (alpha * np.tan(theta))
    return np.where(a >= 1.6, 1.0, (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2))


@pytest.mark.parametrize(("distribution", "count"), [("beckmann", 60), ("ggx", 40)])
def test_baek_is_mitsubas_pplastic(pplastic_table, distribution, count):
    """100 matrices of ``pplastic`` (scripts/make_pplastic_numbers.py) to single precision.

    The exact G₁ of Beckmann's distribution is replaced by Mitsuba's approximation for that; by itself it is 0.35 % off.
    """
    table = pplastic_table
    rows = table["distribution"] == distribution
    assert rows.sum() == count
    angles = [table[name][rows] for name in ("theta_i", "theta_r", "phi")]
    n, alpha, rho_d, k_s = (table[name][rows] for name in ("n", "alpha", "rho_d", "k_s"))
    model = Baek2018(n=n, roughness=alpha, albedo=rho_d, strength=k_s, distribution=distribution)
    specular, diffuse = (model.mueller(*angles, part=part) for part in ("specular", "diffuse"))
    expected = table["M"][rows]
    f00 = expected[:, :1, :1]
    assert (np.abs(specular + diffuse - expected) / f00).max() < 0.007
    if distribution == "beckmann":
        for theta in angles[:2]:
            ratio = walter(theta, alpha) * (1 + ref.smith_lambda(theta, alpha / np.sqrt(2)))
            specular = specular * ratio[:, None, None]
    assert (np.abs(specular + diffuse - expected) / f00).max() < 2e-6
    # half of the rows show the facets, all of them the body
    assert (specular[:, 0, 0] > 0.1 * f00[:, 0, 0]).sum() >= 0.3 * count


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", ["specular", "diffuse"])
def test_reciprocal(name, part):
    """f(θ_r, θ_i, −φ) = diag(1,1,−1,1) f(θ_i, θ_r, φ)ᵀ diag(1,1,−1,1)."""
    cls = MODELS[name]
    rng = np.random.default_rng(4)
    theta_i, theta_r = rng.uniform(0.0, 1.5, (2, 200))
    phi = rng.uniform(-np.pi, np.pi, 200)
    values = {
        p.name: 0.37 if p.name == "asymmetry" else 1.3 if p.name in ("n", "k") else p.default
        for p in cls.parameters
    }
    for choice in [{}, *({o: c} for o, choices in cls.options.items() for c in choices[1:])]:
        model = cls(**values, **choice)
        forward = model.mueller(theta_i, theta_r, phi, part=part)
        back = model.mueller(theta_r, theta_i, -phi, part=part)
        expected = RECIPROCAL @ np.swapaxes(forward, -1, -2) @ RECIPROCAL
        assert (np.abs(back - expected).max((1, 2)) <= 1e-10 * forward[:, 0, 0] + 1e-300).all()


@pytest.mark.parametrize("n", [1.2, 1.5, 2.6])
def test_white_pigment_below_a_smooth_coating_reflects_all_light(n):
    theta = np.radians([0.0, 30.0, 60.0, 75.0])
    model = GermerSubsurface(n=n, pigment=1.0, sigma=0.002)
    np.testing.assert_allclose(directional_hemispherical_reflectance(model, theta), 1.0, atol=1e-3)


@pytest.mark.parametrize("shadowing", ["v-cavity", "smith"])
@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.2, 0.6])
def test_energy_of_germers_body_below_rough_facets(sigma, shadowing):
    theta = np.radians([0.0, 20.0, 40.0, 60.0, 75.0, 85.0])
    for n in (1.2, 2.6):
        model = GermerSubsurface(n=n, pigment=1.0, sigma=sigma, shadowing=shadowing)
        reflectance = directional_hemispherical_reflectance(model, theta)
        assert (reflectance < 1.005).all() and reflectance[-1] < 0.9


@pytest.mark.parametrize("distribution", ["beckmann", "ggx"])
@pytest.mark.parametrize("roughness", [0.01, 0.1, 0.8])
def test_white_plastic_loses_energy(roughness, distribution):
    theta = np.radians([0.0, 40.0, 75.0, 88.0])
    for n in (1.2, 2.6):
        model = Baek2018(n=n, albedo=1.0, strength=1.0, roughness=roughness, distribution=distribution)
        reflectance = directional_hemispherical_reflectance(model, theta)
        assert (reflectance < 0.99).all() and (reflectance > 0.2).all()


@pytest.mark.parametrize("cls", [Diner2012, Maignan2009, Litvinov2011])
def test_land_surfaces_hold_their_index(cls):
    """n = 1.5 unless it is given: no free parameter of a fit, but it can be freed."""
    (index,) = (p for p in cls.parameters if p.name == "n")
    assert not index.fitted and index.default == 1.5
    values = {p.name: p.default for p in cls.parameters if p.fitted}
    assert cls(**values).values["n"] == 1.5 and cls(**values, n=1.33).values["n"] == 1.33


def test_diner_is_the_double_gauss_without_shadowing_and_polarised_body():
    """The paper's lineage: ζ = 1, G = 1, t = 0 (LITERATURE 1.3)."""
    angles = np.array([0.2, 0.9]), np.array([0.5, 0.8]), np.array([1.0, 0.2])
    shape = {"a": 0.3, "k": 0.8, "b": -0.2}
    paint = DoubleGauss(sigma=0.2, n=1.5, **shape, t=0.0, shadowing="none")
    found = Diner2012(sigma=0.2, strength=1.0, **shape).mueller(*angles)
    np.testing.assert_allclose(found, paint.mueller(*angles), rtol=1e-13, atol=1e-18)


def test_rpv_with_facets_polarises_by_its_facets_alone():
    model = RPVHotSpot(rho_0=0.183, k=0.78, asymmetry=-0.1, rho_c=0.183, sigma=0.3, n=1.5)
    body = model.mueller(0.7, 0.7, 0.0, part="diffuse")
    assert body[0, 0] > 0.0 and np.count_nonzero(body) == 1
    stokes = model.stokes(0.9, 0.9, 0.0)
    assert -stokes[0] < stokes[1] < 0.0
