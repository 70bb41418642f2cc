"""Each test states the convention it holds to in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import conventions as c

RNG = np.random.default_rng(1)
MUELLER = RNG.normal(size=(5, 4, 4))
STOKES = RNG.normal(size=(5, 4))
AZIMUTHS = np.deg2rad([-170.0, -30.0, 0.0, 45.0, 180.0])


def stokes_of(field: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Stokes vector of a field in the right-handed frame (first, second, k): V as −2 Im(E₁E₂*)."""
    e1, e2 = field @ first, field @ second
    cross = e1 * np.conj(e2)
    return np.array(
        [abs(e1) ** 2 + abs(e2) ** 2, abs(e1) ** 2 - abs(e2) ** 2, 2 * cross.real, -2 * cross.imag]
    )


def frame(theta: float, phi: float) -> tuple[np.ndarray, np.ndarray]:
    """p and s of the ray that leaves in the direction (θ, φ): s = k×ẑ/|k×ẑ|, p = s×k."""
    k = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    s = np.cross(k, [0.0, 0.0, 1.0])
    s /= np.linalg.norm(s)
    return np.cross(s, k), s


def test_forward_at_pi_becomes_forward_at_zero():
    """Elsewhere a viewer opposite the source is at φ = π, here at φ = 0."""
    assert_array_equal(c.azimuth_forward_pi_to_zero([np.pi, 0.0]), [0.0, np.pi])


def test_azimuth_keeps_its_sense_of_rotation():
    """Moving forward to 0 turns the origin, it does not mirror: 30° past backward stays 30° past backward."""
    assert_allclose(c.azimuth_forward_pi_to_zero(np.deg2rad([30, -90])), np.deg2rad([-150, 90]))


def test_azimuth_in_degrees_is_exact():
    """180° in a file becomes 0°, not a rounding error."""
    assert_array_equal(c.azimuth_forward_pi_to_zero([180.0, 170.1], 180.0), [0.0, 170.1 - 180.0])


@given(st.floats(-20, 20))
def test_azimuth_forms_are_inverse(phi):
    turned = c.azimuth_forward_zero_to_pi(c.azimuth_forward_pi_to_zero(phi))
    assert -np.pi <= turned <= np.pi
    assert np.cos(turned - phi) == pytest.approx(1)


def test_light_along_s_has_positive_q_with_them_and_negative_q_here():
    """Q = I_s − I_p elsewhere, Q = I_p − I_s here."""
    assert_array_equal(c.stokes_swap_sp([1.0, 1.0, 0.0, 0.0]), [1.0, -1.0, 0.0, 0.0])


def test_swapping_s_and_p_turns_a_right_handed_frame():
    """(s, p', k) and (p, s, k) are both right-handed, so p' = −p: U changes sign with Q, V does not."""
    p, s = frame(0.7, 0.4)
    field = (0.8 + 0.1j) * p + (0.3 - 0.6j) * s
    assert_allclose(c.stokes_swap_sp(stokes_of(field, s, -p)), stokes_of(field, p, s))


def test_aolp_swaps_as_stokes_do():
    """An AoLP counted from s is 90° off the one counted from p."""
    _, aolp = c.dolp_aolp_from_stokes(STOKES)
    _, swapped = c.dolp_aolp_from_stokes(c.stokes_swap_sp(STOKES))
    assert_allclose(c.aolp_swap_sp(aolp), swapped)
    assert c.aolp_swap_sp(0.0) == np.pi / 2


def test_left_circular_becomes_right_circular():
    """The other handedness counted as V > 0: V changes sign and nothing else."""
    assert_array_equal(c.stokes_flip_v([2.0, 0.5, 0.3, 1.0]), [2.0, 0.5, 0.3, -1.0])


@pytest.mark.parametrize(
    ("matrix_conversion", "vector_conversion"),
    [(c.mueller_swap_sp, c.stokes_swap_sp), (c.mueller_flip_v, c.stokes_flip_v)],
)
def test_mueller_matrices_convert_with_the_vectors_they_act_on(matrix_conversion, vector_conversion):
    """Converting M and the incident vector converts the outgoing vector: both sides of M are converted."""
    outgoing = np.einsum("nij,nj->ni", matrix_conversion(MUELLER), vector_conversion(STOKES))
    assert_allclose(outgoing, vector_conversion(np.einsum("nij,nj->ni", MUELLER, STOKES)))


def test_covariances_turn_with_the_frame():
    """Noisy light measured in the frame turned by 90°, where Q = I_s − I_p: both measurements scatter alike."""
    p, s = frame(0.7, 0.4)
    noisy = (
        (0.8 + 0.1j + 0.1 * RNG.normal(size=(200, 1))) * p
        + (0.3 - 0.6j) * s
        + 0.05 * RNG.normal(size=(200, 3))
    )
    theirs, ours = (
        np.cov([stokes_of(field, *axes) for field in noisy], rowvar=False) for axes in ((s, -p), (p, s))
    )
    assert abs(ours[0, 1]) > 0.1 * np.sqrt(ours[0, 0] * ours[1, 1])
    assert_allclose(c.covariance_swap_sp(theirs), ours, atol=1e-12)


def test_covariances_with_v_change_sign_with_the_handedness():
    """The other handedness counted as V > 0: of the covariances those with V change sign, its variance does not."""
    samples = RNG.normal(size=(50, 4)) @ RNG.normal(size=(4, 4))
    flipped = np.cov(c.stokes_flip_v(samples), rowvar=False)
    assert_allclose(c.covariance_flip_v(np.cov(samples, rowvar=False)), flipped)


@pytest.mark.parametrize("phi", AZIMUTHS)
def test_xyxy_is_the_fixed_frame_of_the_sample(phi):
    """Light that leaves along the normal has the same xyxy vector at every φ, but its s and p turn with φ."""
    field = np.array([0.9 + 0.2j, -0.4 + 0.5j, 0.0])
    k_up = 1e-9
    in_sample = stokes_of(field, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    matrix = np.zeros((4, 4))
    matrix[:, 0] = in_sample
    converted = c.mueller_xyxy_to_sp(matrix, phi)[:, 0]
    assert_allclose(converted, stokes_of(field, *frame(k_up, phi)), atol=1e-8)


def test_xyxy_in_the_forward_direction_is_s_and_p():
    """At φ = 0 the axes agree up to sign, which no Stokes vector sees; the incident frame agrees always."""
    assert_array_equal(c.mueller_xyxy_to_sp(MUELLER, np.zeros(5)), MUELLER)
    turned = c.mueller_xyxy_to_sp(MUELLER, AZIMUTHS)
    assert_array_equal(turned[:, [0, 3]], MUELLER[:, [0, 3]])
    assert_allclose(turned[4], MUELLER[4])  # φ = π
    assert not np.allclose(turned[3], MUELLER[3])


def test_xyxy_forms_are_inverse_and_broadcast():
    assert_allclose(c.mueller_sp_to_xyxy(c.mueller_xyxy_to_sp(MUELLER, AZIMUTHS), AZIMUTHS), MUELLER)
    one_matrix = c.mueller_xyxy_to_sp(MUELLER[0], AZIMUTHS)
    assert one_matrix.shape == (5, 4, 4)
    assert_allclose(one_matrix[1], c.mueller_xyxy_to_sp(MUELLER[0], AZIMUTHS[1]))


@pytest.mark.parametrize("values", [np.ones(5), STOKES, MUELLER])
def test_cosine_weight_is_divided_out_row_by_row(values):
    """f cos θ to f, for scalars, Stokes vectors and matrices; 60° doubles."""
    theta = np.deg2rad([0.0, 60.0, 10.0, 20.0, 30.0])
    assert_allclose(c.remove_cosine_weight(values, theta)[1], 2 * values[1])
    assert_allclose(c.apply_cosine_weight(c.remove_cosine_weight(values, theta), theta), values)


def test_a_perfect_diffuser_has_reflectance_factor_one_and_brdf_one_over_pi():
    assert c.reflectance_factor_to_brdf(1.0) == 1 / np.pi
    assert c.brdf_to_reflectance_factor(1 / np.pi) == 1.0


@pytest.mark.parametrize(
    ("stokes", "dolp", "aolp"),
    [
        ([2, 1, 0, 0], 0.5, 0.0),
        ([2, -1, 0, 0], 0.5, np.pi / 2),
        ([2, -1, -0.0, 0], 0.5, np.pi / 2),
        ([2, -1, -1e-17, 0], 0.5, np.pi / 2),
        ([2, 0, 2, 0], 1.0, np.pi / 4),
        ([2, 0, -2, 0], 1.0, -np.pi / 4),
        ([2, 0, 0, 2], 0.0, 0.0),
    ],
)
def test_aolp_is_counted_from_p_towards_s(stokes, dolp, aolp):
    """AoLP = ½ atan2(U, Q): 0 along p, ±90° along s, +45° for U > 0. V is not linear polarisation."""
    assert c.dolp_aolp_from_stokes(stokes) == (dolp, aolp)


def test_dolp_without_light_is_nan():
    assert np.isnan(c.dolp_aolp_from_stokes([0.0, 0.0, 0.0])[0])


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1), st.floats(-1.57, 1.57))
def test_q_and_u_from_dolp_and_aolp_and_back(intensity, dolp, aolp):
    q, u = c.qu_from_dolp_aolp(intensity, dolp, aolp)
    assert c.dolp_aolp_from_stokes([intensity, q, u]) == (pytest.approx(dolp), pytest.approx(aolp, abs=1e-12))
