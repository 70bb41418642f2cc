"""Rotations between the facet's and the surface's frames: paper eq. (5), α1 and α2 of LITERATURE 1.1."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.optics.geometry import geometry_from_angles
from pbrdf.optics.reference_planes import facet_rotations, tilt_rotation

ANGLES = arrays(float, (3, 64), elements=st.floats(0.01, 0.99))


@pytest.fixture(scope="module")
def rotations(jit, plain):
    def function(theta_i, theta_r, phi):
        g = geometry_from_angles(jit(theta_i), jit(theta_r), jit(phi))
        return plain(facet_rotations(g), np.size(theta_i))

    return function


@given(ANGLES)
def test_rotations_are_minus_alpha(rotations, unit):
    """M(α) of eq. (5) with the printed tangents of α1 and α2: the turn χ of the frame is −α.

    M(α1) carries the incident light into the facet's frame, M(−α2) the reflected light out of it.
    """
    theta_i, theta_r, phi = 1.5 * unit[0], 1.5 * unit[1], np.pi * (2 * unit[2] - 1)
    c1, s1, c2, s2 = rotations(theta_i, theta_r, phi)
    _, _, a1, a2 = ref.explicit_angles(theta_i, theta_r, phi)
    np.testing.assert_allclose([c1, s1], [np.cos(2 * a1), -np.sin(2 * a1)], atol=1e-10)
    np.testing.assert_allclose([c2, s2], [np.cos(2 * a2), -np.sin(2 * a2)], atol=1e-10)


@given(ANGLES)
def test_rotations_turn_the_facets_s_into_place(rotations, unit):
    """Vectors: s_facet ∝ k×m has Stokes azimuth 2χ in the surface's (p, s) frame of either ray."""
    angles = 1.5 * unit[0], 1.5 * unit[1], np.pi * (2 * unit[2] - 1)
    w_i, w_r = ref.rays(*angles)
    p_i, s_i, p_r, s_r = ref.frames(*angles)
    c1, s1, c2, s2 = rotations(*angles)
    m = (w_i + w_r) / np.linalg.norm(w_i + w_r, axis=-1, keepdims=True)
    for k, p, s, c, d in ((-w_i, p_i, s_i, c1, s1), (w_r, p_r, s_r, c2, s2)):
        n = np.cross(k, m)
        n = n / np.linalg.norm(n, axis=-1, keepdims=True)
        along_p, along_s = (n * p).sum(-1), (n * s).sum(-1)
        # light polarised along n: (Q, U) = (p² − s², 2ps) = −(cos2χ, sin2χ)
        np.testing.assert_allclose(along_p**2 - along_s**2, -c, atol=1e-10)
        np.testing.assert_allclose(2 * along_p * along_s, -d, atol=1e-10)


def test_no_rotation_in_the_plane_of_incidence(rotations):
    theta = np.radians([10.0, 35.0, 60.0, 80.0])
    for phi in (0.0, np.pi):
        c1, s1, c2, s2 = rotations(theta, theta[::-1], np.full(4, phi))
        np.testing.assert_allclose([c1, c2], 1.0, atol=1e-12)
        np.testing.assert_allclose([s1, s2], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "angles",
    [(0, 0, 0), (0, 0, 1), (0, 0.5, 1), (0.5, 0, 1), (0.5, 0.5, np.pi), (0.5, 0.5, 0), (1e-9, 1e-9, 2)],
    ids=str,
)
def test_rotations_stay_rotations_where_the_angles_are_undefined(rotations, angles):
    """Normal incidence, normal view, exact backscatter: cos² + sin² = 1, finite."""
    c1, s1, c2, s2 = (x[0] for x in rotations(*(np.full(2, float(a)) for a in angles)))
    assert c1**2 + s1**2 == pytest.approx(1, abs=1e-12)
    assert c2**2 + s2**2 == pytest.approx(1, abs=1e-12)


def test_normal_incidence_turns_by_the_azimuth(rotations):
    """θ_i = 0: the facet's plane is the viewer's, so α2 = 0 and the incident frame turns by φ."""
    phi = np.linspace(-3, 3, 13)
    c1, s1, c2, s2 = rotations(0 * phi, 0 * phi + 0.7, phi)
    np.testing.assert_allclose([c2, s2], [np.ones(13), np.zeros(13)], atol=1e-12)
    _, _, a1, _ = ref.explicit_angles(1e-12, 0.7, phi)
    np.testing.assert_allclose([c1, s1], [np.cos(2 * a1), -np.sin(2 * a1)], atol=1e-10)


def test_tilt_rotation_is_the_squared_projection():
    """sin²β (cos2χ, sin2χ) of a facet normal m: the p direction of the facet lies along m's projection."""
    rng = np.random.default_rng(1)
    m = rng.normal(size=3)
    m /= np.linalg.norm(m)
    p, s, k = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    if np.cross(p, s) @ k < 0:
        k = -k
    s_m = np.cross(k, m)
    sin2 = s_m @ s_m
    p_m = np.cross(s_m, k) / np.sqrt(sin2)
    q, u = tilt_rotation(m @ p, m @ s)
    assert q == pytest.approx(sin2 * ((p_m @ p) ** 2 - (p_m @ s) ** 2), abs=1e-14)
    assert u == pytest.approx(sin2 * 2 * (p_m @ p) * (p_m @ s), abs=1e-14)
    # and vanishes, without division, for a facet seen face on
    q, u = tilt_rotation(k @ p, k @ s)
    assert abs(q) < 1e-15 and abs(u) < 1e-15
