"""Lobes of facets of every density: reciprocity, energy, widths, Mitsuba's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import independent as ref
from pbrdf.errors import ModelError
from pbrdf.models import CookTorranceLambert
from pbrdf.models.composed import ComposedModel
from pbrdf.models.lobe import measured_lobe_width
from pbrdf.models.parts.facets import (
    GGX,
    STRENGTH,
    Exponential,
    Facets,
    GaussianSlopes,
    GeneralisedGaussian,
    Uniform,
)
from pbrdf.models.parts.mirror import CoherentMirror
from pbrdf.models.parts.part import Renamed
from pbrdf.models.reflectance import directional_hemispherical_reflectance

RECIPROCAL = np.diag([1.0, 1.0, -1.0, 1.0])
#: An index with |r|² = 1 − 4e-6 at every angle.
MIRROR = {"n": 0.01, "kappa": 100.0}
DENSITIES = [
    (GaussianSlopes(), {"sigma": 0.05}),
    (GaussianSlopes(), {"sigma": 0.3}),
    (GGX(), {"roughness": 0.05}),
    (GGX(), {"roughness": 0.4}),
    (GeneralisedGaussian(), {"roughness": 0.05, "exponent": 0.7}),
    (GeneralisedGaussian(), {"roughness": 0.3, "exponent": 3.0}),
    (Exponential(), {"roughness": 0.1}),
    (Uniform(), {}),
]
EVERY = pytest.mark.parametrize(
    ("density", "values"), DENSITIES, ids=lambda x: type(x).__name__ if not isinstance(x, dict) else None
)


def lobe(part, **values):
    """A model of one part."""
    return type("Lobe", (ComposedModel,), {"name": "lobe", "parts": (part,)})(**values)


def random_angles(count=300, largest=85.0, seed=0):
    rng = np.random.default_rng(seed)
    return *np.radians(largest) * rng.random((2, count)), rng.uniform(-np.pi, np.pi, count)


@EVERY
def test_lobes_are_reciprocal(density, values):
    """The whole Mueller matrix of the reversed path, see test_model_symmetries.py, without and with shadowing."""
    theta_i, theta_r, phi = random_angles()
    for shadowing in ("v-cavity", "none"):
        model = lobe(Facets(density), **values, n=1.6, kappa=1.2, shadowing=shadowing)
        f = model.mueller(theta_i, theta_r, phi)
        back = RECIPROCAL @ np.swapaxes(model.mueller(theta_r, theta_i, -phi), -1, -2) @ RECIPROCAL
        assert f[:, 0, 0].max() > 1e-3
        np.testing.assert_allclose(back, f, rtol=0, atol=1e-11 * f[:, 0, 0].max())


@EVERY
def test_v_cavities_of_any_density_conserve_energy(density, values):
    """A perfect mirror's reflectance is at most 1 and nearly that where nothing is shadowed."""
    model = lobe(Facets(density), **values, **MIRROR)
    reflectance = directional_hemispherical_reflectance(model, np.radians([0.0, 40.0, 70.0, 80.0, 85.0]))
    assert (reflectance <= 1.0 + 2e-3).all()
    if values.get("sigma", 1.0) < 0.1:
        assert reflectance[:2] == pytest.approx(1.0, abs=1e-4)


@EVERY
def test_the_width_is_that_of_the_core(density, values):
    """Declared widths against the half width measured on the lobe of a mirror without shadowing."""
    model = lobe(Facets(density, ("none",)), **values, **MIRROR)
    declared = density.width(values)
    if isinstance(density, Uniform):
        assert declared is None and float(model.lobe_width()) == measured_lobe_width(model)
    else:
        assert declared == pytest.approx(measured_lobe_width(model), rel=0.03)
        assert model.lobe_width() == declared


def smith_lambda(theta, alpha, distribution):
    if distribution == "beckmann":
        return ref.smith_lambda(theta, alpha / math.sqrt(2.0))
    return 0.5 * (np.sqrt(1.0 + (alpha * np.tan(theta)) ** 2) - 1.0)


@pytest.mark.parametrize(("distribution", "tolerance"), [("beckmann", 8e-3), ("ggx", 2e-5)])
def test_lobes_are_those_of_mitsuba(roughconductor_table, distribution, tolerance):
    """60 + 40 matrices (scripts/make_neighbour_numbers.py), Mitsuba's separable Smith shadowing put in.

    Its Beckmann shadowing is an approximation good to 0.35 % a factor; the rest is single precision. Relative to f00,
    the matrices agree to 2e-5 in both.
    """
    rows = roughconductor_table["distribution"] == distribution
    t = {k: v[rows] for k, v in roughconductor_table.items()}
    assert rows.sum() == {"beckmann": 40, "ggx": 60}[distribution]
    density = {
        "beckmann": (GaussianSlopes(), {"sigma": t["alpha"] / math.sqrt(2.0)}),
        "ggx": (GGX(), {"roughness": t["alpha"]}),
    }
    facets, values = density[distribution]
    model = lobe(Facets(facets, ("none",)), **values, n=t["n"], kappa=t["kappa"])
    f = model.mueller(t["theta_i"], t["theta_r"], t["phi"])
    for theta in (t["theta_i"], t["theta_r"]):
        f /= (1.0 + smith_lambda(theta, t["alpha"], distribution))[:, None, None]
    M = t["M"]
    bright = M[:, 0, 0] > 1e-6
    assert bright.sum() >= 30
    f, M = f[bright], M[bright]
    assert (np.abs(f - M).max((1, 2)) / M[:, 0, 0]).max() < tolerance
    normalised = [x / x[:, :1, :1] for x in (f, M)]
    assert np.abs(normalised[0] - normalised[1]).max() < 2e-5


def test_the_strength_is_a_factor_and_held():
    model = lobe(Facets(GGX(), strength=True), roughness=0.1, n=1.5)
    assert model.values["strength"] == 1.0 and not STRENGTH.fitted
    f = model.mueller(0.5, 0.6, 0.1)
    np.testing.assert_allclose(model.replace(strength=0.3).mueller(0.5, 0.6, 0.1), 0.3 * f, rtol=1e-14)


def test_smith_is_offered_for_gaussian_slopes_alone():
    assert Facets(GaussianSlopes()).options["shadowing"] == ("v-cavity", "smith", "none")
    assert Facets(GGX()).options["shadowing"] == ("v-cavity", "none")
    assert not Facets(GGX(), ("none",)).options


def test_a_thin_dielectric_is_refused_by_its_own_name():
    second = Renamed(Facets(GaussianSlopes()), {"n": ("m", "m"), "kappa": ("x", "x")})
    for part, values in ((Facets(GaussianSlopes()), {"n": 0.9}), (second, {"m": 0.9})):
        with pytest.raises(ModelError, match="must be at least 1 where"):
            lobe(part, sigma=0.1, **values)
    with pytest.raises(ModelError, match="n must be at least 1"):
        CookTorranceLambert(0.1, 0.9, 0.5)


# --- the mirror image ---


@pytest.mark.parametrize("n", [1.5, 0.96 - 6.7j])
def test_a_mirror_carries_fresnels_reflectance(n):
    """At vanishing roughness ∫ f cosθ_r dω is the flat surface's, for every width that an instrument has."""
    theta = np.radians([0.0, 30.0, 60.0, 75.0])
    expected = np.mean([np.abs(r) ** 2 for r in ref.fresnel_r(theta, n)], axis=0)
    for width, tolerance in ((0.001, 1e-5), (0.005, 3e-4)):
        model = lobe(CoherentMirror(), mirror_width=width, mirror_height=0.0, n=n)
        found = directional_hemispherical_reflectance(model, theta)
        np.testing.assert_allclose(found, expected, rtol=tolerance)


def test_roughness_takes_rayleighs_share_from_the_mirror():
    """exp(−(4π h cosθ/λ)²) in the mirror direction."""
    theta, height = np.radians([0.0, 45.0, 70.0]), 0.08
    values = {"mirror_width": 0.004, "n": 1.5}
    smooth, rough = (
        lobe(CoherentMirror(), mirror_height=h, **values).mueller(theta, theta)[:, 0, 0]
        for h in (0.0, height)
    )
    np.testing.assert_allclose(
        rough / smooth, np.exp(-((4.0 * np.pi * height * np.cos(theta)) ** 2)), rtol=1e-12
    )


def test_the_mirror_is_as_wide_as_a_round_source():
    """δ = ρ/4: the mean square of the tilt of half vectors to a uniform disc of radius ρ, in and across the plane."""
    rho, n = 0.02, 200_000
    rng = np.random.default_rng(0)
    r, turn = rho * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    theta = 0.5
    p, s = np.array([np.cos(theta), 0.0, np.sin(theta)]), np.array([0.0, 1.0, 0.0])
    source = np.array([-np.sin(theta), 0.0, np.cos(theta)]) + r[:, None] * (
        np.cos(turn)[:, None] * p + np.sin(turn)[:, None] * s
    )
    source /= np.linalg.norm(source, axis=1, keepdims=True)
    h = source + np.array([np.sin(theta), 0.0, np.cos(theta)])
    in_plane, across = (h[:, :2] / h[:, 2:]).std(0)
    assert in_plane == pytest.approx(rho / 4.0, rel=0.01)
    # across the plane the half vector turns more: 1/cosβ
    assert across == pytest.approx(rho / 4.0 / np.cos(theta), rel=0.01)
