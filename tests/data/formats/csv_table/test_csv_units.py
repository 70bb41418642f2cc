"""Units of every column, from its name, a row of units, comments or an option: read, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pbrdf.data import check, read
from pbrdf.data.formats.csv_table.columns import resolve_columns
from pbrdf.data.formats.csv_table.header import Header
from pbrdf.data.formats.csv_table.units import parse_unit
from pbrdf.data.formats.csv_table.values import values_of
from pbrdf.errors import DataError
from pbrdf.files.delimited import read_table

STATED = "# azimuth: forward=0\n# stokes: p-s\n"


@pytest.mark.parametrize(
    ("texts", "kind", "factor"),
    [
        ("deg ° degrees Degree", "degrees", 1.0),
        ("arcmin", "degrees", 1 / 60),
        ("rad radians", "radians", 1.0),
        ("mrad", "radians", 1e-3),
        ("nm nanometers", "length", 1.0),
        ("um µm μm micron micrometres", "length", 1e3),
        ("m", "length", 1e9),
        ("Å angstrom", "length", 0.1),
        ("cm-1 cm^-1 1/cm cm⁻¹", "wavenumber", 1.0),
        ("% percent pct", "share", 0.01),
        ("1 - dimensionless", "share", 1.0),
        ("1/sr sr^-1 sr-1 sr⁻¹ /sr sr^{-1} sr**-1 1/steradian", "per steradian", 1.0),
        ("1/msr msr^-1 /msr", "per steradian", 1e3),
        ("1/µsr", "per steradian", 1e6),
        ("%/sr", "per steradian", 0.01),
        ("V", "V", 1.0),
        ("mV", "V", 1e-3),
        ("a.u. counts DN W/m²/sr", "signal", 1.0),
    ],
)
def test_spellings_of_units(texts, kind, factor):
    for text in texts.split():
        unit = parse_unit(text)
        assert unit is not None, text
        assert (unit.kind, unit.factor) == (kind, pytest.approx(factor, rel=1e-12)), text
    assert parse_unit("per sr") == parse_unit("1/sr")


@pytest.mark.parametrize("text", ["grad", "", "k=2", "furlong", "eV", "K", "f_r11", "I", "sr"])
def test_what_is_no_unit(text):
    assert parse_unit(text) is None


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("BRDF (1/sr)", "0.3", 0.3),
        ("BRDF (1/msr)", "0.0003", 0.3),
        ("BRDF [sr^-1]", "0.3", 0.3),
        ("BRDF / sr⁻¹", "0.3", 0.3),
        ("BRDF, 1/msr", "0.0003", 0.3),
        ("brdf_per_msr", "0.0003", 0.3),
        ("BRDF sr^-1", "0.3", 0.3),
        ("Reflectance factor (%)", "96", 0.96),
        ("R [percent]", "96", 0.96),
        ("BRF_pct", "96", 0.96),
        ("Panel BRF", "0.96", 0.96),
    ],
)
def test_units_of_values(text_file, name, value, expected):
    """The cases B1 and B2, and what is like them."""
    quoted = f'"{name}"'
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,{quoted}\n30,20,0,{value}\n"))
    assert_allclose(ds["I"], [expected], rtol=1e-14)
    assert ds.attrs["quantity"] == ("brdf" if expected == 0.3 else "reflectance_factor")


def test_per_cent_gives_the_number_that_the_decimal_stands_for(text_file):
    ds = read(
        text_file(f"{STATED}theta_i,theta_r,phi,Reflectance factor (%)\n30,0,0,96\n30,20,0,95\n30,40,0,93\n")
    )
    assert ds["I"].values.tolist() == [0.96, 0.95, 0.93]
    assert check(ds) == []


@pytest.mark.parametrize(
    ("name", "value", "degrees"),
    [
        ("theta_i / deg", "30", 30.0),
        ("θ_i (°)", "30", 30.0),
        ("angle of incidence (°)", "30", 30.0),
        ("theta_i (mrad)", "500", np.rad2deg(0.5)),
        ("theta_i [rad]", "0.5", np.rad2deg(0.5)),
        ("theta_i (arcmin)", "1800", 30.0),
        ("AOI_deg", "30", 30.0),
        ("solar elevation", "60", 30.0),
    ],
)
def test_units_of_angles(text_file, name, value, degrees):
    ds = read(text_file(f"{STATED}{name},theta_r,phi,brdf\n{value},20,0,1\n"))
    assert_allclose(np.rad2deg(ds["theta_i"]), [degrees], rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "value", "nanometres"),
    [
        ("wavelength", "550", 550.0),
        ("Wavelength [nm]", "550", 550.0),
        ("λ (µm)", "0.55", 550.0),
        ("lambda_um", "0.351", 351.0),
        ("wavelength (m)", "550e-9", 550.0),
        ("wl (Å)", "5500", 550.0),
        ("wavenumber (cm-1)", "20000", 500.0),
    ],
)
def test_units_of_wavelengths(text_file, name, value, nanometres):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,{name},brdf\n30,20,0,{value},1\n"))
    assert_allclose(ds["wavelength"], [nanometres], rtol=1e-12)
    assert check(ds) == []


@pytest.mark.parametrize(
    "name", ["DoLP (%)", "dolp_pct", "DoLP [percent]", "Degree of linear polarization / %"]
)
def test_a_degree_of_polarisation_in_per_cent(text_file, name):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,brdf,{name},dolp_std (%)\n30,20,0,1,0.21,0.1\n"))
    assert_allclose([ds["dolp"][0], ds["dolp_std"][0]], [0.0021, 0.001])


def test_a_degree_of_polarisation_that_can_only_be_per_cent(text_file):
    rows = "".join(f"30,{angle},0,1,{angle}\n" for angle in range(20, 30))
    path = text_file(f"{STATED}theta_i,theta_r,phi,brdf,DoLP\n{rows}")
    with pytest.raises(DataError, match=r"holds 29: if it is in per cent, state unit=\{'dolp': '%'\}"):
        read(path)
    assert_allclose(read(path, unit={"dolp": "%"})["dolp"], np.arange(20, 30) / 100)
    one = read(text_file(f"{STATED}theta_i,theta_r,phi,brdf,DoLP\n30,20,0,1,21\n"))
    assert any("if it is in per cent, state unit={'dolp': '%'}" in str(issue) for issue in check(one))


def test_a_reflectance_factor_that_is_rather_per_cent(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,reflectance_factor\n30,20,0,96\n"))
    assert "state unit={'I': '%'}" in str(check(ds)[0])


@pytest.mark.parametrize(("value", "advice"), [("0.55", "um"), ("550e-9", "m")])
def test_wavelengths_that_are_none_of_light(text_file, value, advice):
    """The case B5."""
    path = text_file(f"{STATED}wavelength,theta_i,theta_r,phi,brdf\n{value},30,20,0,0.3\n")
    (issue,) = check(read(path))
    assert "is no wavelength of light" in str(issue)
    assert f"unit={{'wavelength': '{advice}'}}" in str(issue)
    mended = read(path, unit={"wavelength": advice})
    assert_allclose(mended["wavelength"], [550.0])
    assert check(mended) == []


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (
            "theta_i (nm),theta_r,brdf",
            r"unit of the column 'theta_i \(nm\)' \(nm\) cannot be that of theta_i",
        ),
        ("theta_i,theta_r,I (deg)", r"'I \(deg\)' \(deg\) cannot be that of I; use 1/sr"),
        (
            "theta_i,theta_r,BRDF (%)",
            r"cannot be that of I; use 1/sr or 1/msr for a BRDF \(% is that of a reflect",
        ),
        ("theta_i,theta_r,brdf,wavelength (eV)", r"'wavelength \(eV\)' is not understood; use nm, um"),
        ("theta_i,theta_r,brdf,wavelength (deg)", "cannot be that of wavelength"),
        ("theta_i,theta_r,brdf,wavenumber", "'wavenumber' is not understood"),
        ("theta_i,theta_r,brdf,dolp (nm)", "cannot be that of dolp; use 1 or %"),
        ("theta_i,theta_r,brdf,Q,U,V (mV)", r"'V \(mV\)' \(mV\) cannot be that of V.*ignore=\['V \(mV\)'\]"),
        ("theta_i,theta_r,brdf,I_std (K)", r"'I_std \(K\)' is not understood"),
        ("theta_i,theta_r,radiance (W/m2/sr),Q,U", "is in no unit, .* is in|is in no unit"),
    ],
)
def test_units_that_cannot_be_right_are_refused(text_file, names, words):
    row = ",".join("1" * len(names.split(",")))
    with pytest.raises(DataError, match=words):
        read(text_file(f"{STATED}{names}\n{row}\n"))


def test_voltages_are_a_radiance_in_one_unit(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I (mV),Q (µV)\n30,20,0,4,500\n")
    ds = read(path, quantity="radiance")
    assert_allclose([ds["I"][0], ds["Q"][0]], [4.0, 0.5])


@pytest.mark.parametrize(
    ("comments", "names", "row"),
    [
        ("# units: deg, deg, rad, 1/msr\n", "theta_i,theta_r,phi,BRDF", "30,20,0.5,0.0003"),
        ("# unit of BRDF: 1/msr\n# phi: rad\n", "theta_i,theta_r,phi,BRDF", "30,20,0.5,0.0003"),
        ("# angles in radians\n", "theta_i (deg),theta_r (deg),phi,BRDF", "30,20,0.5,0.3"),
        ("# All angles are given in radians.\n", "theta_i (deg),theta_r (deg),phi,BRDF", "30,20,0.5,0.3"),
        ("# angles: radians\n", "theta_i (deg),theta_r (deg),phi,BRDF", "30,20,0.5,0.3"),
        ("# angles in mrad\n", "theta_i (deg),theta_r (deg),phi,BRDF", "30,20,500,0.3"),
        ("# phi in rad\n# BRDF is in 1/msr\n", "theta_i,theta_r,phi,BRDF", "30,20,0.5,0.0003"),
    ],
)
def test_comments_say_units(text_file, comments, names, row):
    ds = read(text_file(f"{STATED}{comments}{names}\n{row}\n"))
    assert_allclose(np.rad2deg([ds["theta_i"][0], ds["theta_r"][0]]), [30, 20])
    assert_allclose([ds["phi"][0], ds["I"][0]], [0.5, 0.3])
    assert not {"phi", "units", "BRDF"} & ds.attrs.keys()


def test_a_comment_says_the_unit_of_the_wavelength(text_file):
    for comment in (
        "wavelength unit: um",
        "wavelength in µm",
        "wavelengths are in micrometres",
        "wavelength [um]",
    ):
        names = "theta_i,theta_r,phi,wavelength,brdf"
        if "[" in comment:
            comment, names = "nothing", names.replace("wavelength", comment)
        ds = read(text_file(f"{STATED}# {comment}\n{names}\n30,20,0,0.55,1\n"))
        assert_allclose(ds["wavelength"], [550.0], err_msg=comment)


def test_a_list_of_units_of_another_length_is_refused(text_file):
    with pytest.raises(DataError, match="line 1: 2 units for 3 columns"):
        read(text_file("# units: deg, deg\ntheta_i,theta_r,brdf\n30,20,1\n"))


def test_a_row_of_units(text_file):
    path = text_file("theta_i,theta_r,phi,wavelength,Reflectance factor\n500,20,1,0.55,96\n")
    table = replace(read_table(path), units=["mrad", "deg", "rad", "um", "%"])
    header = Header.parse(path, {})
    found = resolve_columns(table, header, {})
    arrays = values_of(table, found.columns, header).arrays
    got = [float(arrays[name][0]) for name in ("theta_i", "theta_r", "phi", "wavelength", "I")]
    assert_allclose(got, [0.5, np.deg2rad(20), 1.0, 550.0, 0.96])
    with pytest.raises(DataError, match=r"'theta_i \(deg\)' has two units, deg and rad"):
        other = replace(table, names=["theta_i (deg)", *table.names[1:]], units=["rad", "", "", "", ""])
        resolve_columns(other, header, {})


def test_a_stated_unit_counts_before_the_file(text_file):
    path = text_file(f"{STATED}theta_i (deg),theta_r,phi,Signal\n500,20,0,96\n")
    ds = read(
        path, column={"I": "Signal"}, quantity="reflectance_factor", unit={"theta_i": "mrad", "Signal": "%"}
    )
    assert [float(ds["theta_i"][0]), float(ds["I"][0])] == [0.5, 0.96]
    with pytest.raises(DataError, match="the unit 'grad' is not understood"):
        read(path, unit={"theta_i": "grad"})
    with pytest.raises(DataError, match="there is no such column; the columns are"):
        read(path, unit={"dolp": "%"})


def test_values_in_arbitrary_units_have_an_arbitrary_scale(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF (a.u.)\n30,20,0,7\n"))
    assert [float(ds["I"][0]), ds.attrs["quantity"], ds.attrs["scale"]] == [7.0, "brdf", "arbitrary"]
    assert "scale" not in read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF (1/sr)\n30,20,0,7\n")).attrs
    stated = read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF (a.u.)\n30,20,0,7\n"), scale="absolute")
    assert stated.attrs["scale"] == "absolute"


def test_angles_of_polarisation_in_radians_are_noticed(text_file):
    rows = "".join(f"30,{10 * i},0,0.3,0.2,{a}\n" for i, a in enumerate((1.57, 1.5, -1.2, 0.3, 0.2, 0.1)))
    path = text_file(
        f"# quantity: brdf\n# azimuth: forward=0\n# stokes: p-s\ntheta_i,theta_r,phi,I,DoLP,AoLP\n{rows}"
    )
    (said,) = check(read(path))
    assert "state unit={'aolp': 'rad'}" in str(said)
    ds = read(path, unit={"aolp": "rad"})
    assert_allclose(ds["aolp"][0], 1.57)
    assert check(ds) == []
    assert check(read(path, unit={"aolp": "deg"})) == []
