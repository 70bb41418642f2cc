"""Lu and Chipman's decomposition: factors put together by SciPy are found again, and the corners where others give NaN.

Independent means: retarders are SciPy's rotations of the Poincaré sphere, diattenuators its exponentials of boosts.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import pbrdf
from pbrdf.backend import get_backend
from pbrdf.errors import DataError
from pbrdf.optics.decomposition import LuChipman, lu_chipman
from pbrdf.optics.elements import diattenuator, retarder, rotate_frame
from pbrdf.optics.fresnel import mueller_reflection

KATSU = Path(__file__).parents[1] / "data_oracle" / "decompositions.csv"
IDEAL = np.diag([1.0, 0.0, 0.0, 0.0])
FIELDS = LuChipman.__dataclass_fields__


def whole(block, polarizance=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[1:, 0], matrix[1:, 1:] = polarizance, block
    return matrix


def turned(vector):
    """A retarder: the sphere turned right-handed about the vector, by its length."""
    return whole(Rotation.from_rotvec(vector).as_matrix())


def boosted(vector):
    """A diattenuator of this diattenuation vector, M00 = 1."""
    length = np.linalg.norm(vector)
    generator = np.zeros((4, 4))
    generator[0, 1:] = generator[1:, 0] = np.divide(vector, length) * np.arctanh(length) if length else 0.0
    return expm(generator) * np.sqrt(1.0 - length**2)


@st.composite
def vectors(draw, shortest, longest):
    direction = np.array([draw(st.integers(-9, 9)) for _ in range(3)], dtype=float)
    if not direction.any():
        direction[0] = 1.0
    return direction / np.linalg.norm(direction) * draw(st.floats(shortest, longest))


def product(found):
    return found.depolarizer @ found.retarder @ found.diattenuator


@given(
    D=vectors(0.0, 0.99),
    turn=vectors(0.01, np.pi - 0.01),
    frame=vectors(0.0, 3.0),
    left=st.tuples(*[st.floats(0.02, 1.0)] * 3),
    P=vectors(0.0, 0.5),
    sign=st.sampled_from([1.0, -1.0]),
    transmittance=st.sampled_from([1e-12, 0.05, 1.0, 3e5]),
)
def test_factors_are_found_again(D, turn, frame, left, P, sign, transmittance):
    axes = Rotation.from_rotvec(frame).as_matrix()
    depolarizer = whole(sign * axes @ np.diag(left) @ axes.T, P)
    factors = (depolarizer, turned(turn), transmittance * boosted(D))
    matrix = np.linalg.multi_dot(factors)
    found = lu_chipman(matrix)
    # the retarder of what is left of 2 % behind a diattenuation of 99 % is known to 1/(0.02 · 0.02) roundings
    assert_allclose(found.depolarizer, factors[0], atol=1e-11)
    assert_allclose(found.retarder, factors[1], atol=1e-10)
    assert_allclose(found.diattenuator / transmittance, factors[2] / transmittance, atol=1e-13)
    assert_allclose(product(found) / transmittance, matrix / transmittance, atol=1e-12)
    assert found.retardance == pytest.approx(np.linalg.norm(turn), abs=1e-10)
    assert_allclose(found.fast_axis, turn / np.linalg.norm(turn), atol=1e-8)
    assert_allclose(found.diattenuation_vector, D, atol=1e-14)
    assert found.diattenuation == pytest.approx(np.linalg.norm(D), abs=1e-14)
    assert_allclose(found.polarizance_vector, matrix[1:, 0] / matrix[0, 0], rtol=1e-12, atol=1e-15)
    assert found.polarizance == pytest.approx(np.linalg.norm(found.polarizance_vector))
    assert found.depolarization == pytest.approx(1.0 - sum(left) / 3.0, abs=1e-11)


@pytest.mark.parametrize("angle", [-1.2, 0.0, 0.3, 1.1])
@pytest.mark.parametrize("delta", [1e-9, 1e-4, 0.5, np.pi / 2, 2.0, np.pi - 1e-4, np.pi - 1e-8])
@pytest.mark.parametrize("scale", [1.0, 0.5, 1e-9])
def test_exact_retarders(angle, delta, scale):
    """A retarder with its fast axis at an angle has that axis and its retardance to the last digits, near 0 and π too,
    whatever it transmits (katsu: NaN, and 120° for a quarter wave at half the transmittance)."""
    found = lu_chipman(scale * retarder(angle, delta))
    assert found.retardance == pytest.approx(delta, abs=4e-16)
    assert_allclose(found.fast_axis, [np.cos(2 * angle), np.sin(2 * angle), 0.0], atol=3e-16 / np.sin(delta))
    assert found.depolarization == pytest.approx(0.0, abs=1e-15)
    assert found.diattenuation == found.polarizance == 0.0
    assert_allclose(found.diattenuator, scale * np.eye(4), rtol=1e-15)
    assert_allclose(found.retarder, retarder(angle, delta), atol=1e-15)


def test_signs_in_words():
    """The fast axis is that of the elements: the state whose phase leads. A fast axis along x makes left circular light
    (V > 0) of light at 45°; a retardance of −δ is one of δ with the fast axis across. Circular: where left circular
    light leads, light along x turns towards y."""
    assert_allclose(retarder(0.0, np.pi / 2) @ [1, 0, 1, 0], [1, 0, 0, 1], atol=1e-15)
    assert_allclose(lu_chipman(retarder(0.0, np.pi / 2)).fast_axis, [1, 0, 0], atol=1e-15)
    across = lu_chipman(retarder(0.0, -0.4))
    assert across.retardance == pytest.approx(0.4)
    assert_allclose(across.fast_axis, [-1, 0, 0], atol=1e-15)
    # Jones matrix of e^{+iωt} that lets the phase of left circular light lead by 0.4, on light along x
    left, right = np.array([1, -1j]) / np.sqrt(2), np.array([1, 1j]) / np.sqrt(2)
    assert 2 * (left[0] * left[1].conj()).imag == pytest.approx(1.0)
    x, y = np.exp(0.4j) * left * left.conj()[0] + right * right.conj()[0]
    assert np.arctan2((x * y.conj()).real * 2, abs(x) ** 2 - abs(y) ** 2) == pytest.approx(0.4)
    optically_active = rotate_frame(-0.2)
    assert_allclose(optically_active @ [1, 1, 0, 0], [1, np.cos(0.4), np.sin(0.4), 0])
    found = lu_chipman(optically_active)
    assert found.retardance == pytest.approx(0.4)
    assert_allclose(found.fast_axis, [0, 0, 1], atol=1e-15)


def test_half_wave_retarders():
    """Both axes lead alike: that with positive Q is given, at Q = 0 that with positive U; noise does not turn it."""
    angles = np.array([-1.2, -0.9, 0.0, 0.3, np.pi / 4, 3 * np.pi / 4, np.pi / 2])
    found = lu_chipman(retarder(angles, np.pi))
    assert_allclose(found.retardance, np.pi, rtol=1e-15)
    assert_allclose(found.retarder, retarder(angles, np.pi), atol=1e-15)
    lines = np.stack([np.cos(2 * angles), np.sin(2 * angles), 0 * angles], -1)
    lines *= np.where(np.abs(lines[:, :1]) > 1e-9, np.sign(lines[:, :1]), np.sign(lines[:, 1:2]))
    assert_allclose(found.fast_axis, lines, atol=1e-15)
    noise = 1e-12 * np.random.default_rng(0).normal(size=(200, len(angles), 4, 4))
    assert_allclose(lu_chipman(retarder(angles, np.pi) + noise).fast_axis - lines, 0.0, atol=1e-11)
    # a mirror at normal incidence
    assert_array_equal(lu_chipman(np.diag([0.9, 0.9, -0.9, -0.9])).fast_axis, [1, 0, 0])


@pytest.mark.parametrize("scale", [1.0, 0.3, 1e-5])
def test_free_space(scale):
    found = lu_chipman(scale * np.eye(4))
    for name in ("retardance", "diattenuation", "polarizance", "depolarization"):
        assert getattr(found, name) == 0.0
    assert np.isnan(found.fast_axis).all()
    for name in ("depolarizer", "retarder"):
        assert_array_equal(getattr(found, name), np.eye(4))
    assert_array_equal(found.diattenuator, scale * np.eye(4))


def test_noise_of_rounding_does_not_jump():
    """1e-12 of M00 in all elements changes what is determined by as much, and no NaN comes or goes."""
    plain = [
        np.eye(4),
        IDEAL,
        np.diag([1.0, 0.5, 0.3, 0.0]),
        np.diag([1.0, 0.5, 0.0, 0.0]),
        np.diag([1.0, -1 / 3, -1 / 3, -1 / 3]),
        retarder(0.3, 1.0),
        retarder(0.3, np.pi),
        diattenuator(0.2, 0.5),
        diattenuator(0.2),
        whole(0.4 * np.eye(3)) @ retarder(0.1, 2.0) @ diattenuator(0.2, 0.9),
    ]
    noise = 1e-12 * np.random.default_rng(1).uniform(-1, 1, (50, 1, 4, 4))
    exact, noisy = lu_chipman(np.array(plain)), lu_chipman(np.array(plain) + noise)
    for name in FIELDS:
        expected = np.broadcast_to(getattr(exact, name), getattr(noisy, name).shape)
        assert_allclose(getattr(noisy, name), expected, atol=1e-10, err_msg=name)


def test_polarisers():
    """Diattenuation 1; what acts on the state that they pass is not to be told from one matrix, the rest is."""
    for matrix, polarizance in (
        (diattenuator([0.0, 0.3, -1.0]), 1.0),
        (0.2 * retarder(0.4, 1.0) @ diattenuator([0.0, 0.3, -1.0]), 1.0),
        (whole(0.6 * np.eye(3)) @ diattenuator([0.0, 0.3, -1.0]), 0.6),
    ):
        found = lu_chipman(matrix)
        assert_allclose(found.diattenuation, 1.0)
        assert_allclose(found.polarizance, polarizance)
        angles = np.array([0.0, 0.3, -1.0])
        assert_allclose(
            found.diattenuation_vector, np.stack([np.cos(2 * angles), np.sin(2 * angles), 0 * angles], -1)
        )
        assert_allclose(found.diattenuator / matrix[:, :1, :1], 2 * diattenuator(angles), atol=1e-14)
        for name in ("depolarizer", "retarder", "retardance", "fast_axis", "depolarization"):
            assert np.isnan(getattr(found, name)).all(), name
    assert_allclose(pbrdf.depolarization_index(diattenuator([0.0, 0.3])), 1.0)
    # above 1 by noise, as measured ones are
    measured = diattenuator(0.0) + np.diag([0, 0, 0, 1e-3])
    measured[0, 1] *= 1.01
    found = lu_chipman(measured)
    assert found.diattenuation == pytest.approx(1.01)
    assert np.isnan(found.retardance) and np.isfinite(found.diattenuator).all()


def test_nearly_perfect_polarisers_still_tell():
    """1 − D = 1e-6: the retarder behind it is known to a millionth of M00's rounding."""
    found = lu_chipman(retarder(0.4, 1.0) @ diattenuator(0.2, 1.0 - 1e-6))
    assert found.retardance == pytest.approx(1.0, abs=1e-8)
    assert found.depolarization == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize(
    ("left", "depolarization", "retardance"),
    [
        ((1, 1, 1), 0.0, 0.0),
        ((0.5, 0.5, 0.5), 0.5, 0.0),
        ((0.9, 0.6, 0.3), 0.4, 0.0),
        # the third direction is lost: two others are enough for the retarder
        ((0.5, 0.4, 0.0), 0.7, 0.0),
        ((0.6, 0.0, 0.0), 0.8, np.nan),
        ((0, 0, 0), 1.0, np.nan),
        # det < 0: m_Δ is negative, |tr m_Δ| counts
        ((-1 / 3, -1 / 3, -1 / 3), 2 / 3, 0.0),
        ((-0.3, -0.2, -0.1), 0.8, 0.0),
        # and where only one is negative, the others are so after half a turn about it, as the paper has it
        ((0.3, 0.2, -0.1), 0.8, np.pi),
    ],
)
def test_depolarisers(left, depolarization, retardance):
    for scale in (1.0, 0.2):
        matrix = scale * np.diag([1.0, *left])
        found = lu_chipman(matrix)
        assert found.depolarization == pytest.approx(depolarization)
        assert found.retardance == pytest.approx(retardance, nan_ok=True)
        assert found.diattenuation == found.polarizance == 0.0
        if np.isfinite(retardance):
            assert_allclose(product(found), matrix, atol=1e-15)
            assert np.linalg.det(found.retarder) == pytest.approx(1.0)
        assert_allclose(np.abs(found.depolarizer), np.diag(np.abs([1.0, *left])), atol=1e-15)


def test_retardance_is_that_of_the_eigenvalues():
    """exp(±iδ) are eigenvalues of the factor M_R, whatever stands before and behind the retarder."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        matrix = (
            whole(np.diag([0.8, 0.7, 0.9]), [0.05, 0.0, 0.02])
            @ turned(rng.normal(size=3))
            @ boosted(0.3 * rng.uniform(-1, 1, 3))
        )
        found = lu_chipman(matrix)
        angles = np.abs(np.angle(np.linalg.eigvals(found.retarder)))
        assert angles.max() == pytest.approx(found.retardance, abs=1e-12)


@pytest.mark.parametrize("theta", [0.0, 0.4, 1.0, 1.3])
def test_a_smooth_surface_is_what_ellipsometry_says(theta):
    """Diattenuation |cos 2ψ| and retardance |Δ| of r_p/r_s = tan ψ e^{iΔ}, Δ = π along the normal."""
    n = 0.47 - 2.83j
    inside = np.sqrt(1 - (np.sin(theta) / n) ** 2)
    r_p = (n * np.cos(theta) - inside) / (n * np.cos(theta) + inside)
    r_s = (np.cos(theta) - n * inside) / (np.cos(theta) + n * inside)
    Float = get_backend().Float
    mean, difference, real, imaginary = (
        float(x.numpy()[0])
        for x in mueller_reflection(Float([np.cos(theta)]), Float([n.real]), Float([-n.imag]))
    )
    M = np.zeros((4, 4))
    M[:2, :2] = [[mean, difference], [difference, mean]]
    M[2:, 2:] = [[real, -imaginary], [imaginary, real]]
    found = lu_chipman(M)
    assert found.retardance == pytest.approx(abs(np.angle(r_p / r_s)), abs=1e-9)
    assert found.diattenuation == pytest.approx(abs(np.cos(2 * np.arctan(abs(r_p / r_s)))), abs=1e-12)
    assert found.depolarization == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("power", [-300, -30, -3, 3, 30, 200])
def test_scale_changes_the_diattenuator_alone(power):
    matrix = whole(np.diag([0.8, 0.7, 0.9])) @ turned([0.3, -1.0, 0.4]) @ boosted([0.2, 0.1, -0.4])
    one, other = lu_chipman(matrix), lu_chipman(matrix * 10.0**power)
    for name in FIELDS:
        scale = 10.0**power if name == "diattenuator" else 1.0
        assert_allclose(getattr(other, name) / scale, getattr(one, name), rtol=1e-12, atol=1e-14)
    for index in (pbrdf.depolarization_index, pbrdf.cloude_entropy):
        assert index(matrix * 10.0**power) == pytest.approx(index(matrix), rel=1e-12)


def test_matrices_without_light_are_nan_among_others():
    good = retarder(0.3, 1.0)
    bad = [np.zeros((4, 4)), -good, np.full((4, 4), np.nan), good.copy(), good.copy(), good.copy()]
    bad[3][2, 1], bad[4][0, 0], bad[5][0, 0] = np.nan, np.inf, 1e-200
    matrices = np.array([good, *bad, good]).reshape(2, 4, 4, 4)
    found = lu_chipman(matrices)
    for name in FIELDS:
        values = getattr(found, name)
        assert values.shape[:2] == (2, 4)
        flat = values.reshape(8, -1)
        assert np.isfinite(flat[[0, 7]]).all() and np.isnan(flat[1:7]).any(axis=1).all(), name
        if name != "diattenuator":
            assert_array_equal(flat[0], flat[7])
    for index in (pbrdf.depolarization_index, pbrdf.cloude_entropy):
        assert_array_equal(np.isnan(index(matrices)).ravel(), [False, *[True] * 6, False])


@pytest.mark.parametrize(
    "function", [lu_chipman, pbrdf.depolarization_index, pbrdf.cloude_entropy, pbrdf.coherency_eigenvalues]
)
def test_other_shapes_are_refused(function):
    with pytest.raises(DataError, match=r"\(\.\.\., 4, 4\), these have \(3, 16\)"):
        function(np.ones((3, 16)))
    with pytest.raises(DataError, match="stokes_out and stokes_in"):
        function(xr.DataArray(np.eye(4), dims=("row", "column")))
    with pytest.raises(DataError, match="stokes_out and stokes_in of the length 4"):
        function(xr.DataArray(np.eye(3), dims=("stokes_out", "stokes_in")))
    with pytest.raises(DataError, match=r'of a data set dataset\["mueller"\]'):
        function(xr.DataArray(np.eye(4), dims=("stokes_out", "stokes_in")).to_dataset(name="mueller"))
    with pytest.raises(DataError, match="real numbers, these are complex"):
        function(np.eye(4, dtype=complex))
    with pytest.raises(DataError, match="are numbers"):
        function([[1, 2], [3]])
    assert lu_chipman(np.ones((0, 4, 4))).fast_axis.shape == (0, 3)


def test_xarray():
    """The kind that was given, with its other dimensions and coordinates, wherever the Stokes dimensions stand."""
    matrices = np.stack([retarder(0.3, d) @ diattenuator(0.2, 0.5) for d in (0.5, 1.0, 1.5)])
    labelled = xr.DataArray(
        matrices,
        dims=("geometry", "stokes_out", "stokes_in"),
        coords={"geometry": [7, 8, 9], "stokes_out": list("IQUV"), "theta_i": ("geometry", [0.1, 0.2, 0.3])},
        attrs={"units": "dn"},
    ).transpose("stokes_in", "geometry", "stokes_out")
    found, plain = lu_chipman(labelled), lu_chipman(matrices)
    for name in FIELDS:
        one = getattr(found, name)
        assert one.dims[0] == "geometry" and list(one["geometry"]) == [7, 8, 9] and "theta_i" in one.coords
        assert_array_equal(one.values, getattr(plain, name))
    assert found.retarder.dims == ("geometry", "stokes_out", "stokes_in")
    assert found.retardance.dims == ("geometry",)
    assert list(found.fast_axis["stokes"].values) == ["Q", "U", "V"]
    for index in (pbrdf.depolarization_index, pbrdf.cloude_entropy):
        assert_array_equal(index(labelled).values, index(matrices))
    assert isinstance(lu_chipman(matrices[0]).retardance, float)


def test_labels_say_which_element_is_which():
    matrices = np.stack([retarder(0.3, d) @ diattenuator(0.2, 0.5) for d in (0.5, 1.0, 1.5)])
    order = list("IQUV")
    labelled = xr.DataArray(
        matrices,
        dims=("geometry", "stokes_out", "stokes_in"),
        coords={"stokes_out": order, "stokes_in": order},
    )
    turned = labelled.sel(stokes_out=list("VUQI"), stokes_in=list("QVIU"))
    found, plain = lu_chipman(turned), lu_chipman(matrices)
    for name in FIELDS:
        assert_array_equal(getattr(found, name).values, getattr(plain, name))
    assert list(found.retarder["stokes_in"].values) == order
    for index in (pbrdf.depolarization_index, pbrdf.cloude_entropy, pbrdf.coherency_eigenvalues):
        assert_array_equal(index(turned), index(matrices))


def test_what_is_masked_is_not_known():
    matrices = np.ma.masked_array(np.stack([retarder(0.3, 1.0)] * 3))
    matrices[1, 2, 3] = np.ma.masked
    for values in (
        lu_chipman(matrices).retardance,
        pbrdf.depolarization_index(matrices),
        pbrdf.cloude_entropy(matrices),
        pbrdf.coherency_eigenvalues(matrices)[:, 0],
    ):
        assert_array_equal(np.isnan(values), [False, True, False])


def test_depolarisation_index_and_entropy():
    """1 and 0 without depolarisation, 0 and 1 for the ideal depolariser; a mixture of two equal orthogonal ones has
    half the entropy; noise, which makes eigenvalues negative, does no harm."""
    for pure in (np.eye(4), retarder(0.3, 1.0), diattenuator(0.1), 0.2 * diattenuator(0.1, 0.4)):
        assert pbrdf.depolarization_index(pure) == pytest.approx(1.0)
        assert pbrdf.cloude_entropy(pure) == pytest.approx(0.0, abs=1e-13)
    assert pbrdf.depolarization_index(IDEAL) == 0.0
    assert pbrdf.cloude_entropy(IDEAL) == pytest.approx(1.0)
    assert pbrdf.cloude_entropy(np.eye(4) + retarder(0.0, np.pi)) == pytest.approx(0.5)
    # Gil and Bernabeu: of diag(1, a, a, a) it is a
    assert pbrdf.depolarization_index(0.3 * np.diag([1, 0.6, 0.6, 0.6])) == pytest.approx(0.6)
    assert pbrdf.cloude_entropy(np.diag([1.0, 1.1, 1.0, 1.0])) == pytest.approx(0.0, abs=0.2)


def test_katsu_finds_the_same_factors():
    """katsu 0.1.0 (``scripts/make_decomposition_numbers.py``), where it is right: D ≠ 0, D ≠ 1, det > 0."""
    with KATSU.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cases = [rows[k : k + 4] for k in range(0, len(rows), 4)]
    assert len(cases) == 5
    for case in cases:
        theirs = {
            r["what"]: np.array([float(r[f"m{i}{j}"]) for i in range(4) for j in range(4)]).reshape(4, 4)
            for r in case
        }
        numbers = {r["what"]: float(r["number"] or "nan") for r in case}
        found = lu_chipman(pbrdf.convert.from_katsu_mueller(theirs["matrix"]))
        for name in ("depolarizer", "retarder", "diattenuator"):
            assert_allclose(
                getattr(found, name), pbrdf.convert.from_katsu_mueller(theirs[name]), atol=1e-11, err_msg=name
            )
        assert found.diattenuation == pytest.approx(numbers["matrix"], abs=1e-13)
        assert found.retardance == pytest.approx(numbers["retarder"], abs=1e-11)
