"""The table of known light: angles, ellipses and handedness in words, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.input_table import InputTable, ellipse, read_input_table, write_input_table
from pbrdf.optics.elements import diattenuator, retarder
from pbrdf.optics.stokes import aolp, docp, dolp


def read(tmp_path, *lines):
    (tmp_path / "inputs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_input_table(tmp_path / "inputs.csv")


def test_angles_and_handedness_in_words(tmp_path):
    """A polariser at 0° gives Q > 0, at 45° (counterclockwise as the receiver sees it) U > 0; left-handed light has
    V > 0, right-handed V < 0; dop 0 is natural light; intensity 0 is darkness."""
    table = read(
        tmp_path,
        "# comment",
        "series,angle_deg,ellipticity_deg,handedness,dop,intensity",
        "a,0,,,,",
        "b,45,,,,2",
        "left,,,left,,",
        "right,,,right,,",
        "half,0,22.5,right,1,",
        "sign,0,-22.5,,1,",
        "natural,,,,0,",
        "dark,,,,,0",
        "part,90,,,0.5,1",
    )
    r = np.sqrt(0.5)
    expected = [
        [1, 1, 0, 0], [2, 0, 2, 0], [1, 0, 0, 1], [1, 0, 0, -1], [1, r, 0, -r], [1, r, 0, -r], [1, 0, 0, 0],
        [0, 0, 0, 0], [1, -0.5, 0, 0],
    ]  # fmt: skip
    np.testing.assert_allclose(table.stokes.T, expected, atol=1e-15)
    assert table.names[:3] == ("a", "b", "left")


def test_left_light_is_what_a_quarter_wave_plate_makes():
    """A polariser at −45° to the fast axis before a quarter-wave plate: with the fast axis at 0° and the polariser at
    45° the light is right (V < 0) or left as the plate's own matrix says; the ellipse says the same."""
    for angle in (45.0, -45.0, 20.0):
        light = retarder(0.0, np.pi / 2) @ diattenuator(np.deg2rad(angle), 1.0) @ [1, 0, 0, 0]
        light = light / light[0]
        chi = 0.5 * np.arcsin(light[3])
        np.testing.assert_allclose(ellipse(0.0, chi), light, atol=1e-12)


@given(
    st.floats(-np.pi / 2 + 1e-3, np.pi / 2 - 1e-3),
    st.floats(-np.pi / 4 + 0.01, np.pi / 4 - 0.01),
    st.floats(0.01, 1),
)
def test_an_ellipse_has_its_angle_and_degree(angle, ellipticity, dop):
    light = ellipse(angle, ellipticity, dop)
    assert aolp(light) == pytest.approx(angle, abs=1e-9)
    assert np.hypot(dolp(light), docp(light)) == pytest.approx(dop)
    # the ratio of the axes
    assert np.tan(0.5 * np.arcsin(np.clip(light[3] / dop, -1, 1))) == pytest.approx(
        np.tan(ellipticity), abs=1e-7
    )


def test_stokes_vectors_and_exposure(tmp_path):
    table = read(tmp_path, "series;I;Q;U;V;exposure", "a;2;1;0;-0,5;1".replace(",", "."), "b;2;1;0;0;0.25")
    np.testing.assert_allclose(table.stokes.T, [[2, 1, 0, -0.5], [0.5, 0.25, 0, 0]])
    assert read(tmp_path, "series,Q,U,V", "a,0.5,0,0").stokes[0] == [1.0]


def test_what_is_written_is_read(tmp_path):
    rng = np.random.default_rng(0)
    S = rng.uniform(-0.5, 0.5, (4, 6))
    S[0] = 1.0
    write_input_table(InputTable(tuple("abcdef"), S), tmp_path / "inputs.csv")
    found = read_input_table(tmp_path / "inputs.csv")
    np.testing.assert_array_equal(found.stokes, S)
    np.testing.assert_array_equal(found.rows(tuple("fedcba")).stokes, S[:, ::-1])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("series,angle_deg",), "there are no rows"),
        (("series,angle", "a,1"), "the column 'angle' is not known; use series, angle_deg"),
        (("series,angle_deg,Q", "a,1,1"), "the column 'angle_deg' is not known"),
        (("series,Q,U", "a,1,0"), "there is no column V"),
        (("series,dop", "a,1"), "there is no column angle_deg"),
        (("series,angle_deg,angle_deg", "a,1,1"), "two columns are called angle_deg"),
        (("series,angle_deg", "a,x"), r"line 2, column 'angle_deg': 'x' is not a number"),
        (("series,angle_deg", "a,1,2"), "line 2: 3 cells under 2 column names"),
        (("series,angle_deg", ",1"), "line 2, column 'series': the cell is empty"),
        (("series,angle_deg", "a,"), "give the angle, or dop = 0 for natural light"),
        (("series,angle_deg,dop", "a,1,1.5"), "1.5 is not a number from 0 to 1"),
        (("series,angle_deg,ellipticity_deg", "a,1,50"), "50 is not a number from -45 to 45"),
        (("series,angle_deg,intensity", "a,1,-1"), "-1 is not a number of 0 or more"),
        (("series,handedness", "a,l"), "'l': use left"),
        (("series,angle_deg,ellipticity_deg,handedness", "a,1,-10,left"), "a negative ellipticity is right-handed"),
        (("series,angle_deg", "a,1", "a,2"), "the series 'a' stands there twice"),
        (("series,I,Q,U,V", "a,1,1,1,0"), "series 'a': I = 1 with .* = 1.41421 is no light"),
        (("series,angle_deg,intensity", "a,1,0"), "all inputs are dark"),
    ],
)  # fmt: skip
def test_mistakes_name_the_place(tmp_path, lines, message):
    with pytest.raises(DataError, match=message):
        read(tmp_path, *lines)


def test_rows_must_be_those_of_the_frames():
    table = InputTable(("a", "b"), np.array([[1.0, 1.0], [0, 0], [0, 0], [0, 0]]))
    with pytest.raises(DataError, match="no row for 'c'"):
        table.rows(("a", "c"))
    with pytest.raises(DataError, match="rows for 'b', of which there are no frames"):
        table.rows(("a",))


def test_uncertainty_of_the_light(tmp_path):
    """Against differences of the ellipse itself; a polariser known to 1.5° is 2·1.5°/√2 = 3.7 % of Q and U."""
    table = read(
        tmp_path,
        "series,angle_deg,ellipticity_deg,dop,angle_std_deg,ellipticity_std_deg",
        "a,20,0,1,1.5,",
        "b,70,30,0.8,,2",
        "c,110,-10,0.5,0.5,1",
    )
    step = 1e-6
    rows = [(20, 0, 1, 1.5, 0), (70, 30, 0.8, 0, 2), (110, -10, 0.5, 0.5, 1)]
    for k, (angle, chi, dop, angle_std, chi_std) in enumerate(rows):
        psi, chi = np.deg2rad(angle), np.deg2rad(chi)
        by_angle = (ellipse(psi + step, chi, dop) - ellipse(psi - step, chi, dop))[1:] / (2 * step)
        by_chi = (ellipse(psi, chi + step, dop) - ellipse(psi, chi - step, dop))[1:] / (2 * step)
        expected = np.hypot(by_angle * np.deg2rad(angle_std), by_chi * np.deg2rad(chi_std))
        np.testing.assert_allclose(table.ratio_std[:, k], expected, atol=1e-9)
    linear = read(tmp_path, "series,angle_deg,angle_std_deg", "a,0,1.5", "b,50,1.5", "c,100,1.5")
    assert linear.accuracy == (pytest.approx(2 * np.deg2rad(1.5) / np.sqrt(2)), 0.0)


def test_light_that_is_not_polarised_or_dark_does_not_dilute_the_uncertainty(tmp_path):
    """Half polarised light turned by σ errs by half as much, for polarisation that is half as large."""
    lines = ["series,angle_deg,dop,angle_std_deg,intensity", "a,0,1,2,1", "b,60,1,2,1", "c,120,1,2,1"]
    alone = read(tmp_path, *lines).accuracy
    more = read(tmp_path, *lines, "natural,,0,2,1", "half,30,0.5,2,3", "dark,0,1,2,0").accuracy
    assert more == pytest.approx(alone)


def test_uncertainty_of_degrees_and_of_stokes_vectors(tmp_path):
    table = read(tmp_path, "series,angle_deg,dop_std,dolp_std", "a,0,0.02,", "b,45,,0.03")
    np.testing.assert_allclose(table.ratio_std.T, [[0.02, 0, 0], [0, 0.03, 0]], atol=1e-15)
    table = read(tmp_path, "series,I,Q,U,V,Q_std,V_std", "a,2,1,0,0,0.1,0.02", "b,2,0,1,0,0.1,")
    np.testing.assert_allclose(table.ratio_std.T, [[0.05, 0, 0.01], [0.05, 0, 0]])
    write_input_table(table, tmp_path / "again.csv")
    np.testing.assert_allclose(read_input_table(tmp_path / "again.csv").ratio_std, table.ratio_std)
    with pytest.raises(DataError, match=r"'angle_sd_deg' is not known \(perhaps 'angle_std_deg'\)"):
        read(tmp_path, "series,angle_deg,angle_sd_deg", "a,0,1")
    with pytest.raises(DataError, match="-1 is not a number of 0 or more"):
        read(tmp_path, "series,angle_deg,angle_std_deg", "a,0,-1")
