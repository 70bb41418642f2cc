"""Columns by their names, synonyms and units, and by what the user says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError


@pytest.mark.parametrize(
    "names",
    [
        "theta_i,theta_r,phi,wavelength_nm,brdf",
        "Theta_I [deg], Theta_R [deg], Phi (deg), Wavelength [nm], BRDF [1/sr]",
        "thetai;thetar;relative azimuth;lambda;f_r_per_sr",
        "incidence\tview-zenith\tphi_deg\twl_nm\tbrdf_per_sr",
        "theta_i_deg,theta_o_deg,RAA,wavelength,f_r",
    ],
)
def test_usual_names_are_understood(text_file, names):
    delimiter = max(",;\t", key=names.count)
    ds = read(text_file(f"{names}\n{delimiter.join(['30', '40', '50', '600', '0.7'])}\n"))
    assert_allclose(np.rad2deg([ds["theta_i"][0], ds["theta_r"][0], ds["phi"][0]]), [30, 40, 50])
    assert [float(ds["wavelength"][0]), float(ds["I"][0])] == [600.0, 0.7]
    assert "ignored_columns" not in ds.attrs


@pytest.mark.parametrize(
    ("column", "quantity"),
    [("brdf", "brdf"), ("reflectance_factor", "reflectance_factor"), ("DN", "dn"), ("radiance", "radiance")],
)
def test_a_column_that_names_its_quantity_states_it(text_file, column, quantity):
    assert read(text_file(f"theta_i,theta_r,{column}\n1,30,1\n")).attrs["quantity"] == quantity


def test_units_in_names_count_before_the_header(text_file):
    ds = read(text_file(
        "# angles: radians\ntheta_i_deg,theta_r,phi,lambda_um,brdf,dolp,aolp_deg,aolp_std [deg]\n"
        "30,0.5,0.1,0.55,1,0.2,45,3\n"
    ))  # fmt: skip
    assert_allclose(ds["theta_i"], np.deg2rad(30))
    assert_array_equal([ds["theta_r"][0], ds["phi"][0]], [0.5, 0.1])
    assert_allclose(ds["wavelength"], 550)
    assert_allclose([ds["aolp"][0], ds["aolp_std"][0]], np.deg2rad([45, 3]))


def test_a_mapping_names_strangers_columns_and_constants(text_file):
    path = text_file("a_rad,b,value,I,cam\n0.5,40,3,9,left\n")
    mapping = {
        "theta_i": "a_rad",
        "theta_r": "b",
        "phi": "=180",
        "I": "value",
        "wavelength": "=550",
        "group": "cam",
    }
    ds = read(path, column=mapping, quantity="brdf")
    assert [float(ds["theta_i"][0]), float(ds["phi"][0]), float(ds["I"][0])] == [0.5, np.pi, 3.0]
    assert float(ds["wavelength"][0]) == 550.0
    assert ds["group"].values.tolist() == ["left"]
    assert ds.attrs["ignored_columns"] == ["I"]
    assert "assumptions" not in ds.attrs


def test_dop_is_not_taken_for_dolp(text_file):
    ds = read(text_file("theta_i,theta_r,brdf,DoP\n30,30,1,0.5\n"))
    assert "dolp" not in ds
    assert ds.attrs["ignored_columns"] == ["DoP"]


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        ("theta_i,x,I", {}, "no column theta_r; name it with column="),
        ("theta_i,theta_r,I,s0", {}, "'I' and 's0' both stand for I"),
        (
            "theta_i,theta_r,I",
            {"column": {"I": "L"}},
            "no column 'L' for I; the columns are theta_i, theta_r, I",
        ),
        ("theta_i,theta_r,I", {"column": {"intensity": "I"}}, "no column is called 'intensity' here"),
        ("theta_i,theta_r,I", {"column": {"phi": "=forward"}}, "constant '=forward' for phi is not a number"),
        ("theta_i [grad],theta_r,I", {}, r"unit of the column 'theta_i \[grad\]'.*deg or rad"),
        ("theta_i,theta_r,m00,m44", {}, "'m44' counts Mueller elements from 1"),
        ("theta_i,theta_r,phi_i,I", {}, "'phi_i' looks like an azimuth"),
        ("theta_i,theta_r,I", {"where": {"material": "x"}}, "no column 'material' to select by"),
        ("theta_i,theta_r,Q", {}, "the variables are Q"),
    ],
)
def test_columns_that_are_not_understood(text_file, names, options, words):
    row = ",".join("1" * len(names.split(",")))
    with pytest.raises(DataError, match=words):
        read(text_file(f"# quantity: brdf\n{names}\n{row}\n"), **options)


@pytest.mark.parametrize(
    "name", ["S_{}{}", "S{}{}", "F{}{}", "f_r{}{}", "Z_{}{}", "M[{},{}]", "mueller_{}_{}"]
)
@pytest.mark.parametrize("first", [0, 1])
def test_elements_of_a_matrix_are_no_angles_of_a_polariser(text_file, name, first):
    places = [(i, j) for i in range(3) for j in range(3)]
    names = ['"' + name.format(i + first, j + first) + '"' for i, j in places]
    values = [0.3, 0.01, 0.0, 0.01, 0.3, 0.02, 0.03, 0.0, 0.2]
    ds = read(text_file(
        "# quantity: brdf\n# azimuth: forward=0\n# stokes: p-s\n"
        f"theta_i,theta_r,phi,{','.join(names)}\n30,20,0,{','.join(map(str, values))}\n"
    ))  # fmt: skip
    assert_allclose(ds["mueller"][0, :3, :3], np.reshape(values, (3, 3)))
    assert "readings" not in ds.attrs
