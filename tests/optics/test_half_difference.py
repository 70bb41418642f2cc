"""Half and difference angles, written down independently with vectors and Rusinkiewicz's two rotations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pbrdf.backend import get_backend
from pbrdf.models import DoubleGauss
from pbrdf.optics.geometry import geometry_from_angles
from pbrdf.optics.half_difference import (
    directions,
    from_scattering_plane,
    half_difference,
    to_scattering_plane,
)
from pbrdf.optics.reference_planes import facet_rotations

zenith = st.floats(0.001, 1.55)
azimuth = st.floats(-3.14, 3.14)


def by_rotation(theta_i, theta_r, phi):
    """Rusinkiewicz's definition: turn h onto ẑ, about ẑ by −φ_h and then about ŷ by −θ_h; i then has (θ_d, φ_d)."""
    i = np.array([-np.sin(theta_i), 0.0, np.cos(theta_i)])
    o = np.array([np.sin(theta_r) * np.cos(phi), np.sin(theta_r) * np.sin(phi), np.cos(theta_r)])
    h = (i + o) / np.linalg.norm(i + o)
    theta_h, phi_h = np.arccos(h[2]), np.arctan2(h[1], h[0])
    about_z = [[np.cos(phi_h), np.sin(phi_h), 0], [-np.sin(phi_h), np.cos(phi_h), 0], [0, 0, 1]]
    about_y = [[np.cos(theta_h), 0, -np.sin(theta_h)], [0, 1, 0], [np.sin(theta_h), 0, np.cos(theta_h)]]
    d = np.array(about_y) @ about_z @ i
    return theta_h, np.arccos(d[2]), np.arctan2(d[1], d[0])


@given(zenith, zenith, azimuth)
def test_the_definition(theta_i, theta_r, phi):
    expected = by_rotation(theta_i, theta_r, phi)
    found = half_difference(theta_i, theta_r, phi)
    assert_allclose(found[:2], expected[:2], atol=1e-7)
    if min(expected[:2]) > 1e-3:
        assert abs(np.angle(np.exp(1j * (found[2] - expected[2])))) < 1e-6


@given(zenith, zenith, azimuth)
def test_there_and_back(theta_i, theta_r, phi):
    back = directions(*half_difference(theta_i, theta_r, phi))
    assert_allclose(back[:2], [theta_i, theta_r], atol=1e-12)
    assert abs(np.angle(np.exp(1j * (back[2] - phi)))) < 1e-9


def test_theta_d_alone_is_the_mirror_direction():
    assert_allclose(directions(0.0, 0.7, 1.1), [0.7, 0.7, 0.0], atol=1e-15)


def test_theta_h_alone_is_backscatter():
    assert_allclose(directions(0.7, 0.0, 1.1), [0.7, 0.7, np.pi], atol=1e-15)


def test_phi_d_zero_has_the_source_closer_to_the_surface():
    """In the plane of incidence the half vector leans towards the source by half of 70° − 10°."""
    assert_allclose(np.rad2deg(half_difference(np.deg2rad(70), np.deg2rad(10), 0.0)), [30, 40, 0], atol=1e-12)
    assert_allclose(
        np.rad2deg(half_difference(np.deg2rad(10), np.deg2rad(70), 0.0)), [30, 40, 180], atol=1e-12
    )


def test_positive_phi_d_turns_anticlockwise_seen_from_above():
    """θ_h = θ_d = 30°, φ_d = 90°: i lies to the left of the vertical plane through h, o to the right.

    Seen from i's azimuth the viewer is then clockwise, by less than a half turn.
    """
    theta_i, theta_r, phi = directions(np.deg2rad(30), np.deg2rad(30), np.deg2rad(90))
    assert theta_i == pytest.approx(theta_r)
    azimuth_from_source = np.mod(phi + np.pi, 2 * np.pi)
    assert np.pi < azimuth_from_source < 2 * np.pi


@given(zenith, zenith, azimuth)
def test_exchanging_the_rays_adds_a_half_turn(theta_h, theta_d, phi_d):
    i, r, phi = directions(theta_h, theta_d, phi_d)
    i_swapped, r_swapped, phi_swapped = directions(theta_h, theta_d, phi_d + np.pi)
    assert_allclose([i_swapped, r_swapped], [r, i], atol=1e-12)
    if min(np.sin(i), np.sin(r)) > 1e-3:
        assert abs(np.angle(np.exp(1j * (phi + phi_swapped)))) < 1e-9


def test_below_the_horizon_is_said_by_an_angle_above_a_quarter_turn():
    assert directions(np.deg2rad(60), np.deg2rad(60), 0.0)[0] == pytest.approx(np.deg2rad(120))


def random_geometries(rng, count=200):
    theta_i, theta_r = np.arccos(rng.uniform(0.05, 1.0, (2, count)))
    return theta_i, theta_r, rng.uniform(-np.pi, np.pi, count)


def test_in_the_scattering_plane_reflection_is_fresnels():
    """There a facet's matrix is that of the coating at the angle of incidence θ_d, in every geometry.

    Over (p, s), with n − iκ: m01 = m10 = (R_p − R_s)/2 < 0, m22 = Re(r_p r_s*), m32 = −m23 = Im(r_p r_s*).
    """
    geometry = random_geometries(np.random.default_rng(1))
    theta_h, theta_d, phi_d = half_difference(*geometry)
    n = 1.8 - 1.5j
    f = DoubleGauss(0.3, n, 1.0, 1.0, 0.0, 0.0).mueller(*geometry, part="specular")
    m = to_scattering_plane(f, theta_h, theta_d, phi_d)
    inside, outside = np.sqrt(1 - (np.sin(theta_d) / n) ** 2), np.cos(theta_d)
    r_p = (n * outside - inside) / (n * outside + inside)
    r_s = (outside - n * inside) / (outside + n * inside)
    a, b, c = (abs(r_p) ** 2 + abs(r_s) ** 2) / 2, (abs(r_p) ** 2 - abs(r_s) ** 2) / 2, r_p * np.conj(r_s)
    expected = np.zeros_like(m)
    expected[:, 0, 0] = expected[:, 1, 1] = a
    expected[:, 0, 1] = expected[:, 1, 0] = b
    expected[:, 2, 2] = expected[:, 3, 3] = c.real
    expected[:, 3, 2], expected[:, 2, 3] = c.imag, -c.imag
    assert_allclose(m / m[:, :1, :1], expected / a[:, np.newaxis, np.newaxis], atol=1e-12)
    assert abs(expected[:, 3, 2] / a).max() > 0.5


def test_the_turn_is_that_of_the_optics():
    geometry = random_geometries(np.random.default_rng(2))
    backend = get_backend()
    on_device = (backend.upload(backend.Float, a) for a in geometry)
    cos_i, sin_i, cos_r, sin_r = (x.numpy() for x in facet_rotations(geometry_from_angles(*on_device)))
    matrices = np.random.default_rng(3).normal(size=(200, 4, 4))

    def turn(c, s):
        out = np.tile(np.eye(4), (len(c), 1, 1))
        out[:, 1, 1] = out[:, 2, 2] = c
        out[:, 1, 2], out[:, 2, 1] = s, -s
        return out

    expected = turn(cos_r, sin_r) @ matrices @ turn(cos_i, sin_i).transpose(0, 2, 1)
    assert_allclose(to_scattering_plane(matrices, *half_difference(*geometry)), expected, atol=1e-10)


@pytest.mark.parametrize(
    "angles", [(0.5, 0.6, 0.7), (0.0, 0.6, 0.7), (0.5, 0.0, 0.7), (0.0, 0.0, 0.7), (0.5, 0.6, np.pi)]
)
def test_turning_back_is_the_inverse_also_where_directions_meet(angles):
    matrix = np.random.default_rng(4).normal(size=(4, 4))
    assert_allclose(from_scattering_plane(to_scattering_plane(matrix, *angles), *angles), matrix, atol=1e-14)


@pytest.mark.parametrize(
    ("near", "at"), [((0.5, 1e-7, 0.7), (0.5, 0.0, 0.7)), ((1e-7, 0.5, 0.7), (0.0, 0.5, 0.7))]
)
def test_the_frame_where_directions_meet_is_the_limit(near, at):
    """Backscatter (θ_d = 0) and the mirror direction (θ_h = 0), for a model with a polarised body."""
    model = DoubleGauss(0.2, 1.6, 1.0, 1.3, 0.2, 1.0)
    close, exact = (to_scattering_plane(model.mueller(*directions(*a)), *a) for a in (near, at))
    assert_allclose(close, exact, atol=1e-5 * exact[0, 0])
