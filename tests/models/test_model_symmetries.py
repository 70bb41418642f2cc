"""Reciprocity, mirror symmetry, continuity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

RECIPROCAL = np.diag([1.0, 1.0, -1.0, 1.0])
MIRROR = np.diag([1.0, 1.0, -1.0, -1.0])
UNIT = arrays(float, (10, 32), elements=st.floats(0.0, 1.0))


def case(unit, theta_max=88.0):
    p = {
        name: ref.LOWER[name] + u * (ref.UPPER[name] - ref.LOWER[name])
        for u, name in zip(unit, ref.PARAMETERS, strict=False)
    }
    p["sigma"] = 0.02 + p["sigma"]
    p["k"] = 0.7 + 2 * unit[4]
    p["kappa"] = 0.01 + p["kappa"]
    theta = np.radians(theta_max) * unit[7:9]
    return p, (theta[0], theta[1], np.pi * (2 * unit[9] - 1))


def assert_same(found, expected, tolerance=1e-12):
    scale = np.maximum(expected[:, 0, 0], 1e-250)
    assert (abs(found - expected).max((1, 2)) / scale).max() <= tolerance


def swapped(model, angles, part):
    """The reversed path: source where the viewer was. Turned back into our axes its azimuth is −φ."""
    theta_i, theta_r, phi = angles
    f = model.mueller(theta_r, theta_i, -phi, part=part)
    return RECIPROCAL @ np.swapaxes(f, -1, -2) @ RECIPROCAL


def test_the_law_of_reciprocity_for_jones_matrices():
    """Derivation of f(θ_r, θ_i, −φ) = diag(1,1,−1,1) f(θ_i, θ_r, φ)ᵀ diag(1,1,−1,1).

    Reversing both rays turns k into −k, so s = k×ẑ into −s and leaves p = s×k. With fields in fixed axes
    the reversed path has the transposed Jones matrix; in the turned axes J' = diag(1,−1) Jᵀ diag(1,−1).
    The Mueller matrix of J' is diag(1,1,−1,1) Mᵀ diag(1,1,−1,1).
    """
    rng = np.random.default_rng(0)
    J = rng.normal(size=(50, 2, 2)) + 1j * rng.normal(size=(50, 2, 2))
    flip = np.diag([1, -1])
    reverse = ref.mueller_from_jones(flip @ np.swapaxes(J, -1, -2) @ flip)
    expected = RECIPROCAL @ np.swapaxes(ref.mueller_from_jones(J), -1, -2) @ RECIPROCAL
    np.testing.assert_allclose(reverse, expected, atol=1e-13)


@given(UNIT)
def test_specular_part_is_reciprocal(unit):
    p, angles = case(unit)
    model = DoubleGauss(**p)
    assert_same(swapped(model, angles, "specular"), model.mueller(*angles, part="specular"))


@pytest.mark.parametrize(("accuracy", "tolerance"), [("default", 5e-6), ("high", 1e-10)])
@given(UNIT)
def test_reciprocal_model_is_reciprocal_as_a_whole(accuracy, tolerance, unit):
    """For θ_i ≠ θ_r the reversed path is averaged with the mirrored nodes: reciprocal beyond the accuracy."""
    unit = unit.copy()
    unit[7] = np.where(abs(unit[7] - unit[8]) < 1e-3, 0.5 * unit[7] + 0.25, unit[7])
    unit[7] = np.where(abs(unit[7] - unit[8]) < 1e-3, 0.9 * unit[7], unit[7])
    unit[7:9] = 0.03 + 0.97 * unit[7:9]  # below 2° both edges count as equally far
    p, angles = case(unit)
    model = ReciprocalDoubleGauss(**p, accuracy=accuracy)
    for part in ("total", "diffuse"):
        assert_same(swapped(model, angles, part), model.mueller(*angles, part=part), tolerance)


def test_reciprocal_model_at_equal_zenith_angles():
    """θ_i = θ_r: which edge counts as the nearer one is a toss-up, so reciprocity holds to the accuracy only.

    Default: 1e-5 at the paints' σ up to 75°; high: 2e-5 anywhere.
    """
    rng = np.random.default_rng(2)
    theta, phi = np.radians(75) * rng.random(3000), np.pi * (2 * rng.random(3000) - 1)
    model = ReciprocalDoubleGauss(
        0.002 + 0.098 * rng.random(3000), 1.6, 1.0, 0.7 + 2 * rng.random(3000), 0.5, 0.7
    )
    angles = theta, theta, phi
    assert_same(swapped(model, angles, "total"), model.mueller(*angles), 1e-5)
    model = model.replace(sigma=0.002 + 0.598 * rng.random(3000), accuracy="high")
    angles = theta * 1.18, theta * 1.18, phi
    assert_same(swapped(model, angles, "total"), model.mueller(*angles), 2e-5)


def test_diffuse_part_of_double_gauss_is_not_reciprocal():
    """Its body light leaves through the facets but does not enter through them: t > 0 breaks reciprocity."""
    angles = tuple(np.radians([[20.0, 30.0], [70.0, 60.0], [40.0, -100.0]]))
    model = DoubleGauss(0.04, 1.62, 1.5, 1.25, 0.18, 0.67)
    forward, back = model.mueller(*angles, part="diffuse"), swapped(model, angles, "diffuse")
    assert (abs(forward - back)[:, 0, 0] > 0.01 * forward[:, 0, 0]).all()
    # and t = 0 restores it: the MRPV function is symmetric
    model = model.replace(t=0.0)
    assert_same(swapped(model, angles, "diffuse"), model.mueller(*angles, part="diffuse"))


@given(UNIT)
@pytest.mark.parametrize("model", [DoubleGauss, ReciprocalDoubleGauss])
def test_mirror_symmetry(model, unit):
    """The surface has no handedness: f(θ_i, θ_r, −φ) = diag(1,1,−1,−1) f(θ_i, θ_r, φ) diag(1,1,−1,−1)."""
    p, (theta_i, theta_r, phi) = case(unit)
    m = model(**p)
    assert_same(MIRROR @ m.mueller(theta_i, theta_r, -phi) @ MIRROR, m.mueller(theta_i, theta_r, phi), 1e-10)


def test_in_plane_matrices_are_block_diagonal():
    """At φ = 0 and π nothing couples (I, Q) with (U, V)."""
    theta = np.radians([10.0, 40.0, 70.0])
    for model in (DoubleGauss, ReciprocalDoubleGauss):
        m = model(0.1, 2 - 1.5j, 1.0, 1.3, 0.5, 0.7)
        for phi in (0.0, np.pi):
            f = m.mueller(theta[:, None], theta[None, :], phi)
            f = f / f[..., :1, :1]
            assert abs(f[..., :2, 2:]).max() < 1e-9 and abs(f[..., 2:, :2]).max() < 1e-9


@given(arrays(float, (3, 32), elements=st.floats(0.0, 1.0)))
@pytest.mark.parametrize("model", [DoubleGauss, ReciprocalDoubleGauss])
def test_azimuth_has_period_two_pi(model, unit):
    m = model(0.2, 1.6, 1.0, 1.3, 0.5, 0.7)
    theta_i, theta_r, phi = 1.5 * unit[0], 1.5 * unit[1], np.pi * (2 * unit[2] - 1)
    assert_same(m.mueller(theta_i, theta_r, phi + 2 * np.pi), m.mueller(theta_i, theta_r, phi), 1e-9)


@pytest.mark.parametrize("options", [{}, {"normalization": "visible"}], ids=["weighted", "visible"])
@pytest.mark.parametrize("index", [1.62, 2 - 1.5j], ids=str)
def test_continuity(index, options):
    """Across φ = 0 and ±π, to θ_i → 0 and θ_r → 0 at fixed φ, and to exact backscatter: no jumps."""
    m = DoubleGauss(0.15, index, 1.0, 1.3, 0.5, 0.7, **options)
    step = 1e-6
    pairs = [
        ((0.6, 0.8, -step), (0.6, 0.8, step)),
        ((0.6, 0.8, np.pi - step), (0.6, 0.8, -np.pi + step)),
        ((0.0, 0.8, 0.7), (step, 0.8, 0.7)),
        ((0.8, 0.0, 0.7), (0.8, step, 0.7)),
        ((0.0, 0.0, 0.7), (step, step, 0.7)),
        ((0.6, 0.6, np.pi), (0.6, 0.6 + step, np.pi)),
        ((0.6, 0.6, 0.0), (0.6, 0.6 + step, 0.0)),
    ]
    a, b = (m.mueller(*np.array(x).T) for x in zip(*pairs, strict=True))
    assert_same(a, b, 2e-4)  # f changes by up to 1/σ ≈ 7 … 40 times the step


def test_normal_incidence_turns_with_the_azimuth():
    """θ_i = 0: the surface is isotropic, so φ only turns the incident frame: f(φ) = f(0) R(φ)."""
    m = DoubleGauss(0.2, 2 - 1.5j, 1.0, 1.3, 0.5, 0.7)
    phi = np.linspace(-3, 3, 11)
    f = m.mueller(0.0, 0.5, phi)
    expected = m.mueller(0.0, 0.5, 0.0) @ ref.paper_rotation(phi)
    np.testing.assert_allclose(f, expected, atol=1e-9 * f[0, 0, 0])
