"""Columns that are not used: listed, named where they should be, left out where asked."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read, write
from pbrdf.data.origin import origin_of
from pbrdf.errors import DataError

STATED = "# azimuth: forward=0\n# stokes: p-s\n# quantity: brdf\n"


def test_what_each_column_was_taken_for(text_file):
    ds = read(text_file(
        f"{STATED}theta_i_deg,theta_r [rad],phi,lambda_um,cam,BRDF (1/msr),dolp_pct,U (k=2),note\n"
        "30,0.5,0,0.55,left,0.0003,8,0.00001,x\n"
    ), column={"group": "cam", "I_std": "U (k=2)"})  # fmt: skip
    assert origin_of(ds).meanings == (
        ("theta_i_deg", "theta_i (deg)"),
        ("theta_r [rad]", "theta_r (rad)"),
        ("phi", "phi (deg)"),
        ("lambda_um", "wavelength (µm)"),
        ("cam", "group"),
        ("BRDF (1/msr)", "I (1/msr)"),
        ("dolp_pct", "dolp (%)"),
        ("U (k=2)", "I_std (expanded, divided by k = 2)"),
        ("note", ""),
    )
    assert ds.attrs["ignored_columns"] == ["note"]
    assert_allclose(ds["I_std"], [0.005])


@pytest.mark.parametrize(
    "name", ["sample", "Sample_ID", "material", "specimen", "name", "coating", "paint no"]
)
def test_a_second_sample_is_named(text_file, name):
    rows = "30,20,0,0.3,A\n30,30,0,0.4,A\n30,20,0,0.6,B\n30,30,0,0.8,B\n"
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n{rows}")
    words = [str(issue) for issue in check(read(path))]
    assert any(f"the column {name!r} holds 2 values (A, B) and is not used" in w for w in words)
    assert any(f"(lines 5, 7); the column {name!r} (A, B) tells them apart" in w for w in words)
    assert all(f"where={{{name!r}: 'A'}}" in w for w in words)
    assert check(read(path, where={name: "A"})) == []
    assert check(read(path, column={"group": name})) == []
    (left,) = check(read(path, ignore=[name]))
    assert "2 geometries were measured more than once with values that disagree" in str(left)


def test_a_sample_that_is_one_needs_no_word(text_file):
    assert (
        check(read(text_file(f"{STATED}theta_i,theta_r,phi,I,theta_plotted\n30,20,0,0.3,1\n30,30,0,0.4,2\n")))
        == []
    )
    assert (
        check(read(text_file(f"{STATED}theta_i,theta_r,phi,I,sample\n30,20,0,0.3,A\n30,30,0,0.4,A\n"))) == []
    )


def test_rows_of_one_geometry_are_told_apart_by_any_column(text_file):
    rows = "".join(
        f"30,{angle},0,{0.3 + 0.1 * run},{run},{5 * angle + run}\n"
        for angle in (20, 30, 40)
        for run in (1, 2)
    )
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,I,lamp,time\n{rows}"))
    (issue,) = check(ds)
    assert "3 geometries were measured more than once" in str(issue)
    assert "the column 'lamp' (1, 2) tells them apart" in str(issue)


@pytest.mark.parametrize(
    ("name", "values"), [("filter", ("red", "blue")), ("band", ("1", "2")), ("wavelen_x", ("450", "550"))]
)
def test_a_wavelength_that_is_not_used_is_named(text_file, name, values):
    rows = "".join(f"30,{20 + i},0,0.3,{value}\n" for i, value in enumerate(values))
    (issue,) = check(read(text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n{rows}")))
    assert f"the column {name!r} looks like a wavelength ({', '.join(values)}) and is not used" in str(issue)
    assert f"column={{'wavelength': {name!r}}}" in str(issue)


def test_ignoring_a_column(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,I_err,sample\n30,20,0,0.3,0.1,A\n30,30,0,0.4,0.1,B\n")
    ds = read(path, ignore=["I_err", "sample"])
    assert set(ds.data_vars) == {"I"}
    assert check(ds) == []
    assert origin_of(ds).dropped == ("I_err", "sample")
    with pytest.raises(DataError, match="there is no column 'x'"):
        read(path, ignore=["x"])
    with pytest.raises(DataError, match="there is no column theta_i"):
        read(path, ignore=["theta_i"])


def test_states_of_polarisation_are_read_one_at_a_time(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,polarization\n30,20,0,0.3,s\n30,20,0,0.4,p\n")
    with pytest.raises(
        DataError,
        match=r"where=\{'polarization': 's'\} and illumination='1,-1,0,0', or with where=\{'polarization': 'p'\}",
    ):
        read(path)
    with pytest.raises(DataError, match="read it with illumination='1,1,0,0'"):
        read(path, where={"polarization": "p"})
    ds = read(path, where={"polarization": "p"}, illumination="1,1,0,0")
    assert_array_equal(ds["I"], [0.4])
    assert check(ds) == []
    assert read(path, ignore=["polarization"]).sizes["geometry"] == 2


def test_columns_for_s_and_p_are_read_one_at_a_time(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,BRDF_s,BRDF_p\n30,20,0,0.3,0.4\n")
    with pytest.raises(
        DataError, match=r"column=\{'I': 'BRDF_s'\} with illumination='1,-1,0,0', or column=\{'I': 'BRDF_p'\}"
    ):
        read(path)
    ds = read(path, column={"I": "BRDF_s"}, illumination="1,-1,0,0")
    assert_array_equal(ds["I"], [0.3])


@pytest.mark.parametrize(
    ("names", "indices"),
    [
        ("m11,m12,m13,m21,m22,m23,m31,m32,m33", range(3)),
        ("m11,m12,m21,m22", range(2)),
        ("M_11,M_12,M_21,M_22", range(2)),
        ('"M(1,1)","M(1,2)","M(2,1)","M(2,2)"', range(2)),
        (",".join(f"m{i}{j}" for i in range(1, 5) for j in range(1, 5)), range(4)),
    ],
)
def test_mueller_elements_counted_from_1(text_file, names, indices):
    """The case K2: there is no element with an index 0."""
    count = len(indices)
    values = np.array([1.0, *(0.01 * np.arange(1, count * count))])
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,{names}\n30,20,0,{','.join(map(str, values))}\n"))
    assert_array_equal(ds["mueller"].values[0, :count, :count].ravel(), values)
    assert np.isnan(ds["mueller"].values[0]).sum() == 16 - count * count
    said = ["counted from 1" in str(issue) for issue in check(ds)]
    assert said == ([] if count == 4 else [True])


def test_mueller_elements_counted_from_1_with_uncertainties(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,m11,m11_std,m12,m12_std\n30,20,0,1,0.1,0.2,0.3\n"))
    assert ds["mueller_std"].values[0, 0, :2].tolist() == [0.1, 0.3]


@pytest.mark.parametrize(
    ("scale", "words"), [("arbitrary", None), ("absolute", None), ("relative", "scale is 'relative'")]
)
def test_the_scale_is_stated(text_file, scale, words, tmp_path):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I\n30,20,0,0.3\n")
    if words:
        with pytest.raises(DataError, match=words):
            read(path, scale=scale)
        return
    ds = read(path, scale=scale)
    assert ds.attrs["scale"] == scale
    write(ds, tmp_path / "again.csv")
    assert read(tmp_path / "again.csv").attrs["scale"] == scale


@pytest.mark.parametrize(
    ("name", "sentences"),
    [
        ("R", 1),
        ("Reflectance", 1),
        ("radiance factor", 1),
        ("BRF", 0),
        ("reflectance factor", 0),
        ("Panel BRF", 0),
    ],
)
def test_a_quantity_is_never_guessed_in_silence(text_file, name, sentences):
    path = text_file(f"# azimuth: forward=0\ntheta_i,theta_r,phi,{name}\n30,20,0,0.3\n")
    ds = read(path)
    assert ds.attrs["quantity"] == "reflectance_factor"
    assert ["was taken for a reflectance factor" in str(i) for i in check(ds)] == [True] * sentences
    stated = read(path, quantity="brdf")
    assert stated.attrs["quantity"] == "brdf"
    assert check(stated) == []


def test_a_unit_says_the_quantity_too(text_file):
    ds = read(text_file("# azimuth: forward=0\ntheta_i,theta_r,phi,I (1/sr)\n30,20,0,0.3\n"))
    assert ds.attrs["quantity"] == "brdf"
    per_cent = read(text_file("# azimuth: forward=0\ntheta_i,theta_r,phi,I (%)\n30,20,0,30\n"))
    assert per_cent.attrs["quantity"] == "reflectance_factor"
    assert "was taken for a reflectance factor" in str(check(per_cent)[0])


NAMES = {
    "theta_i": "Incident_angle;Incident Zenith;sza;thetai;AOI;incidence angle;theta in;zenith_i;solar zenith angle",
    "theta_r": "Measure_angle;Viewing Zenith;vza;thetar;theta_out;view angle;detector angle;θr;angle of reflection",
    "phi": "Relative Azimuth;raa;Δφ;relative azimuth angle;phi_rel;dphi;rel. azimuth",
}


@pytest.mark.parametrize(
    ("variable", "name"), [(v, n) for v, names in NAMES.items() for n in names.split(";")]
)
def test_names_of_angles_of_public_files(text_file, variable, name):
    names = {"theta_i": "theta_i", "theta_r": "theta_r", "phi": "phi", variable: name}
    ds = read(text_file(f"{STATED}{','.join(names.values())},I\n10,20,30,1\n"))
    assert_allclose(np.rad2deg([ds[v][0] for v in names]), [10, 20, 30])


def test_a_table_without_values_is_told_how_to_name_them(text_file):
    with pytest.raises(
        DataError, match=r"no column holds values; name one, .*column=\{'I': …\}.* theta_i, theta_r, L_o"
    ):
        read(text_file(f"{STATED}theta_i,theta_r,L_o\n30,20,1\n"))


@pytest.mark.parametrize("name", ["u_r", "Uc", "ci_low", "upper", "SNR", "precision"])
def test_other_statements_of_uncertainty_are_named(text_file, name):
    (left,) = check(read(text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n30,20,0,0.3,0.01\n")))
    assert f"the column {name!r} looks like a statement of uncertainty and is not used" in str(left)


@pytest.mark.parametrize("name", ["DoP", "DoP (%)", "P (%)", "degree of polarisation"])
def test_a_degree_of_polarisation_that_may_be_any_is_named(text_file, name):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n30,20,0,0.3,0.1\n30,30,0,0.3,0.2\n")
    (left,) = check(read(path))
    assert f"use it with column={{'dolp': {name!r}}}" in str(left)
    assert_allclose(
        read(path, column={"dolp": name})["dolp"], np.array([0.1, 0.2]) / (100 if "%" in name else 1)
    )


def test_rows_that_cannot_be_are_left_out_where_asked(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I\n90,20,0,0.3\n30,20,0,0.3\n")
    with pytest.raises(DataError, match=r"line 5: .*\(90°\).*leave such rows out with skip_invalid=True"):
        read(path)
    assert read(path, skip_invalid=True).sizes["geometry"] == 1
    with pytest.raises(DataError, match=r"is not in \[0°, 90°\)$"):
        read(text_file(f"{STATED}theta_i,theta_r,phi,I\n90,20,0,0.3\n"))
