"""Matrices of other programs beside ours: agreement, the convention that fits better, scales, what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest

import independent as ref
from pbrdf.data import convert
from pbrdf.data.convention_comparison import compare_conventions, flat_reflection, named_signs
from pbrdf.errors import DataError

OURS = np.random.default_rng(0).uniform(-0.3, 0.3, (6, 4, 4))
OURS[:, 0, 0] = np.linspace(0.5, 3.0, 6)


@pytest.mark.parametrize("program", convert.PROGRAMS)
def test_the_right_convention_agrees_and_every_other_is_told(program):
    """Of matrices without symmetry only programs that count alike are not told apart."""
    normalised = OURS / OURS[:, :1, :1]
    theirs = convert.PROGRAMS[program](normalised) * (1.0 if program == "pyelli" else OURS[:, :1, :1])
    right = compare_conventions(theirs, OURS, program)
    assert right.difference < 1e-15 and right.better is None and right.alike == ()
    assert right.compared == 6 and right.left_out == 0
    for other in convert.PROGRAMS:
        found = compare_conventions(theirs, OURS, other)
        same = np.array_equal(convert.PROGRAMS[other](normalised), convert.PROGRAMS[program](normalised))
        assert (found.better is None) == same
        if not same:
            assert program in named_signs(found.better)
            assert found.difference == found.by_signs[named(other)] > 1e-2


def named(program):
    return tuple(convert.PROGRAMS[program](np.ones((4, 4)))[0, 1:].astype(int))


def test_place_and_scale_are_told_apart():
    """A wrong element is found where it is; a factor of M00 is a scale and no difference."""
    theirs = 2.5 * convert.from_katsu_mueller(OURS)
    theirs[4, 2, 1] += 0.5 * theirs[4, 0, 0]
    found = compare_conventions(theirs.reshape(2, 3, 4, 4), OURS, "katsu")
    assert found.place == (4, 2, 1) and found.difference == pytest.approx(0.5)
    assert found.ratio == pytest.approx(2.5) and not found.divided
    assert found.better is None


def test_what_is_not_a_number_or_without_light_is_left_out_and_counted():
    theirs = convert.from_katsu_mueller(OURS)
    theirs[0, 1, 1], theirs[1, 0, 0] = np.nan, 0.0
    found = compare_conventions(theirs, OURS, "katsu")
    assert (found.compared, found.left_out, found.better) == (4, 2, None)
    assert np.isnan(found.ratio[:2]).all() and found.ratio[2:] == pytest.approx(1.0)
    assert found.difference < 1e-15
    theirs[5, 3, 3] = 9.0
    assert compare_conventions(theirs, OURS, "katsu").place == (5, 3, 3)


def test_a_diagonal_matrix_tells_no_convention():
    found = compare_conventions(np.eye(4), np.eye(4), "katsu")
    assert found.better is None
    assert {named_signs(signs).split(" (")[0] for signs in found.alike} == {"mitsuba", "pyelli", "scatmech"}


@pytest.mark.parametrize("right", convert.PROGRAMS)
@pytest.mark.parametrize("stated", convert.PROGRAMS)
def test_noise_and_one_dark_matrix_decide_nothing(right, stated):
    """Noise of the size of the elements, and one matrix that is wrong altogether, hide no convention."""
    rng = np.random.default_rng(5)
    ours = np.concatenate([OURS] * 10)
    ours[:, 0, 0] = 1.0
    theirs = convert.PROGRAMS[right](ours) + rng.normal(0.0, 0.1, ours.shape)
    theirs[:, 0, 0] = 1.0
    theirs[7, 1:] = rng.uniform(-0.9, 0.9, (3, 4))
    found = compare_conventions(theirs, ours, stated)
    assert found.signs == named(right) and found.alike == () and found.exchanged is None
    assert (found.better is None) == (named(right) == named(stated))
    assert 0.1 < found.residual < 0.2 < found.by_signs[found.signs]


def test_elements_that_are_noise_tell_no_convention():
    """A paint without V: whether V is reversed is not said, however the noise falls."""
    paint = np.zeros((50, 4, 4))
    paint[:, range(4), range(4)] = [1.0, 0.5, 0.4, 0.3]
    paint[:, 0, 1] = paint[:, 1, 0] = -0.2
    for seed in range(5):
        noise = np.random.default_rng(seed).normal(0.0, 0.01, paint.shape)
        noise[:, 0, 0] = 0.0
        found = compare_conventions(paint + noise, paint, "katsu")
        assert found.better is None and found.alike == (named("pyelli"),)
        found = compare_conventions(paint + noise, paint, "mitsuba")
        assert {found.better, *found.alike} == {named("pyelli"), named("katsu")}


@pytest.mark.parametrize("program", convert.PROGRAMS)
def test_rows_and_columns_exchanged_are_told(program):
    """``numpy.array(matrix).T`` of a Dr.Jit matrix puts the lanes first and exchanges rows and columns as well."""
    normalised = OURS / OURS[:, :1, :1]
    found = compare_conventions(convert.PROGRAMS[program](normalised).swapaxes(1, 2), OURS, program)
    assert found.better is None and found.exchanged[0] == named(program)
    assert found.difference > 0.1 and found.exchanged[1] < 1e-15 and found.divided


def test_of_a_flat_surface_an_exchange_is_another_convention():
    ours = flat_reflection(np.radians([30.0, 70.0]), 0.47, 2.83)
    found = compare_conventions(convert.from_mitsuba_mueller(ours).swapaxes(1, 2), ours, "mitsuba")
    assert found.better == named("scatmech") and found.exchanged == (
        named("mitsuba"),
        pytest.approx(0.0, abs=1e-15),
    )
    assert compare_conventions(convert.from_mitsuba_mueller(ours), ours, "pypolar").exchanged is None


def test_azimuths_counted_the_other_way_are_u_and_v_reversed():
    other_way = OURS * np.outer((1, 1, -1, -1), (1, 1, -1, -1))
    found = compare_conventions(convert.from_katsu_mueller(other_way), OURS, "katsu")
    assert named_signs(found.better) == (
        "eradiate, katsu, polanalyser and pypolar (φ counted the other way; U reversed)"
    )


def test_of_a_flat_surface_a_program_is_named_and_not_signs_alone():
    """U reversed by itself cannot be seen there: the better convention is still a program's."""
    ours = flat_reflection(np.radians([30.0, 70.0]), 0.47, 2.83)
    found = compare_conventions(convert.from_mitsuba_mueller(ours), ours, "scatmech")
    assert named_signs(found.better) == "mitsuba (Q, U and V reversed)"


@pytest.mark.parametrize("kappa", [0.0, 2.83])
def test_flat_surfaces_are_those_of_the_amplitudes(kappa):
    angles = np.radians([0.0, 30.0, 57.0, 80.0])
    r_p, r_s = ref.fresnel_r(angles, 1.5 - 1j * kappa)
    found = flat_reflection(angles, 1.5, kappa)
    np.testing.assert_allclose(found[:, 0, 0] + found[:, 0, 1], abs(r_p) ** 2, atol=1e-14)
    np.testing.assert_allclose(found[:, 0, 0] - found[:, 0, 1], abs(r_s) ** 2, atol=1e-14)
    np.testing.assert_allclose(found[:, 2, 2] + 1j * found[:, 3, 2], r_p * r_s.conj(), atol=1e-14)
    np.testing.assert_allclose(found[:, 2, 3], -found[:, 3, 2], atol=0.0)


@pytest.mark.parametrize(
    ("theirs", "convention", "message"),
    [
        (OURS, "elli", "no program is called 'elli'; there are eradiate, katsu"),
        (OURS[:5], "katsu", "5 matrices to compare with 6"),
        (OURS[:, :3], "katsu", "shape"),
        (OURS + 0.1j, "katsu", "complex128"),
        (OURS.T, "katsu", r"of \(4, 4, 6\): numpy.moveaxis\(x, \(0, 1\), \(-2, -1\)\)"),
        (OURS * np.nan, "katsu", "no matrix is left"),
    ],
)
def test_what_cannot_be_compared_is_said(theirs, convention, message):
    with pytest.raises(DataError, match=message):
        compare_conventions(theirs, OURS, convention)


def test_an_index_is_refused_that_is_none():
    with pytest.raises(DataError, match="n > 0"):
        flat_reflection([0.1], 1.5, -1.0)
