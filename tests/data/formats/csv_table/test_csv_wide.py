"""Tables with one column a wavelength."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.data.origin import origin_of
from pbrdf.errors import DataError

STATED = "# azimuth: forward=0\n"


@pytest.mark.parametrize(
    "names",
    [
        "390nm, 400nm ,410nm",
        "390 nm,400 nm,410 nm",
        "0.39um,0.40 µm,0.41um",
        "BRDF_390,BRDF_400,BRDF_410",
        "BRDF 390nm,BRDF 400nm,BRDF 410nm",
        "brdf(390),brdf(400),brdf(410)",
        "f_r@390nm,f_r@400nm,f_r@410nm",
        "390,400,410",
        "I_390nm,I_400nm,I_410nm",
        "lambda_390,lambda_400,lambda_410",
    ],
)
def test_columns_of_wavelengths_become_rows(text_file, names):
    ds = read(
        text_file(f"{STATED}Incident_angle,Measure_angle,{names}\n10,20,1,2,3\n30,-40,4,5,6\n"),
        quantity="brdf",
    )
    assert_allclose(ds["wavelength"], [390, 400, 410] * 2)
    assert_array_equal(ds["I"], [1, 2, 3, 4, 5, 6])
    assert_allclose(np.rad2deg(ds["theta_r"]), [20] * 3 + [40] * 3)
    assert_allclose(np.rad2deg(ds["phi"]), [0] * 3 + [180] * 3)
    assert origin_of(ds).lines == (3, 3, 3, 4, 4, 4)
    assert check(ds) == []


def test_columns_of_values_and_uncertainties(text_file):
    ds = read(text_file(
        f"{STATED}theta_i,theta_r,BRF_550,BRF_450,BRF_550_std,BRF_450_std\n10,20,1,2,0.1,0.2\n"
    ))  # fmt: skip
    assert ds.attrs["quantity"] == "reflectance_factor"
    assert [float(x) for x in ds["wavelength"]] == [450.0, 550.0]
    assert_array_equal(ds["I"], [2, 1])
    assert_array_equal(ds["I_std"], [0.2, 0.1])


def test_what_the_columns_were_taken_for(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,390nm,400nm,note\n10,20,1,2,x\n"), quantity="brdf")
    assert origin_of(ds).meanings[2:] == (
        ("note", ""),
        ("390nm … 400nm (2 columns)", "I (1/sr), each at its wavelength"),
    )


@pytest.mark.parametrize(
    ("names", "row", "words"),
    [
        ("390nm,400nm", "1,x", "line 2, column '400nm': 'x' is not a number"),
        ("400nm,400 nm", "1,2", "the columns '400nm' and '400 nm' are both 400 nm"),
        ("BRDF_390,BRDF_400,DoLP_390,DoLP_410", "1,1,1,1", "do not go together.* differ at 400 nm"),
    ],
)
def test_columns_of_wavelengths_that_are_not_clear(text_file, names, row, words):
    with pytest.raises(DataError, match=words):
        read(text_file(f"theta_i,theta_r,{names}\n10,20,{row}\n"), quantity="brdf")


def test_numbers_in_names_need_not_be_wavelengths(text_file):
    """One column alone, or beside a column of wavelengths, or of the Mueller matrix."""
    ds = read(text_file("theta_i,theta_r,brdf,sensor2000\n10,20,1,2\n"))
    assert ds.sizes["geometry"] == 1
    assert "wavelength" not in ds.coords
    assert (
        read(text_file("theta_i,theta_r,wavelength,brdf,I_400,I_500\n10,20,550,1,2,3\n")).sizes["geometry"]
        == 1
    )


def test_a_white_panel(measured):
    """A real scan: θ_i 10° … 80°, 35 wavelengths, the lobe at positive viewing angles."""
    ds = read(measured("strangers/test_brdf_viewer_2D_data.csv"), quantity="brdf", azimuth="forward=0")
    wavelengths = np.unique(ds["wavelength"])
    assert_allclose(wavelengths, np.arange(390, 731, 10))
    at = ds.isel(geometry=(ds["wavelength"].values == 550) & np.isclose(ds["theta_i"], np.deg2rad(60)))
    peak = at.isel(geometry=int(np.argmax(at["I"].values)))
    assert float(peak["phi"]) == 0.0
    assert abs(np.rad2deg(float(peak["theta_r"])) - 60) <= 2


@pytest.mark.parametrize(
    ("names", "divisor"),
    [
        ("BRDF 450 nm,BRDF 550 nm,U 450 nm (k=2),U 550 nm (k=2)", 2),
        ("BRDF 450 nm,BRDF 550 nm,U(BRDF 450 nm) (k=2),U(BRDF 550 nm) (k=2)", 2),
        ("BRDF 450 nm,BRDF 550 nm,u(BRDF 450 nm),u(BRDF 550 nm)", 1),
        ("450 nm,550 nm,u(450 nm),u(550 nm)", 1),
        ("450 nm,550 nm,unc (k=2) 450 nm,unc (k=2) 550 nm", 2),
        ("BRDF(450),BRDF(550),std(450),std(550)", 1),
    ],
)
def test_uncertainties_with_the_wavelength_in_brackets(text_file, names, divisor):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,{names}\n30,20,0,0.3,0.4,0.01,0.02\n"), quantity="brdf")
    assert_allclose(ds["I"], [0.3, 0.4])
    assert_allclose(ds["I_std"], np.array([0.01, 0.02]) / divisor)
    assert check(ds) == []


def test_intensities_with_the_wavelength_in_brackets_stay_intensities(text_file):
    ds = read(
        text_file(f"{STATED}# stokes: p-s\ntheta_i,theta_r,phi,I (450 nm),Q (450 nm),I (550 nm),Q (550 nm)\n"
                  "30,20,0,0.3,0.1,0.4,0.2\n"),
        quantity="brdf",
    )  # fmt: skip
    assert_allclose(ds["I"], [0.3, 0.4])
    assert_allclose(ds["Q"], [0.1, 0.2])
