"""Mueller matrices of polarisers and retarders, against Jones matrices of fields e^{+iωt} and other programs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import independent as ref
from pbrdf.backend import get_backend
from pbrdf.errors import ModelError
from pbrdf.optics.elements import axis_rate, diattenuator, retardance_rate, retarder, rotate_frame
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.mueller import coherency_eigenvalues
from pbrdf.optics.stokes import aolp

ANGLE = st.floats(-np.pi, np.pi)
PHASE = st.floats(-2 * np.pi, 2 * np.pi)


def stokes_of(field):
    """Stokes vector of a field (E_x, E_y) e^{+iωt}: V = 2 Im(E_x E_y*), as the conventions say."""
    x, y = field
    return np.array(
        [
            abs(x) ** 2 + abs(y) ** 2,
            abs(x) ** 2 - abs(y) ** 2,
            2 * (x * np.conj(y)).real,
            2 * (x * np.conj(y)).imag,
        ]
    )


def jones(angle, along, across):
    """An element that multiplies the field along its axis and across it; axis turned from x towards y."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return turn.T @ np.diag([along, across]) @ turn


FIELDS = [(1, 0), (0, 1), (1, 1), (1, 1j), (1, -1j), (0.3 - 0.2j, 0.9 + 0.4j)]


def test_positive_v_is_left_circular():
    """V > 0 is left circular light: at a fixed point its field turns counterclockwise, from x towards y, for an
    observer who looks against the light (x to the right, y up). Clockwise, right circular light, has V < 0."""
    time = np.linspace(0, 2 * np.pi, 50)[:-1]
    for field, sense in (((1, -1j), +1), ((1, 1j), -1)):
        x, y = ((np.array(e) * np.exp(1j * time)).real for e in field)
        turned = np.unwrap(np.arctan2(y, x))
        assert np.sign(turned[-1] - turned[0]) == sense
        assert np.sign(stokes_of(field)[3]) == sense


def test_the_fast_component_leads():
    """A quarter-wave retarder with its fast axis along x makes left circular light (V > 0) of light at 45°: the
    component along the fast axis reaches its maximum a quarter of a period earlier."""
    out = retarder(0.0, np.pi / 2) @ [1, 0, 1, 0]
    np.testing.assert_allclose(out, [1, 0, 0, 1], atol=1e-15)
    time = np.linspace(0, 2 * np.pi, 401)[:-1]
    x, y = ((e * np.exp(1j * time)).real for e in (np.exp(0.5j * np.pi), 1.0))
    np.testing.assert_allclose(stokes_of((np.exp(0.5j * np.pi), 1.0)), 2 * out, atol=1e-12)
    lead = (time[np.argmax(y)] - time[np.argmax(x)]) % (2 * np.pi)
    assert lead == pytest.approx(np.pi / 2, abs=0.02)


@given(ANGLE, PHASE)
def test_retarder_is_the_jones_matrix(angle, delta):
    J = jones(angle, np.exp(1j * delta), 1.0)
    M = retarder(angle, delta)
    for field in FIELDS:
        np.testing.assert_allclose(M @ stokes_of(field), stokes_of(J @ field), atol=1e-13)
    np.testing.assert_allclose(M @ M.T, np.eye(4), atol=1e-13)


@given(ANGLE, st.floats(-1, 1))
def test_diattenuator_is_the_jones_matrix(angle, d):
    """T_max + T_min = 1 and (T_max − T_min) = d."""
    J = jones(angle, np.sqrt((1 + d) / 2), np.sqrt((1 - d) / 2))
    for field in FIELDS:
        np.testing.assert_allclose(
            diattenuator(angle, d) @ stokes_of(field), stokes_of(J @ field), atol=1e-13
        )


@given(ANGLE, st.floats(-1, 1), PHASE)
def test_elements_are_realisable(angle, d, delta):
    for M in (diattenuator(angle, d), retarder(angle, delta)):
        assert coherency_eigenvalues(M).min() > -1e-13


def test_cloude_of_exact_retarders_depolarisers_and_free_space():
    """Finite where Lu-Chipman's factors are not (katsu): one component or four; transmittance is but a factor."""
    plate = retarder(0.3, np.pi / 2)
    for M, expected in (
        (np.eye(4), [0, 0, 0, 1]),
        (plate, [0, 0, 0, 1]),
        (0.5 * plate, [0, 0, 0, 0.5]),
        (np.diag([1.0, 0, 0, 0]), [0.25, 0.25, 0.25, 0.25]),
        (0.2 * np.diag([1.0, -1, -1, 1]), [0, 0, 0, 0.2]),
    ):
        np.testing.assert_allclose(coherency_eigenvalues(M), expected, atol=1e-15)


def test_polariser_passes_what_is_along_its_axis():
    """Light polarised along the transmission axis passes whole, light across it not at all."""
    psi = np.deg2rad([0.0, 30.0, 45.0, 90.0, 135.0])
    light = np.stack([np.ones(5), np.cos(2 * psi), np.sin(2 * psi), np.zeros(5)], axis=-1)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", diattenuator(psi), light), light, atol=1e-15)
    crossed = diattenuator(psi + np.pi / 2)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", crossed, light), 0, atol=1e-15)


def test_whole_waves_and_whole_turns_do_nothing():
    """A retarder of a million waves and a quarter is a quarter-wave one; ten turns leave an analyser where it was."""
    quarter = retarder(0.3, np.pi / 2)
    for waves, atol in ((1e3, 1e-12), (1e6, 2e-9)):  # what the last digit of the radians leaves
        np.testing.assert_allclose(retarder(0.3, 2.0 * np.pi * (waves + 0.25)), quarter, atol=atol)
    np.testing.assert_allclose(diattenuator(np.deg2rad(3630.0)), diattenuator(np.pi / 6), atol=1e-12)
    np.testing.assert_allclose(retarder(np.deg2rad(-3570.0), 0.7), retarder(np.pi / 6, 0.7), atol=1e-12)


def test_a_diattenuation_beyond_one_is_refused():
    for bad in (1.01, -2.0, np.nan):
        with pytest.raises(ModelError, match="diattenuation"):
            diattenuator([0.0, 0.1], [0.5, bad])


@given(ANGLE, ANGLE)
def test_rotate_frame_takes_the_angle_off(frame, psi):
    """Axes turned by χ towards the light's angle read that angle less χ; I and V do not change."""
    light = np.array([1.0, 0.8 * np.cos(2 * psi), 0.8 * np.sin(2 * psi), 0.6])
    seen = rotate_frame(frame) @ light
    assert np.cos(2 * (aolp(seen) - (psi - frame))) == pytest.approx(1.0)
    np.testing.assert_allclose(seen[[0, 3]], light[[0, 3]])
    np.testing.assert_allclose(rotate_frame(-frame) @ seen, light, atol=1e-15)


@given(ANGLE, ANGLE, PHASE)
def test_turned_element(angle, turn, delta):
    """An element turned by χ is T(−χ) M T(χ): read in its own axes, act, read back."""
    for make in (lambda a: retarder(a, delta), lambda a: diattenuator(a, 0.7)):
        expected = rotate_frame(-turn) @ make(angle) @ rotate_frame(turn)
        np.testing.assert_allclose(make(angle + turn), expected, atol=1e-13)


@given(ANGLE, PHASE)
def test_rates_are_derivatives(angle, delta):
    h = 1e-6
    by_axis = (retarder(angle + h, delta) - retarder(angle - h, delta)) / (2 * h)
    np.testing.assert_allclose(axis_rate(retarder(angle, delta)), by_axis, atol=1e-8)
    by_phase = (retarder(angle, delta + h) - retarder(angle, delta - h)) / (2 * h)
    np.testing.assert_allclose(retardance_rate(angle, delta), by_phase, atol=1e-8)


def test_shapes_are_broadcast():
    assert retarder(np.zeros((3, 1)), np.zeros(5)).shape == (3, 5, 4, 4)
    assert diattenuator(0.0).shape == (4, 4)
    assert rotate_frame(np.zeros((2, 3))).shape == (2, 3, 4, 4)


@pytest.mark.parametrize("n", [0.18 - 3.4j, 1.0 - 6.5j, 2 - 1.5j], ids=["gold", "aluminium", "absorber"])
def test_a_mirror_is_a_retarder_in_the_same_convention(n):
    """The lower block of the reflection matrix, M33 = M44 = Re(r_p r_s*), M43 = +Im(r_p r_s*) = −M34, is √(R_p R_s)
    times that of a retarder whose fast axis is p and whose retardance is the phase by which r_p leads r_s."""
    beta = np.radians(np.linspace(0.5, 89, 30))
    r_p, r_s = ref.fresnel_r(beta, n)
    Float = get_backend().Float
    found = mueller_reflection(Float(np.cos(beta)), Float(n.real), Float(-n.imag))
    real, imaginary = found.real.numpy(), found.imaginary.numpy()
    lower = np.array([[real, -imaginary], [imaginary, real]]).transpose(2, 0, 1)
    phase = np.angle(r_p * np.conj(r_s))
    expected = abs(r_p * r_s)[:, None, None] * retarder(0.0, phase)[:, 2:, 2:]
    np.testing.assert_allclose(lower, expected, atol=1e-12)


def test_total_internal_reflection_is_a_retarder():
    """In glass of index 1.51 at 54.62° (Fresnel's rhomb) nothing is lost and p leads s by 45°, the δ of
    tan(δ/2) = cosβ √(sin²β − 1/n²)/sin²β: the mirror is a retarder with fast axis p. It makes light at +45° half left
    circular, V > 0."""
    n, beta = 1.0 / 1.51, np.radians(54.62)
    delta = 2 * np.arctan(np.cos(beta) * np.sqrt(np.sin(beta) ** 2 - n**2) / np.sin(beta) ** 2)
    assert delta == pytest.approx(np.pi / 4, abs=0.01)
    Float = get_backend().Float
    r = mueller_reflection(Float([np.cos(beta)]), Float([n]), Float([1e-12]))
    mean, difference, real, imaginary = (float(x.numpy()[0]) for x in r)
    found = np.array(
        [
            [mean, difference, 0, 0],
            [difference, mean, 0, 0],
            [0, 0, real, -imaginary],
            [0, 0, imaginary, real],
        ]
    )
    np.testing.assert_allclose(found, retarder(0.0, delta), atol=1e-9)
    assert (found @ [1, 0, 1, 0])[3] == pytest.approx(np.sqrt(0.5), abs=0.01)


@pytest.fixture
def mueller():
    """Mitsuba's Mueller matrices; the variant that was set before is set again."""
    mi = pytest.importorskip("mitsuba", reason="Mitsuba is not installed")
    before = mi.variant()
    mi.set_variant("scalar_spectral_polarized")
    yield lambda name, *a: np.array(getattr(mi.mueller, name)(*a), dtype=float).reshape(4, 4)
    if before is not None:
        mi.set_variant(before)


def test_relation_to_mitsuba(mueller):
    """M' = D M D with D = diag(1, 1, 1, −1): Mitsuba counts right circular light positive, and nothing else differs.
    Its ``rotator`` is the change of frame."""
    import mitsuba as mi

    D = np.diag([1.0, 1.0, 1.0, -1.0])
    for angle, delta in ((0.3, 0.5), (-1.1, 2.5), (0.0, np.pi / 2)):
        made = mi.mueller.rotated_element(angle, mi.mueller.linear_retarder(delta))
        np.testing.assert_allclose(D @ np.array(made) @ D, retarder(angle, delta), atol=2e-7)
        made = mi.mueller.rotated_element(angle, mi.mueller.linear_polarizer(1.0))
        np.testing.assert_allclose(D @ np.array(made) @ D, diattenuator(angle), atol=2e-7)
        np.testing.assert_allclose(mueller("rotator", angle), rotate_frame(angle), atol=2e-7)
    left = D @ mueller("left_circular_polarizer") @ D
    np.testing.assert_allclose(left @ [1, 0, 0, 1], [1, 0, 0, 1], atol=1e-7)
    np.testing.assert_allclose(left @ [1, 0, 0, -1], 0, atol=1e-7)
