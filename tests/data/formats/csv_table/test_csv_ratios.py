"""Normalised polarisation in CSV tables: what columns mean, signs in words, what touches ratios and what does not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read, write
from pbrdf.data.formats.csv_table.ratios import ratio_variable
from pbrdf.errors import DataError


@pytest.fixture
def table(tmp_path):
    """Write a table of few lines, read it."""

    def make(text, **options):
        path = tmp_path / "table.csv"
        path.write_text(text, encoding="utf-8")
        return read(path, **options)

    return make


@pytest.mark.parametrize(
    ("name", "variable"),
    [
        ("Q/I", "Q_over_I"),
        ("S1/S0", "Q_over_I"),
        ("s2 / s0", "U_over_I"),
        ("q_over_i", "Q_over_I"),
        ("S3_over_S0", "V_over_I"),
        ("V over I", "V_over_I"),
        ("(U/I)", "U_over_I"),
        ("Q_norm", "Q_over_I"),
        ("normalised S2", "U_over_I"),
    ],
)
def test_names_of_normalised_stokes_parameters(table, name, variable):
    ds = table(f"theta_i,theta_r,phi,{name}\n30,30,0,-0.25\n")
    assert ds.attrs["quantity"] == "normalised"
    assert list(ds.data_vars) == [variable]
    assert float(ds[variable][0]) == -0.25


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("M12/M11", (0, 1)),
        ("M12_over_M11", (0, 1)),
        ("m01/m00", (0, 1)),
        ("m01_over_m00", (0, 1)),
        ("M33/M11", (2, 2)),
        ("m33/m00", (3, 3)),
        ("M44/M11", (3, 3)),
        ("f_r21/f_r11", (1, 0)),
        ("S34/S11", (2, 3)),
        ("M(1_2)/M(1_1)", (0, 1)),
        ("M[1 2]/M[1 1]", (0, 1)),
        ("M₁₂/M₁₁", (0, 1)),
    ],
)
def test_the_divisor_says_what_elements_are_counted_from(table, name, place):
    ds = table(f"theta_i,theta_r,phi,{name}\n30,30,0,0.25\n")
    expected = np.full((4, 4), np.nan)
    expected[place] = 0.25
    assert_array_equal(ds["mueller_over_m00"].values[0], expected)


@pytest.mark.parametrize(
    "key", ["q/s0", "i/i", "s1/s2", "m12/m22", "m44/m00", "m01/m11", "m22/m22", "voveru"]
)
def test_other_quotients_are_no_ratios(key):
    assert ratio_variable(key) is None


def test_uncertainties_and_per_cent(table):
    ds = table("theta_i,theta_r,phi,Q/I (%),Q/I_std (%)\n30,30,0,-25,1\n")
    assert_allclose([float(ds["Q_over_I"][0]), float(ds["Q_over_I_std"][0])], [-0.25, 0.01])
    ds = table("theta_i,theta_r,phi,M21/M11,M21/M11_std\n30,30,0,0.1,0.02\n")
    assert float(ds["mueller_over_m00_std"][0, 1, 0]) == 0.02


def test_ratios_beside_an_intensity_need_its_quantity_alone(table):
    """An intensity keeps its unit, its cosine and its scale; the ratio has none of them."""
    text = "theta_i,theta_r,phi,reflectance_factor,S1/S0\n30,60,0,0.5,-0.25\n"
    ds = table(text, cosine_weighted=True)
    assert ds.attrs["quantity"] == "reflectance_factor"
    assert_allclose(float(ds["I"][0]), 1.0)
    assert float(ds["Q_over_I"][0]) == -0.25


def test_light_that_is_stronger_along_s_has_a_negative_share(table):
    """A file that counts Q > 0 along s says +0.3 of light that the project calls −0.3; V keeps its sign."""
    text = "theta_i,theta_r,phi,Q/I,U/I,V/I\n55,55,0,0.3,0.1,0.05\n"
    ds = table(text, stokes="s-p")
    found = [float(ds[name][0]) for name in ("Q_over_I", "U_over_I", "V_over_I")]
    assert found == [-0.3, -0.1, 0.05]
    assert not any("Q > 0" in words for words in ds.attrs["assumptions"])
    assert any("Q > 0" in words for words in table(text).attrs["assumptions"])


def test_elements_between_q_and_the_rest_change_their_sign(table):
    """With Q > 0 along s glass has M12 > 0, with the project's Q > 0 along p it has m01 < 0; M33 and M34 keep, lose."""
    ds = table("theta_i,theta_r,phi,M12/M11,M33/M11,M34/M11\n55,55,0,0.9,-0.3,0.1\n", stokes="s-p")
    M = ds["mueller_over_m00"].values[0]
    assert [M[0, 1], M[2, 2], M[2, 3]] == [-0.9, -0.3, -0.1]


def test_dolp_alone_and_with_aolp_need_no_intensity(table):
    ds = table("theta_i,theta_r,phi,DoLP\n30,30,0,0.2\n")
    assert (list(ds.data_vars), ds.attrs["quantity"]) == (["dolp"], "normalised")
    ds = table("theta_i,theta_r,phi,DoLP,AoLP\n30,30,0,0.2,90\n")
    assert_allclose(float(ds["aolp"][0]), np.pi / 2)


@pytest.mark.parametrize("intensity", ["", ",1"])
def test_columns_of_stokes_parameters_may_be_stated_as_normalised(table, intensity):
    head = ",S0" if intensity else ""
    ds = table(f"theta_i,theta_r,phi,S1,S2{head}\n30,30,0,-0.2,0.1{intensity}\n", quantity="normalised")
    assert list(ds.data_vars) == ["Q_over_I", "U_over_I"]
    with pytest.raises(DataError, match="but I is 7, not 1"):
        table("theta_i,theta_r,phi,S0,S1\n30,30,0,7,-0.2\n", quantity="normalised")


@pytest.mark.parametrize("minus", ["-", "−", "- "])
def test_a_minus_before_the_name_turns_the_sign_but_not_the_uncertainty(table, minus):
    """−M12/M11 is how tables of scattering give the degree of linear polarisation."""
    ds = table(f"theta_i,theta_r,phi,{minus}M12/M11,M12/M11_std\n30,30,0,0.3,0.01\n")
    assert float(ds["mueller_over_m00"][0, 0, 1]) == -0.3
    assert float(ds["mueller_over_m00_std"][0, 0, 1]) == 0.01


def test_matrices_with_m00_of_1_are_told_to_be_ratios(table):
    text = "theta_i,theta_r,phi,m00,m01\n30,30,0,1,-0.2\n40,40,0,1,-0.3\n"
    (issue,) = [i for i in check(table(text, quantity="brdf")) if i.variable == "mueller"]
    assert "read the file with the quantity normalised" in issue.message
    stokes = "theta_i,theta_r,phi,I,Q\n30,30,0,1,-0.2\n40,40,0,1,-0.3\n"
    assert any("as if Q were divided by it" in i.message for i in check(table(stokes, quantity="brdf")))
    ds = table(text, quantity="normalised")
    assert_array_equal(ds["mueller_over_m00"].values[:, 0, 1], [-0.2, -0.3])


def test_one_column_for_both_angles_is_the_mirror_configuration(table):
    """The sign is the side of the normal; -60 is read as 60 with the viewer in the mirror direction."""
    text = "theta_i_deg,M12/M11,blocked\n-60,0.9,0\n1,0.5,1\n60,0.9,0\n"
    ds = table(text, column={"theta_r": "theta_i_deg"}, where={"blocked": "0"})
    for name in ("theta_i", "theta_r"):
        assert_allclose(np.rad2deg(ds[name]), [60, 60])
    assert_array_equal(ds["phi"], [0, 0])
    assert ds["group"].values.tolist() == ["negative side", "positive side"]
    assert any("mirror direction" in words for words in ds.attrs["assumptions"])


@pytest.mark.parametrize("name", ["a.csv", "a.nc", "a.zarr"])
def test_files_hold_ratios(table, tmp_path, name):
    ds = table("theta_i,theta_r,phi,brdf,M12/M11,M12/M11_std,M44/M11\n30,30,0,0.2,-0.4,0.01,0.5\n")
    write(ds, tmp_path / name)
    again = read(tmp_path / name)
    assert again.identical(ds)
    assert again["mueller_over_m00"].attrs["units"] == "1"


@pytest.mark.parametrize("head", ["I,Q,U,DoLP,AoLP,Q/I", "S0,S1,S2,DoLP,AoLP,S1/S0"])
def test_what_follows_from_stokes_parameters_is_left_out_and_said(table, head):
    """DoLP 0.5 and AoLP ½ atan2(0.3, 0.4) = 18.435° repeat I = 2, Q = 0.8, U = 0.6."""
    ds = table(f"theta_i,theta_r,phi,{head}\n30,30,0,2,0.8,0.6,0.5,18.435,0.4\n", quantity="brdf")
    assert list(ds.data_vars) == ["I", "Q", "U"]
    said = [words for words in ds.attrs["assumptions"] if "follows from Q, U" in words]
    assert len(said) == 3


def test_what_should_follow_but_does_not_is_told(table):
    ds = table("theta_i,theta_r,phi,Q/I,U/I,DoLP,AoLP\n30,30,0,0.4,0.3,50,-71.565\n")
    assert list(ds.data_vars) == ["Q_over_I", "U_over_I"]
    said = " ".join(ds.attrs["assumptions"])
    assert "dolp was not used and disagrees with Q/I, U/I, which were, by up to 49.5" in said
    assert "aolp was not used and disagrees with Q/I, U/I, which were, by up to 90°" in said


def test_nothing_that_stands_alone_is_left_out(table):
    ds = table("theta_i,theta_r,phi,brdf,DoLP,AoLP\n30,30,0,0.4,0.3,10\n")
    assert set(ds.data_vars) == {"I", "dolp", "aolp"}
    ds = table("theta_i,theta_r,phi,brdf,Q/I,V/I\n30,30,0,0.4,0.3,0.1\n")
    assert set(ds.data_vars) == {"I", "Q_over_I", "V_over_I"}


def test_a_degree_where_nothing_else_was_measured_is_not_lost(table):
    with pytest.raises(DataError, match="the variables are I, Q, U, dolp"):
        table("theta_i,theta_r,phi,brdf,Q,U,DoLP\n30,30,0,2,0.8,0.6,0.5\n30,40,0,2,,,0.3\n")
