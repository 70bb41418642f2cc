"""A round source: the average over its disc, and what it does to the peak of the lobe."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from independent import frames, fresnel_r, rays
from pbrdf.data.paints import load_paint
from pbrdf.models.extended_source import disc_rule, stokes_under_disc


@pytest.mark.parametrize(("radii", "turns"), [(6, 12), (3, 8)])
def test_the_rule_averages_polynomials_over_the_disc(radii, turns):
    """⟨x² y²⟩ = 1/24 and ⟨r⁴⟩ = 1/3 over the unit disc; odd powers vanish."""
    x, y, w = map(np.array, disc_rule(radii, turns))
    assert w.sum() == pytest.approx(1.0)
    assert (w * x**2 * y**2).sum() == pytest.approx(1.0 / 24.0)
    assert (w * (x**2 + y**2) ** 2).sum() == pytest.approx(1.0 / 3.0)
    assert (w * x).sum() == pytest.approx(0.0, abs=1e-14)
    assert (w * x**2 * y).sum() == pytest.approx(0.0, abs=1e-14)


def test_a_point_is_the_limit_of_small_discs():
    model = load_paint("matte-white-thick")
    angles = np.deg2rad([[30.0, 50.0], [33.0, 20.0], [0.0, 40.0]])
    point = model.stokes(*angles)
    np.testing.assert_allclose(stokes_under_disc(model, *angles, 1e-5), point, rtol=1e-6, atol=1e-9)
    assert np.array_equal(stokes_under_disc(model, *angles, 0.0), point)


def test_the_intensity_is_the_average_over_directions_of_the_source():
    """Against a brute-force average over the disc, every ray with its own angles and its share of the irradiance."""
    model = load_paint("white")
    radius, centre = np.deg2rad(1.5), np.deg2rad([40.0, 41.0, 25.0])
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 401), np.linspace(-1.0, 1.0, 401))
    inside = u**2 + v**2 < 1.0
    to_source, to_camera = (a for a in rays(*centre))
    p, s, _, _ = frames(*centre)
    moved = to_source + radius * (u[inside][:, None] * p + v[inside][:, None] * s)
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    theta_i = np.arccos(moved[:, 2])
    phi = np.arctan2(to_camera[1], to_camera[0]) - np.arctan2(-moved[:, 1], -moved[:, 0])
    each = model.stokes(theta_i, centre[1], np.mod(phi, 2.0 * np.pi), part="specular")[:, 0]
    brute = (each * np.cos(theta_i)).mean() / np.cos(centre[0])
    diffuse = model.stokes(*centre, part="diffuse")[0]
    averaged = stokes_under_disc(model, *(np.atleast_1d(a) for a in centre), radius)[0, 0]
    assert averaged - diffuse == pytest.approx(brute, rel=1e-3)


@pytest.mark.parametrize(
    ("paint", "radius", "ratio"),
    [
        ("matte-white-thick", 0.0, 1.25),
        ("matte-white-thick", 2.0, 1.24),
        ("matte-white-thick", 5.0, 1.18),
        ("matte-white-thick", 10.0, 1.09),
        ("white", 0.5, 1.20),
        ("white", 2.0, 1.05),
        ("white", 5.0, 1.04),
    ],
)
def test_an_extended_source_takes_away_the_rise_of_the_peak(paint, radius, ratio):
    """Specular radiance in the mirror direction at β = 35° over that at 15°: F/cosβ for a point, F for a wide disc."""
    assert peak_ratio(load_paint(paint), radius) == pytest.approx(ratio, abs=0.006)


def test_a_wide_source_shows_the_reflectance_of_fresnel():
    """The image of a source wider than the lobe is as bright as the source times F."""
    model = load_paint("white")
    beta = np.deg2rad([15.0, 35.0])
    r_p, r_s = fresnel_r(beta, model.values["n"])
    reflectance = 0.5 * (np.abs(r_p) ** 2 + np.abs(r_s) ** 2)
    # but for the curvature of F over the lobe, of the order of σ² = 4e-5
    assert peak_ratio(model, 5.0) == pytest.approx(reflectance[1] / reflectance[0], rel=1e-4)


def peak_ratio(model, radius):
    angles = np.deg2rad([[15.0, 35.0], [15.0, 35.0], [0.0, 0.0]])
    seen = stokes_under_disc(model, *angles, np.deg2rad(radius)) - model.stokes(*angles, part="diffuse")
    radiance = seen[:, 0] * np.cos(angles[0])
    return radiance[1] / radiance[0]


def test_polarised_light_of_each_geometry_is_taken():
    model = pbrdf.DoubleGauss(0.05, 1.6, 1.0, 1.2, 0.1, 0.5)
    angles = np.deg2rad([[30.0, 30.0], [30.0, 30.0], [0.0, 0.0]])
    light = np.array([[1.0, 0.5, 0.0, 0.0], [1.0, 0.0, 0.3, 0.4]])
    seen = stokes_under_disc(model, *angles, 1e-4, light)
    np.testing.assert_allclose(seen, model.stokes(*angles, incident=light), rtol=1e-5, atol=1e-9)
