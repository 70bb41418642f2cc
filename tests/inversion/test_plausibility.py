"""Energy against closed forms and brute force, realisability, bounds, extrapolation, and what is said of them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad

import independent as ref
import pbrdf
from pbrdf.errors import ModelError
from pbrdf.inversion.plausibility import (
    Severity,
    directional_hemispherical_reflectance,
    least_coherency,
    plausibility,
)

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


def test_least_coherency_finds_the_printed_sign_of_m43():
    good = pbrdf.DoubleGauss(0.1, 2 - 1.5j, 0.3, 1.2, 0.5, 0.5)
    assert least_coherency(good)[0] > -1e-12

    def printed(theta_i, theta_r, phi):
        f = np.array(good.mueller(theta_i, theta_r, phi))
        f[:, 3, 2] = f[:, 2, 3]
        return f

    value, (theta_i, theta_r, _) = least_coherency(SimpleNamespace(mueller=printed))
    assert value < -0.05
    assert np.rad2deg(theta_i) > 30.0 and theta_r == pytest.approx(theta_i, abs=0.2)


def measured(model, theta_i, theta_r, phi=0.0, group=1):
    """Noiseless Stokes data of all pairs of angles in degrees, uncertainties of 1 %."""
    ti, tr = (np.deg2rad(a).ravel() for a in np.meshgrid(theta_i, theta_r))
    angles = ti, np.abs(tr), np.where(tr < 0.0, np.pi, np.deg2rad(phi))
    stokes = model.stokes(*angles)
    std = dict.fromkeys("IQU", 0.01 * stokes[:, 0])
    values = dict(zip("IQU", stokes.T[:3], strict=True))
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=std, group=np.full(len(ti), group))


def findings(result, dataset=None):
    """Findings by check."""
    by_check: dict[str, list] = {}
    for finding in plausibility(result, dataset):
        by_check.setdefault(finding.check, []).append(finding)
    return by_check


WELL = pbrdf.DoubleGauss(0.05, 1.6, 0.6, 1.1, 0.1, 0.6)


@pytest.fixture(scope="module")
def well_measured():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 5.0))
    return pbrdf.fit(dataset, WELL, starts=2), dataset


def test_a_plausible_fit_gets_no_objection(well_measured):
    result, dataset = well_measured
    found = findings(result, dataset)
    assert list(found) == ["energy", "realisability", "parameters", "lobe", "range"]
    assert {f.severity for check in found.values() for f in check} == {Severity.OK, Severity.NOTE}
    largest = directional_hemispherical_reflectance(result.model, np.deg2rad(np.arange(0, 90, 5))).max()
    assert f"reflects at most {largest:.3g} " in found["energy"][0].sentence
    assert "58 geometries: θ_i 20.0–50.0°, θ_r 0.0–70.0°, facet tilt 0.0–60.0°" in found["range"][0].sentence
    assert "everywhere out of the plane of incidence" in found["range"][0].sentence


def test_a_surface_that_reflects_more_than_it_receives_is_a_violation():
    bright = WELL.replace(a=1.8)
    dataset = measured(bright, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0))
    result = pbrdf.fit(dataset, bright, starts=2)
    (energy,) = findings(result, dataset)["energy"]
    assert energy.severity is Severity.VIOLATION and "more than it receives" in energy.sentence
    # on an unknown scale the same numbers say nothing
    for attributes in ({"scale": "arbitrary"}, {"quantity": "dn"}, {"quantity": "radiance"}):
        (energy,) = findings(result, dataset.assign_attrs(attributes))["energy"]
        assert energy.severity is Severity.NOTE and "says nothing about energy" in energy.sentence


def test_too_much_only_beyond_the_measured_incidence_is_a_warning():
    """k < 1 grows towards grazing: 1 is exceeded only where nothing was measured."""
    steep = WELL.replace(a=0.72, k=0.6)
    dataset = measured(steep, [5.0, 25.0], np.arange(-60.0, 65.0, 5.0))
    (energy,) = findings(pbrdf.fit(dataset, steep, starts=2), dataset)["energy"]
    assert energy.severity is Severity.WARNING and "beyond the measured angles" in energy.sentence


def test_a_fitted_gain_is_named_as_what_the_energy_rests_on():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0)).assign_attrs(scale="arbitrary")
    result = pbrdf.fit(dataset, WELL, starts=2, nuisances=["gain"])
    (energy,) = findings(result, dataset)["energy"]
    assert energy.severity is Severity.NOTE and "rests on the fitted gain" in energy.sentence


def test_parameters_at_bounds_and_undetermined_ones_are_named():
    dataset = measured(WELL, [20.0, 50.0], np.arange(-70.0, 75.0, 10.0))
    at_bound = findings(pbrdf.fit(dataset, starts=4, bounds={"n": (1.2, 1.5)}))["parameters"]
    assert any(f.sentence.startswith("n = 1.5 stands at upper bound") for f in at_bound)
    assert {f.severity for f in at_bound} == {Severity.WARNING}
    intensity = measured(WELL, [5.0], [-30.0, -28.0, -25.0, -22.0, 25.0, 28.0, 30.0, 35.0]).drop_vars(
        ["Q", "U", "Q_std", "U_std"]
    )
    free = findings(pbrdf.fit(intensity, starts=8))["parameters"]
    assert any("is not determined by these data" in f.sentence for f in free)


def test_an_unmeasured_lobe_is_a_warning():
    """σ and n then rest on the diffuse part alone."""
    away = measured(WELL, [20.0], [-60.0, -40.0, -20.0, 0.0, 60.0, 70.0])
    (lobe,) = findings(pbrdf.fit(away, WELL, starts=1, fix={"sigma": 0.05}))["lobe"]
    assert lobe.severity is Severity.WARNING and lobe.sentence.startswith(
        "No fitted point lies within 2σ (5.7°"
    )
    # 2σ of slope, 5.71° of facet tilt: 11.4° of view; one point at 31° is within, 32° is not
    for inside, count in ((31.0, 1), (32.0, 0)):
        near = measured(WELL, [20.0], [-60.0, -40.0, -20.0, 0.0, inside, 60.0, 70.0])
        (lobe,) = findings(pbrdf.fit(near, WELL, starts=1, fix={"sigma": 0.05}))["lobe"]
        assert lobe.severity is Severity.WARNING
        assert lobe.sentence.startswith("Only 1 fitted point lies" if count else "No fitted point")


def test_held_out_points_beyond_the_fitted_range_are_counted():
    dataset = measured(WELL, [20.0, 40.0, 60.0], np.arange(0.0, 75.0, 10.0))
    inner = findings(pbrdf.fit(dataset, WELL, starts=1, hold_out="theta_i=40"))["range"]
    assert "they test interpolation" in inner[1].sentence
    outer = findings(pbrdf.fit(dataset, WELL, starts=1, hold_out="theta_i=60"))["range"]
    assert "Of the 8 held-out geometries some lie outside the fitted range: 8 in θ_i" in outer[1].sentence


def test_out_of_plane_data_state_their_azimuths():
    dataset = measured(WELL, [20.0, 50.0], np.arange(0.0, 75.0, 5.0), phi=40.0)
    (finding,) = findings(pbrdf.fit(dataset, WELL, starts=1, fix={"sigma": 0.05}))["range"]
    assert "|φ| 40–40°" in finding.sentence and "out of the plane" not in finding.sentence
