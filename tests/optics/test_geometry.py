"""Directions, frames, half vector and scattering angle: MODEL section 1 and paper eq. (10)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.optics.geometry import cross, dot, geometry_from_angles

VECTORS = ("omega_i", "omega_r", "p_i", "s_i", "p_r", "s_r", "facet")
ANGLES = arrays(float, (3, 64), elements=st.floats(0.0, 1.0))


@pytest.fixture(scope="module")
def build(jit, plain):
    """Angles → dictionary of NumPy arrays, vectors of shape (N, 3)."""

    def function(theta_i, theta_r, phi):
        size = np.size(theta_i)
        g = geometry_from_angles(jit(theta_i), jit(theta_r), jit(phi))
        out = {name: plain(getattr(g, name), size).T for name in VECTORS}
        for name in ("sin_i", "sin_r", "cos_i", "cos_r", "cos_beta", "cos_scattering"):
            out[name] = plain(getattr(g, name), size)
        return out

    return function


def draw(unit):
    return 0.5 * np.pi * unit[0], 0.5 * np.pi * unit[1], np.pi * (2 * unit[2] - 1)


@given(ANGLES)
def test_vectors_are_the_ones_of_the_model(build, unit):
    """ω_i = (−sinθ_i, 0, cosθ_i), ω_r = (sinθ_r cosφ, sinθ_r sinφ, cosθ_r)."""
    angles = draw(unit)
    g = build(*angles)
    w_i, w_r = ref.rays(*angles)
    np.testing.assert_allclose(g["omega_i"], w_i, atol=1e-15)
    np.testing.assert_allclose(g["omega_r"], w_r, atol=1e-15)
    np.testing.assert_allclose(g["sin_i"], np.sin(angles[0]), atol=1e-15)
    np.testing.assert_allclose(g["cos_r"], np.cos(angles[1]), atol=1e-15)


@given(ANGLES)
def test_frames_are_orthonormal_and_p_cross_s_is_k(build, unit):
    """(p, s, k) is right-handed for both rays, with k_i = −ω_i and k_r = ω_r; also along the normal."""
    g = build(*draw(unit))
    for p, s, k in ((g["p_i"], g["s_i"], -g["omega_i"]), (g["p_r"], g["s_r"], g["omega_r"])):
        np.testing.assert_allclose(np.cross(p, s), k, atol=1e-15)
        for a, b in ((p, p), (s, s), (k, k)):
            np.testing.assert_allclose((a * b).sum(-1), 1.0, atol=1e-15)
        np.testing.assert_allclose((p * s).sum(-1), 0.0, atol=1e-15)
        np.testing.assert_allclose(s[:, 2], 0.0, atol=1e-15)  # s lies in the surface, p holds the normal


def test_s_is_k_cross_normal(build):
    """s = k×ẑ/|k×ẑ| (and so p = s×k) wherever the ray is not along ẑ."""
    rng = np.random.default_rng(3)
    angles = rng.uniform(0.02, 1.55, 200), rng.uniform(0.02, 1.55, 200), rng.uniform(-np.pi, np.pi, 200)
    g = build(*angles)
    for name, expected in zip(("p_i", "s_i", "p_r", "s_r"), ref.frames(*angles), strict=True):
        np.testing.assert_allclose(g[name], expected, atol=2e-14)


@given(ANGLES)
def test_half_vector_mirrors_source_into_viewer(build, unit):
    """The facet is the unit bisector: 2(ω_i·m)m − ω_i = ω_r, and cosβ = ω_i·m = ω_r·m."""
    angles = draw(unit * np.array([0.999, 0.999, 1])[:, None])
    g = build(*angles)
    m = g["facet"]
    np.testing.assert_allclose((m * m).sum(-1), 1.0, atol=1e-14)
    np.testing.assert_allclose(2 * g["cos_beta"][:, None] * m - g["omega_i"], g["omega_r"], atol=1e-13)
    np.testing.assert_allclose((m * g["omega_r"]).sum(-1), g["cos_beta"], atol=1e-13)
    assert (m[:, 2] > 0).all()


@given(ANGLES)
def test_scattering_angle_is_eq_10(build, unit):
    """cosω = k_i·k_r = −μ_iμ_r + sinθ_i sinθ_r cosφ, and β = (π − ω)/2."""
    theta_i, theta_r, phi = draw(unit)
    g = build(theta_i, theta_r, phi)
    expected = -np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    np.testing.assert_allclose(g["cos_scattering"], expected, atol=2e-15)
    np.testing.assert_allclose(2 * g["cos_beta"] ** 2 - 1, -expected, atol=1e-14)


def test_mirror_direction_is_phi_zero(build):
    """Forward (φ = 0, θ_r = θ_i): the facet is the surface itself, β = θ_i, cosω = −cos2θ_i."""
    theta = np.radians([1.0, 30.0, 60.0, 89.0])
    g = build(theta, theta, 0 * theta)
    np.testing.assert_allclose(g["facet"], np.tile([0, 0, 1.0], (4, 1)), atol=1e-15)
    np.testing.assert_allclose(g["cos_beta"], np.cos(theta), rtol=1e-13)
    np.testing.assert_allclose(g["cos_scattering"], -np.cos(2 * theta), atol=1e-15)


def test_backscatter_is_phi_pi(build):
    """Exact backscatter (φ = π, θ_r = θ_i): the facet faces the source, β = 0, ω = π."""
    theta = np.radians([0.0, 30.0, 60.0, 89.0])
    g = build(theta, theta, np.full(4, np.pi))
    np.testing.assert_allclose(g["facet"], g["omega_i"], atol=1e-15)
    np.testing.assert_allclose(g["cos_beta"], 1.0, atol=1e-15)
    np.testing.assert_allclose(g["cos_scattering"], -1.0, atol=1e-15)


def test_frames_along_the_normal_are_the_limits(build):
    """At θ = 0 the frames are those of θ → 0 at the same azimuth, not an arbitrary choice."""
    phi = np.linspace(-3, 3, 7)
    zero, small = build(0 * phi, 0 * phi, phi), build(0 * phi + 1e-9, 0 * phi + 1e-9, phi)
    for name in ("p_i", "s_i", "p_r", "s_r"):
        np.testing.assert_allclose(zero[name], small[name], atol=2e-9)


def test_in_plane_local_incidence_is_half_the_bistatic_angle(build):
    """In the plane of incidence β depends on θ_i + θ_r alone (forward), on |θ_i − θ_r| backward."""
    theta_i, theta_r = np.radians([10.0, 35.0, 60.0]), np.radians([60.0, 35.0, 10.0])
    np.testing.assert_allclose(build(theta_i, theta_r, 0 * theta_i)["cos_beta"], np.cos(np.radians(35)))
    back = build(theta_i, theta_r, 0 * theta_i + np.pi)["cos_beta"]
    np.testing.assert_allclose(back, np.cos(0.5 * abs(theta_i - theta_r)))


def test_dot_and_cross():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 3))
    assert dot(tuple(a), tuple(b)) == pytest.approx(a @ b, abs=1e-15)
    np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), atol=1e-15)
