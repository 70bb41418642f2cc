"""Reflection and transmission at a facet: paper eqs (6)-(8), LITERATURE 1.2 and 3e."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.optics.fresnel import (
    internal_diffuse_reflectance,
    mueller_reflection,
    refraction_root,
    transmittances,
)

UNIT = arrays(float, (3, 64), elements=st.floats(0.0, 1.0))
METALS = {"silver": 0.05 - 3.1j, "gold": 0.18 - 3.4j, "aluminium": 1.0 - 6.5j, "SiC-like": 0.06 - 0.5j}


@pytest.fixture(scope="module")
def reflection(jit, plain):
    """(β, complex n) → Mueller matrices (N, 4, 4) in the facet's frame."""

    def function(beta, n):
        n = np.broadcast_to(np.asarray(n, dtype=complex), np.shape(beta))
        kappa = None if not n.imag.any() else jit(-n.imag)
        r = mueller_reflection(jit(np.cos(beta)), jit(n.real), kappa)
        parts = [np.zeros(np.size(beta)) if x is None else plain(x, np.size(beta)) for x in r]
        mean, difference, real, imaginary = parts
        M = np.zeros((np.size(beta), 4, 4))
        M[:, 0, 0] = M[:, 1, 1] = mean
        M[:, 0, 1] = M[:, 1, 0] = difference
        M[:, 2, 2] = M[:, 3, 3] = real
        M[:, 2, 3], M[:, 3, 2] = -imaginary, imaginary
        return M

    return function


@pytest.fixture(scope="module")
def transmission(jit, plain):
    """(β, complex n, kind) → (T_p, T_s, half the difference over sin²β)."""

    def function(beta, n, kind):
        n = np.broadcast_to(np.asarray(n, dtype=complex), np.shape(beta))
        kappa = None if not n.imag.any() else jit(-n.imag)
        mean, half = (
            plain(x, np.size(beta)) for x in transmittances(jit(np.cos(beta)), jit(n.real), kappa, kind)
        )
        difference = half * np.sin(beta) ** 2
        return mean + difference, mean - difference, half

    return function


@given(UNIT)
def test_reflection_of_dielectrics_is_eqs_6_to_8(reflection, unit):
    beta, n = unit[0] * np.radians(89.999), 1.0 + 1e-3 + 3 * unit[1]
    np.testing.assert_allclose(reflection(beta, n), ref.mirror_mueller(beta, n), atol=3e-14)


@given(UNIT)
def test_reflection_of_absorbers_is_eqs_6_to_8(reflection, unit):
    """Complex index n − iκ, n below and above 1."""
    beta, n = unit[0] * np.radians(89.999), 0.02 + 3 * unit[1] - 1j * (1e-6 + 7 * unit[2])
    np.testing.assert_allclose(reflection(beta, n), ref.mirror_mueller(beta, n), atol=2e-13)


@pytest.mark.parametrize("n", METALS.values(), ids=METALS)
def test_metals_with_n_below_one(reflection, n):
    """Noble metals: the refraction root has a negative real square, R stays in (0, 1], R_s ≥ R_p."""
    beta = np.radians(np.linspace(0, 89.9, 50))
    M = reflection(beta, n)
    np.testing.assert_allclose(M, ref.mirror_mueller(beta, n), atol=1e-12)
    R_p, R_s = M[:, 0, 0] + M[:, 0, 1], M[:, 0, 0] - M[:, 0, 1]
    assert (R_p > 0).all() and (R_s <= 1 + 1e-15).all() and (R_s >= R_p - 1e-15).all()


def test_refraction_root_is_the_principal_one(jit, plain):
    """q = √(ε − sin²β), ε = (n − iκ)², Re q ≥ 0 and Im q ≤ 0."""
    rng = np.random.default_rng(0)
    beta, n, kappa = rng.uniform(0, 1.57, 300), rng.uniform(0.02, 3, 300), rng.uniform(1e-9, 6, 300)
    q, qi = (plain(x, 300) for x in refraction_root(jit(np.cos(beta)), jit(n), jit(kappa)))
    expected = np.sqrt((n - 1j * kappa) ** 2 - np.sin(beta) ** 2)
    np.testing.assert_allclose(q - 1j * qi, expected, rtol=1e-12)
    assert (q >= 0).all() and (qi >= 0).all()


def test_coefficients_satisfy_the_boundary_conditions():
    """Eqs (7)-(8) themselves: tangential E and H are continuous with the transmitted wave of ``independent``.

    Air above (angle β), coating n − iκ below (cosβ' complex). s: 1 + r_s = t_s and
    cosβ(1 − r_s) = n cosβ' t_s; p: cosβ(1 − r_p) = cosβ' t_p and 1 + r_p = n t_p (light entering).
    """
    beta = np.radians(np.linspace(1, 89, 30))
    for n in (1.6207, 2 - 1.5j, 0.18 - 3.4j):
        r_p, r_s = ref.fresnel_r(beta, n)
        c, ct = np.cos(beta), np.sqrt(1 - (np.sin(beta) / n) ** 2 + 0j)
        t_s, t_p = 1 + r_s, (1 + r_p) / n
        np.testing.assert_allclose(c * (1 - r_s), n * ct * t_s, rtol=1e-12)
        np.testing.assert_allclose(c * (1 - r_p), ct * t_p, rtol=1e-12)


def test_no_p_light_is_reflected_at_brewsters_angle(reflection):
    """tanβ_B = n: R_p = 0, so the reflected light is fully s-polarised and M is singular."""
    n = np.array([1.3, 1.6207, 1.7984, 2.6])
    M = reflection(np.arctan(n), n)
    np.testing.assert_allclose(M[:, 0, 0], -M[:, 0, 1], atol=1e-15)
    np.testing.assert_allclose(M[:, 2:, 2:], 0, atol=1e-15)
    assert (M[:, 0, 0] > 0.01).all()


@pytest.mark.parametrize("n", [1.6207, 2 - 1.5j, 0.18 - 3.4j])
def test_normal_incidence_sign(reflection, n):
    """At β = 0, r_p = −r_s: M_r = R diag(1, 1, −1, −1) with R = |(n − 1)/(n + 1)|²."""
    R = abs((n - 1) / (n + 1)) ** 2
    M = reflection(np.zeros(2), n)[0]
    np.testing.assert_allclose(M, R * np.diag([1, 1, -1, -1]), atol=1e-15)


def test_sign_changes_at_brewster(reflection):
    """r_p r_s < 0 below Brewster's angle (mirror turns U and V over), > 0 above."""
    n = 1.6207
    brewster = np.arctan(n)
    M = reflection(np.array([brewster - 0.05, brewster + 0.05]), n)
    assert M[0, 2, 2] < 0 < M[1, 2, 2]


def test_grazing_incidence_reflects_everything(reflection):
    for n in (1.5, 2 - 1.5j):
        M = reflection(np.full(2, np.radians(89.99999)), n)[0]
        np.testing.assert_allclose(M, np.eye(4), atol=2e-6)


def test_a_thin_extinction_tends_to_the_dielectric(reflection):
    beta = np.radians(np.linspace(0, 89, 40))
    np.testing.assert_allclose(reflection(beta, 1.62 - 1e-9j), reflection(beta, 1.62), atol=5e-9)


@given(UNIT)
def test_flux_transmittance_is_one_minus_reflectance(reflection, transmission, unit):
    """T_x = 1 − |r_x|² (flux), for dielectrics and absorbers, against this package's own M_r."""
    beta = unit[0] * np.radians(89.999)
    for n in (1.05 + 2 * unit[1], 0.05 + 3 * unit[1] - 1j * (1e-3 + 4 * unit[2])):
        M = reflection(beta, n)
        T_p, T_s, _ = transmission(beta, n, "flux")
        np.testing.assert_allclose(T_p, 1 - (M[:, 0, 0] + M[:, 0, 1]), atol=1e-13)
        np.testing.assert_allclose(T_s, 1 - (M[:, 0, 0] - M[:, 0, 1]), atol=1e-13)


def test_reflected_and_transmitted_flux_are_the_incident_one(reflection, transmission):
    """Into absorbers too, by Poynting's vector just inside: Re(n cosβ')/cosβ |t_s|² and Re(n cosβ'*)/cosβ |t_p|².

    With Re(n cosβ') for p, as pyElli 0.23.1 has it, 7 % are missing at 60° into 1.5 − 0.5i.
    """
    beta = np.radians(np.tile(np.linspace(0.0, 89.0, 30), len(METALS) + 1))
    n = np.repeat([*METALS.values(), 1.5 - 0.5j], 30)
    c, ct = np.cos(beta), np.sqrt(1.0 - (np.sin(beta) / n) ** 2)
    t_s, t_p = 2.0 * c / (c + n * ct), 2.0 * c / (n * c + ct)
    flux_s = (n * ct).real / c * abs(t_s) ** 2
    flux_p = (n * ct.conj()).real / c * abs(t_p) ** 2
    M = reflection(beta, n)
    T_p, T_s, _ = transmission(beta, n, "flux")
    np.testing.assert_allclose(M[:, 0, 0] + M[:, 0, 1] + flux_p, 1.0, atol=1e-12)
    np.testing.assert_allclose(M[:, 0, 0] - M[:, 0, 1] + flux_s, 1.0, atol=1e-12)
    np.testing.assert_allclose(T_p, flux_p, atol=1e-12)
    np.testing.assert_allclose(T_s, flux_s, atol=1e-12)
    at_60 = np.flatnonzero(n == 1.5 - 0.5j)[0]
    beta, n = np.radians([60.0]), n[at_60]
    ct = np.sqrt(1.0 - (np.sin(beta) / n) ** 2)
    wrong = (n * ct).real / 0.5 * abs(1.0 / (0.5 * n + ct)) ** 2
    R = reflection(np.repeat(beta, 2), n)[0]
    assert R[0, 0] + R[0, 1] + wrong[0] == pytest.approx(0.926, abs=1e-3)


@given(UNIT)
def test_amplitude_transmittance_is_t_squared(transmission, unit):
    """|t_x|² for light leaving the coating, real and complex n (LITERATURE 3e)."""
    beta = unit[0] * np.radians(89.99)
    for n in (1.05 + 2 * unit[1], 0.2 + 2.4 * unit[1] - 1j * (1e-3 + 4 * unit[2])):
        t_p, t_s = (abs(t) ** 2 for t in ref.fresnel_t_out(beta, n))
        T_p, T_s, _ = transmission(beta, n, "amplitude")
        np.testing.assert_allclose(T_s, t_s, rtol=1e-12)
        np.testing.assert_allclose(T_p, t_p, rtol=1e-11)


@pytest.mark.parametrize("kind", ["flux", "amplitude"])
@pytest.mark.parametrize("n", [1.6207, 2 - 1.5j, 0.3 - 2j])
def test_difference_over_sin2_has_no_singularity(transmission, kind, n):
    """(T_p − T_s)/(2 sin²β) tends to a finite limit at β = 0, equal to the one seen at small β."""
    _, _, half = transmission(np.array([0.0, 1e-8, 1e-4]), n, kind)
    T_p, T_s = ref.transmittance(np.array([0.02]), n, kind)
    assert np.isfinite(half).all()
    assert half[0] == pytest.approx(half[1], rel=1e-12)
    assert half[0] == pytest.approx(half[2], rel=1e-7)
    assert half[0] == pytest.approx((T_p - T_s)[0] / (2 * np.sin(0.02) ** 2), rel=1e-3)


@pytest.mark.parametrize(
    ("degrees", "literal", "flux", "dolp"),
    [
        (0, (1.529786, 0.0), (0.943904, 0.0), 0.0),
        (30, (1.677207, 0.037242), (0.942178, 0.020921), 0.022205),
        (60, (2.442736, 0.295877), (0.891564, 0.107991), 0.121125),
        (80, (4.416765, 1.311205), (0.595850, 0.176890), 0.296870),
    ],
)
def test_table_of_literature_3e(transmission, degrees, literal, flux, dolp):
    """n = 1.6207: m00 and m01 as tabulated after cross-checks with Mitsuba and SCATMECH; Q > 0."""
    beta = np.full(2, np.radians(degrees))
    for kind, (m00, m01) in (("amplitude", literal), ("flux", flux)):
        T_p, T_s, _ = transmission(beta, 1.6207, kind)
        assert 0.5 * (T_p + T_s)[0] == pytest.approx(m00, abs=1.5e-6)
        assert 0.5 * (T_p - T_s)[0] == pytest.approx(m01, abs=1.5e-6)
        assert ((T_p - T_s) / (T_p + T_s))[0] == pytest.approx(dolp, abs=1e-6)
        assert ref.diffuse_dolp(beta[0], 1.6207) == pytest.approx(dolp, abs=1e-6)


@pytest.mark.parametrize(("low", "high", "tolerance"), [(1.05, 3.0, 1e-12), (1.001, 100.0, 1e-8)])
def test_internal_diffuse_reflectance_in_closed_form(jit, low, high, tolerance):
    n = np.geomspace(low, high, 40)
    expected = 1.0 - (1.0 - ref.external_diffuse_reflectance(n)) / n**2
    # the closed form itself loses digits towards n = 1
    np.testing.assert_allclose(internal_diffuse_reflectance(jit(n)).numpy(), expected, atol=tolerance)


def test_internal_diffuse_reflectance_from_inside(jit):
    """∫R 2μ dμ over the directions inside, total reflection beyond the critical angle: no use of L/n² at all."""
    n = 1.6207
    node, weight = np.polynomial.legendre.leggauss(400)
    critical = np.sqrt(1 - 1 / n**2)
    # from critical to 1 in μ = cosβ', with a square root at the critical angle
    u = 0.5 * (node + 1)
    mu = critical + (1 - critical) * u * u
    outside = np.arcsin(np.clip(n * np.sqrt(1 - mu**2), 0, 1))
    r_p, r_s = (abs(r) ** 2 for r in ref.fresnel_r(outside, n))
    expected = critical**2 + (weight * (1 - critical) * u * mu * (r_p + r_s)).sum()
    found = internal_diffuse_reflectance(jit(n)).numpy()[0]
    assert found == pytest.approx(expected, abs=1e-9)
    assert found == pytest.approx(0.66085, abs=1e-5)  # SCATMECH, LITERATURE 2.7
    assert internal_diffuse_reflectance(jit(1.0)).numpy()[0] == pytest.approx(0.0, abs=1e-12)
