"""What other programs gave (``scripts/make_convention_numbers.py``), converted, is what our formulas say.

Each test states the signs in words. The numbers are those of katsu 0.1.0, polanalyser 3.0.0, pypolar 1.2.0,
pyElli 0.23.1, pySCATMECH 0.1.10, Mitsuba 3.9.1 (single precision), Eradiate 1.2.0 and its kernel 0.5.0.
"""

from __future__ import annotations

import csv
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import independent as ref
import pbrdf
from pbrdf.data import convert
from pbrdf.data.convention_comparison import compare_conventions
from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.errors import DataError
from pbrdf.models import DoubleGauss
from pbrdf.optics.elements import diattenuator, retarder

TABLE = Path(__file__).parents[1] / "data_oracle" / "conventions.csv"
NAMES = {"pySCATMECH": "scatmech", "pyElli": "pyelli", "eradiate-mitsuba": "eradiate"}
#: Programs with polarisers and retarders, and what to add to their angles, degrees: 90 where their x is s of ours.
TURN = {
    "katsu": 0.0,
    "polanalyser": 0.0,
    "pypolar": 0.0,
    "pySCATMECH": 90.0,
    "mitsuba": 90.0,
    "eradiate-mitsuba": 0.0,
}
FLAT = ("pypolar", "pyElli", "mitsuba")
CONVERSIONS = sorted(set(convert.PROGRAMS) - {"pyelli"})


def rows(program, what):
    """Known numbers and matrices of a program."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        found = [r for r in csv.DictReader(file) if (r["program"], r["what"]) == (program, what)]
    assert found
    known = {
        key: np.array([float(r[key] or "nan") for r in found])
        for key in ("angle", "retardance", "n", "kappa", "R", "theta_r", "azimuth")
    }
    matrices = np.array(
        [[[float(r[f"m{i}{j}"] or "nan") for j in range(4)] for i in range(4)] for r in found]
    )
    return known, matrices


def tolerance(program):
    return 2e-6 if program == "mitsuba" else 1e-12


def reflection(known):
    """Mueller matrices of flat surfaces in our convention, from the amplitudes for n − iκ."""
    r_p, r_s = ref.fresnel_r(np.deg2rad(known["angle"]), known["n"] - 1j * known["kappa"])
    matrix = np.zeros((len(r_p), 4, 4))
    matrix[:, 0, 0] = matrix[:, 1, 1] = (abs(r_p) ** 2 + abs(r_s) ** 2) / 2
    matrix[:, 0, 1] = matrix[:, 1, 0] = (abs(r_p) ** 2 - abs(r_s) ** 2) / 2
    matrix[:, 2, 2] = matrix[:, 3, 3] = (r_p * r_s.conj()).real
    matrix[:, 3, 2] = (r_p * r_s.conj()).imag
    matrix[:, 2, 3] = -matrix[:, 3, 2]
    return matrix


@pytest.mark.parametrize("program", TURN)
def test_polarisers_stand_at_the_same_axis(program):
    """Angles turn from x towards y everywhere, counterclockwise against the light; x is p of ours, or s."""
    known, theirs = rows(program, "polariser")
    ours = diattenuator(np.deg2rad(known["angle"] + TURN[program]))
    assert_allclose(convert.PROGRAMS[NAMES.get(program, program)](theirs), ours, atol=tolerance(program))


@pytest.mark.parametrize("program", TURN)
def test_retarders_turn_light_to_the_same_hand(program):
    """Fast axis at the same angle, phase lead positive: V of SCATMECH has our sign, that of the others the opposite."""
    known, theirs = rows(program, "retarder")
    ours = retarder(np.deg2rad(known["angle"] + TURN[program]), np.deg2rad(known["retardance"]))
    assert_allclose(convert.PROGRAMS[NAMES.get(program, program)](theirs), ours, atol=tolerance(program))


@pytest.mark.parametrize("program", FLAT)
def test_flat_surfaces_reflect_alike(program):
    """Glass on both sides of Brewster's angle and metals on both sides of their principal angle.

    pypolar: Q = I_p − I_s as ours, V reversed. Mitsuba: Q, U and V reversed. pyElli: nothing reversed, but M00 = 1.
    """
    known, theirs = rows(program, "reflection")
    if program == "pyElli":
        converted = convert.from_pyelli_mueller(theirs, known["R"])
    else:
        converted = convert.PROGRAMS[program](theirs)
    assert_allclose(converted, reflection(known), atol=tolerance(program))


@pytest.mark.parametrize("program", convert.PROGRAMS)
def test_what_is_no_matrix_is_refused_and_nothing_is_broadcast(program):
    """A vector would become a matrix by broadcasting; imaginary parts would be dropped."""
    mueller = convert.PROGRAMS[program]
    for wrong in (
        1.0,
        np.ones(4),
        np.ones((4, 4, 3)),
        np.ones((2, 3, 3)),
        np.eye(4) * (1 + 1j),
        [["a"] * 4] * 4,
    ):
        with pytest.raises(DataError, match=r"Mueller matrices are real numbers of the shape \(..., 4, 4\)"):
            mueller(wrong)
    jones = np.full((2, 4, 4), 1 + 1e-17j)
    jones[1, 2, 2] = np.nan
    assert_array_equal(mueller(jones), mueller(jones.real))
    jones[1, 2, 2] = complex(1.0, np.nan)
    assert np.argwhere(np.isnan(mueller(jones))).tolist() == [[1, 2, 2]]
    with pytest.raises(DataError, match="complex128"):
        mueller(jones + np.where(np.isnan(jones), 0, 1e-3j))
    with pytest.raises(DataError, match=r"numpy.moveaxis\(x, \(0, 1\), \(-2, -1\)\)"):
        mueller(np.ones((4, 4, 3)))
    if program != "pyelli":
        for wrong in (1.0, np.ones(3), np.ones((4, 1))):
            with pytest.raises(DataError, match=r"Stokes vectors are real numbers of the shape \(..., 4\)"):
                getattr(convert, f"from_{program}_stokes")(wrong)


#: Signs of Q, U and V by which theirs become ours.
SIGNS = {
    "katsu": (1, 1, -1),
    "polanalyser": (1, 1, -1),
    "pypolar": (1, 1, -1),
    "pySCATMECH": (-1, -1, 1),
    "mitsuba": (-1, -1, -1),
    "pyElli": (1, 1, 1),
    "eradiate-mitsuba": (1, 1, -1),
}


@pytest.mark.parametrize("program", SIGNS)
def test_no_other_signs_fit(program):
    """With other signs some matrix of the program differs by more than a tenth.

    Of a flat surface alone, all that pyElli gives, U and V turned round together are not seen.
    """
    pairs = []
    if program in TURN:
        known, theirs = rows(program, "polariser")
        pairs.append((theirs, diattenuator(np.deg2rad(known["angle"] + TURN[program]))))
        known, theirs = rows(program, "retarder")
        angle = np.deg2rad(known["angle"] + TURN[program])
        pairs.append((theirs, retarder(angle, np.deg2rad(known["retardance"]))))
    if program in FLAT:
        known, theirs = rows(program, "reflection")
        pairs.append((theirs / theirs[:, :1, :1], reflection(known) / reflection(known)[:, :1, :1]))
    fitting = set()
    for signs in product((1, -1), repeat=3):
        D = np.diag([1, *signs])
        if all(abs(D @ theirs @ D - ours).max() < 0.1 for theirs, ours in pairs):
            fitting.add(signs)
    assert fitting == ({SIGNS[program]} if program in TURN else {(1, 1, 1), (1, -1, -1)})


@pytest.mark.parametrize("program", CONVERSIONS)
def test_vectors_convert_with_the_matrices(program):
    """Converting M and the incident vector converts the outgoing one; twice is nothing."""
    rng = np.random.default_rng(3)
    M, S = rng.normal(size=(5, 4, 4)), rng.normal(size=(5, 4))
    mueller, stokes = convert.PROGRAMS[program], getattr(convert, f"from_{program}_stokes")
    assert_allclose(np.einsum("nij,nj->ni", mueller(M), stokes(S)), stokes(np.einsum("nij,nj->ni", M, S)))
    assert_array_equal(mueller(mueller(M)), M)


def facets(known):
    """M/M00 of facets in our convention; Eradiate's azimuths count from the source, ours from the forward direction."""
    phi = azimuth_forward_pi_to_zero(np.deg2rad(known["azimuth"]))
    model = DoubleGauss(0.3, known["n"][0] - 1j * known["kappa"][0], 1.0, 1.0, 0.0, 0.0)
    matrix = model.mueller(np.deg2rad(known["angle"]), np.deg2rad(known["theta_r"]), phi, part="specular")
    return matrix / matrix[:, :1, :1]


def test_facets_of_eradiates_kernel_show_every_sign():
    """Rough metal off the plane, frames with x in the meridian plane: Q and U as ours, V reversed."""
    known, theirs = rows("eradiate-mitsuba", "facets")
    found = compare_conventions(theirs, facets(known), "eradiate")
    assert found.difference < 1e-12
    assert [signs for signs, off in found.by_signs.items() if off < 0.1] == [(1, 1, -1)]
    assert compare_conventions(theirs, facets(known), "mitsuba").better == (1, 1, -1)


def test_absorbing_sea_of_eradiate_has_the_other_v():
    """Its own surfaces take n + iκ for n − iκ: V comes out as ours, against all other plugins of the same kernel."""
    known, theirs = rows("eradiate-mitsuba", "sea")
    found = compare_conventions(theirs, facets(known), "eradiate")
    assert found.difference > 0.1
    assert found.better == (1, 1, 1)
    assert found.by_signs[1, 1, 1] < 1e-9


@pytest.mark.parametrize(("what", "light"), [("sea natural", 0.0), ("sea circular", -1.0)])
def test_stokes_vectors_that_eradiate_renders(what, light):
    """Water without absorption: U off the plane as ours; right circular light, V < 0 here, has V > 0 there."""
    known, theirs = rows("eradiate", what)
    ours = facets(known) @ [1.0, 0.0, 0.0, light]
    stokes = convert.from_eradiate_stokes(theirs[:, :, 0])
    assert_allclose(stokes / stokes[:, :1], ours / ours[:, :1], atol=1e-7)
    assert (abs(ours[1:, 2]) > 0.03 * ours[1:, 0]).all()
    if light:
        assert (abs(ours[:, 3] / ours[:, 0]) > 0.5).all()


def test_reflectance_factor_of_eradiate_is_pi_times_the_brdf():
    """``radiance`` over ``irradiance``, which has the cosine of the sun, is the BRDF; ``brf`` is π times as much."""
    known, theirs = rows("eradiate", "matt")
    assert_allclose(np.pi * theirs[:, 0, 0], 0.3, rtol=1e-7)
    assert_allclose(known["R"], 0.3, rtol=1e-7)
    known, theirs = rows("eradiate", "sea natural")
    assert_allclose(known["R"], np.pi * theirs[:, 0, 0], rtol=1e-7)


def test_mueller_of_pyelli_has_m00_divided_out():
    """Without the reflectance it stays a ratio; a matrix with M00 ≠ 1 is not what pyElli gives."""
    known, theirs = rows("pyElli", "reflection")
    assert_array_equal(convert.from_pyelli_mueller(theirs), theirs)
    assert_allclose(convert.from_pyelli_mueller(theirs, known["R"])[:, 0, 0], known["R"], atol=1e-12)
    with pytest.raises(DataError, match="M00 = 1"):
        convert.from_pyelli_mueller(0.5 * theirs)
    with pytest.raises(DataError, match=r"\(2,\) for matrices of \(6,\)"):
        convert.from_pyelli_mueller(theirs, known["R"][:2])
    theirs[0] = np.nan
    assert_array_equal(convert.from_pyelli_mueller(theirs, 0.5), 0.5 * theirs)


def test_index_of_pyelli_has_the_other_sign():
    """n + iκ there, n − iκ here; what pyElli's solvers do not agree on is refused."""
    assert_array_equal(convert.from_pyelli_index([1.5 + 0.5j, 1.3]), [1.5 - 0.5j, 1.3])
    with pytest.raises(DataError, match="conjugate"):
        convert.from_pyelli_index(1.5 - 0.5j)


def test_every_program_has_its_numbers():
    """The front door leads here."""
    assert pbrdf.convert is convert
    with TABLE.open(newline="", encoding="utf-8") as file:
        run = {NAMES.get(r["program"], r["program"]) for r in csv.DictReader(file)}
    assert set(convert.PROGRAMS) == run
