from __future__ import annotations

import numpy as np
import pytest
from dataset_strategies import datasets, same_bits
from hypothesis import HealthCheck, given, settings
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, make_dataset, read, write
from pbrdf.errors import DataError


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ds=datasets())
def test_round_trip_is_bit_for_bit(tmp_path, ds):
    write(ds, tmp_path / "data.csv")
    assert same_bits(read(tmp_path / "data.csv"), ds)


def test_what_is_written_is_what_the_documentation_shows(tmp_path):
    ds = make_dataset(
        np.deg2rad(30.0), np.deg2rad(45.0), np.pi, quantity="brdf", I=0.61, dolp=0.08, std={"I": 0.01},
        wavelength=476, group=1, attrs={"title": "white paint"},
    )  # fmt: skip
    write(ds, tmp_path / "data.csv")
    assert (tmp_path / "data.csv").read_text(encoding="utf-8").splitlines() == [
        "# quantity: brdf",
        "# azimuth: forward=0",
        "# stokes: p-s",
        "# illumination: natural",
        "# simulated: 0",
        "# title: white paint",
        "theta_i_deg,theta_r_deg,phi_deg,wavelength_nm,group,I,I_std,dolp",
        "30.0,45.0,180.0,476.0,1,0.61,0.01,0.08",
    ]


def test_angles_without_exact_degrees_are_written_in_radians(tmp_path):
    odd = 1.0000000000000002
    write(make_dataset(0.5, odd, 0.0, quantity="brdf", I=1.0), tmp_path / "data.csv")
    header, row = (tmp_path / "data.csv").read_text().splitlines()[-2:]
    cells = dict(zip(header.split(","), row.split(","), strict=True))
    assert cells.get("theta_r_rad", repr(odd)) == repr(odd)
    assert float(read(tmp_path / "data.csv")["theta_r"][0]) == odd


# --- header ---------------------------------------------------------------------------------------


def test_header_statements_become_attributes(text_file):
    ds = read(text_file(
        "# quantity: radiance\n# Title: paint: the white one\n# simulated: yes\n# date: 2017\n"
        "# measured by hand\n# see http://example.org\n\ntheta_i,theta_r,I\n# a comment\n30,30,1\n"
    ))  # fmt: skip
    assert ds.attrs["quantity"] == "radiance"
    assert ds.attrs["title"] == "paint: the white one"
    assert ds.attrs["simulated"] == 1
    assert ds.attrs["date"] == 2017
    assert ds.sizes["geometry"] == 1


def test_forward_at_180_is_moved_to_zero(text_file):
    """Their φ = 180° is forward, our φ = 0."""
    ds = read(
        text_file("# azimuth: forward=180\ntheta_i,theta_r,phi,brdf\n30,30,180,1\n30,30,0,2\n30,30,90,3\n")
    )
    assert_array_equal(ds["phi"], np.deg2rad([0.0, 180.0, -90.0]))
    assert "assumptions" not in ds.attrs


def test_s_minus_p_is_turned_to_p_minus_s(text_file):
    """Their Q > 0 is along s: Q and U change sign, V stays; the source's vector as well."""
    ds = read(text_file(
        "# stokes: s-p\n# illumination: 1,0.5,0.25,0.1\ntheta_i,theta_r,brdf,Q,U,V\n30,30,1,0.3,0.2,0.1\n"
    ))  # fmt: skip
    assert [float(ds[name][0]) for name in "IQUV"] == [1.0, -0.3, -0.2, 0.1]
    assert ds.attrs["illumination"] == [1.0, -0.5, -0.25, 0.1]
    assert ds.attrs["stokes_convention"] == "p-s"


def test_s_minus_p_turns_aolp_by_90_degrees(text_file):
    ds = read(text_file("# stokes: s-p\ntheta_i,theta_r,brdf,dolp,aolp\n30,30,1,0.3,0\n30,30,1,0.3,60\n"))
    assert_allclose(np.rad2deg(ds["aolp"]), [90.0, -30.0])


def test_s_minus_p_conjugates_mueller_matrices(text_file):
    ds = read(
        text_file("# stokes: s-p\n# quantity: brdf\ntheta_i,theta_r,m00,m01,m23,m33\n30,30,1,0.2,0.3,0.4\n")
    )
    matrix = ds["mueller"].values[0]
    assert [matrix[0, 0], matrix[0, 1], matrix[2, 3], matrix[3, 3]] == [1.0, -0.2, -0.3, 0.4]
    assert np.isnan(matrix[1, 0])


def test_cosine_weight_is_divided_out_of_values_and_uncertainties(text_file):
    ds = read(text_file("# cosine_weighted: yes\ntheta_i,theta_r,brdf,I_std,dolp\n0,60,1,0.1,0.3\n"))
    assert_allclose([ds["I"][0], ds["I_std"][0], ds["dolp"][0]], [2.0, 0.2, 0.3])


def test_options_count_before_the_header(text_file):
    path = text_file("# quantity: brdf\n# azimuth: forward=0\ntheta_i,theta_r,phi,I,Q\n0.5,0.25,0.1,1,0.2\n")
    ds = read(
        path, quantity="dn", azimuth="forward=180", stokes="s-p", angles="radians", cosine_weighted=True,
        illumination=[1, 0.1, 0, 0],
    )  # fmt: skip
    assert ds.attrs["quantity"] == "dn"
    assert float(ds["theta_i"][0]) == 0.5
    assert_allclose(ds["phi"], 0.1 - np.pi)
    assert_allclose(ds["Q"], -0.2 / np.cos(0.25))
    assert ds.attrs["illumination"] == [1.0, -0.1, 0.0, 0.0]


def test_what_was_assumed_is_recorded_and_shown(text_file):
    ds = read(text_file("theta_i,theta_r,phi,brdf,Q\n30,30,0,1,0.1\n"))
    assert len(ds.attrs["assumptions"]) == 2
    assert [issue.severity for issue in check(ds)] == ["warning", "warning"]
    stated = read(
        text_file("# azimuth: forward=0\n# stokes: p-s\ntheta_i,theta_r,phi,brdf,Q\n30,30,0,1,0.1\n")
    )
    assert check(stated) == []


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("# quantity: bsdf\n", "quantity is 'bsdf'; use brdf or"),
        ("# quantity: brdf\n# azimuth: forward\n", "azimuth is 'forward'; use forward=0 or forward=180"),
        ("# quantity: brdf\n# stokes: ps\n", "stokes is 'ps'; use p-s or s-p"),
        ("# quantity: brdf\n# angles: gon\n", "angles is 'gon'; use degrees or radians"),
        ("# quantity: brdf\n# illumination: sun\n", "illumination is 'sun'; use natural or four numbers"),
        ("# quantity: brdf\n# illumination: 1,2,0,0\n", "no Stokes vector"),
        ("", "does not say what was measured"),
    ],
)
def test_statements_that_are_not_understood(text_file, header, words):
    with pytest.raises(DataError, match=words):
        read(text_file(header + "theta_i,theta_r,I\n30,30,1\n"))


# --- columns --------------------------------------------------------------------------------------


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
        ("theta_i,theta_r,phi_i,phi_r,I", {}, "'phi_i' looks like an azimuth"),
        ("theta_i,theta_r,I", {"where": {"material": "x"}}, "no column 'material' to select by"),
        ("theta_i,theta_r,Q", {}, "the variables are Q"),
    ],
)
def test_columns_that_are_not_understood(text_file, names, options, words):
    row = ",".join("1" * len(names.split(",")))
    with pytest.raises(DataError, match=words):
        read(text_file(f"# quantity: brdf\n{names}\n{row}\n"), **options)


# --- the plane of incidence -----------------------------------------------------------------------


def test_signed_viewing_angles_mean_the_plane_of_incidence(text_file):
    """Without an azimuth: θ_r ≥ 0 on the specular side, φ = 0; θ_r < 0 on the source's side, φ = π."""
    ds = read(text_file("theta_i,theta_r,brdf\n30,40,1\n30,-40,2\n30,0,3\n"))
    assert_array_equal(ds["theta_r"], np.deg2rad([40.0, 40.0, 0.0]))
    assert_array_equal(ds["phi"], [0.0, np.pi, 0.0])
    assert "theta_r < 0 as backward" in ds.attrs["assumptions"][0]


def test_a_negative_viewing_angle_with_azimuth_is_the_opposite_direction(text_file):
    ds = read(text_file("theta_i,theta_r,phi,brdf\n30,-40,0,1\n30,-40,90,2\n"))
    assert_array_equal(ds["theta_r"], np.deg2rad([40.0, 40.0]))
    assert_allclose(ds["phi"], [np.pi, -np.pi / 2])


def test_a_negative_incidence_angle_in_plane_is_refused(text_file):
    with pytest.raises(DataError, match="line 3, column 'theta_i': a negative theta_i without an azimuth"):
        read(text_file("theta_i,theta_r,brdf\n30,40,1\n-30,40,1\n"))


# --- cells ----------------------------------------------------------------------------------------


def test_missing_cells_are_nan(text_file):
    ds = read(text_file("theta_i,theta_r,brdf,Q,U,V\n30,30,1,,nan,NA\n"))
    assert all(np.isnan(ds[name][0]) for name in "QUV")


def test_decimal_commas_are_read_between_semicolons(text_file):
    ds = read(text_file("theta_i;theta_r;brdf\n30,5;40;1,5e-2\n"))
    assert_allclose([np.rad2deg(ds["theta_i"][0]), ds["I"][0]], [30.5, 0.015])


def test_quoted_cells_may_span_lines_without_losing_count(text_file):
    text = 'note,theta_i,theta_r,brdf\n"two\nlines",30,30,1\n\n"b, c",30,30,x\n'
    with pytest.raises(DataError, match="line 5, column 'brdf': 'x' is not a number"):
        read(text_file(text))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("30,30,1\n30,30,abc\n", "line 3, column 'brdf': 'abc' is not a number"),
        ("30,30\n", "line 2: 2 cells under 3 column names"),
        ("30,30,1,5\n", "line 2: 4 cells under 3.*decimal commas"),
        ("", "no rows"),
        ("30,30,1\n\n95,30,1\n", r"theta_i \(column 'theta_i'\), line 4: .*\(95°\)"),
        ("30,30,inf\n", r"I \(column 'brdf'\), line 2: infinite"),
    ],
)
def test_cells_that_are_not_understood_are_named(text_file, rows, words):
    with pytest.raises(DataError, match=rf"data\.csv(.|\n)*{words}"):
        read(text_file("theta_i,theta_r,brdf\n" + rows))


def test_an_empty_file_is_refused(text_file):
    with pytest.raises(DataError, match="no line of column names"):
        read(text_file("# quantity: brdf\n"))


def test_windows_line_ends_and_byte_order_mark(text_file):
    assert read(text_file("\ufefftheta_i,theta_r,brdf\r\n30,30,1\r\n")).sizes["geometry"] == 1


# --- choosing rows --------------------------------------------------------------------------------

MIXED = "material,theta_i,theta_r,brdf\nwhite,90,30,nan\nblack,30,30,1\nwhite,30,30,2\nwhite,30,40,nan\n"


def test_rows_are_selected_by_text(text_file):
    path = text_file(MIXED)
    assert_array_equal(read(path, where={"material": "black"})["I"], [1.0])
    with pytest.raises(
        DataError, match="no row has 'red' in the column 'material'; there are 'black', 'white'"
    ):
        read(path, where={"material": "red"})


def test_invalid_rows_are_refused_or_skipped_and_counted(text_file):
    path = text_file(MIXED)
    with pytest.raises(DataError, match="line 2"):
        read(path)
    ds = read(path, skip_invalid=True)
    assert_array_equal(ds["I"], [1.0, 2.0])
    assert ds.attrs["skipped_rows"] == 2
    assert "skipped_rows" not in read(path, where={"material": "black"}, skip_invalid=True).attrs


def test_skipping_does_not_excuse_other_errors(text_file):
    with pytest.raises(DataError, match="no rows"):
        read(text_file("theta_i,theta_r,brdf\n95,30,1\n"), skip_invalid=True)


@pytest.mark.parametrize("material", ["reference_paint_rough", "reference_paint_smooth"])
def test_a_strangers_table_of_paints(measured, material):
    path = measured("mwir-paint/mwir_brdf_inplane.csv")
    with pytest.raises(DataError, match=r"theta_i \(column 'theta_i_deg'\), lines .*\(90°\)"):
        read(path, where={"material": material})
    ds = read(
        path,
        column={"I": "f_r_per_sr", "theta_r": "theta_o_deg", "phi": "=0"},
        where={"material": material},
        skip_invalid=True,
    )
    assert ds.sizes["geometry"] == 890
    assert ds.attrs["skipped_rows"] == 10
    assert check(ds) == []
    # Source and camera on opposite sides: the peak at θ_r = 30° lies in the mirror direction.
    at_30 = ds.isel(geometry=np.isclose(ds["theta_r"], np.deg2rad(30)))
    peak = at_30.isel(geometry=int(np.argmax(at_30["I"].values)))
    assert abs(float(peak["theta_i"]) - np.deg2rad(30)) < np.deg2rad(3)
