"""The specular frame in words: radial 0 is the mirror direction; azimuth 0 leads from it towards the normal, azimuth
180 to the horizon."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.data.formats.zemax import from_specular_frame
from pbrdf.errors import DataError

SMALL = """# Made by hand
#Wavelength (nm) = 550
Source  Measured
Symmetry  PlaneSymmetrical
SpectralContent  Monochrome
ScatterType  BRDF
SampleRotation  1
0
AngleOfIncidence  2
20\t50
ScatterAzimuth 3
0 90 180
ScatterRadial 2
0 30

Monochrome
DataBegin
TIS 0.3
1.5 0.1
1.5 0.2
1.5 0.3
TIS 0.3
2.5 0.4
2.5 0.5
2.5 0.6
DataEnd
"""


def at(ds, **angles):
    """Value of the one row at these angles in degrees."""
    keep = np.ones(ds.sizes["geometry"], bool)
    for name, angle in angles.items():
        keep &= np.abs(np.rad2deg(ds[name].values) - angle) < 1e-6
    assert keep.sum() == 1, (angles, keep.sum())
    return float(ds["I"].values[keep][0])


def test_angles_are_counted_from_the_specular_direction(text_file):
    ds = read(text_file(SMALL, "paint.bsdf"))
    assert ds.sizes["geometry"] == 12
    specular = np.isclose(ds["theta_r"], ds["theta_i"]) & np.isclose(ds["phi"], 0.0)
    assert_array_equal(np.unique(ds["I"].values[specular]), [1.5, 2.5])
    # azimuth 0: 30° from the mirror direction of 50° towards the normal is 20° forward
    assert at(ds, theta_i=50, theta_r=20, phi=0) == 0.4
    # of 20° it is past the normal, 10° on the side of the source
    assert at(ds, theta_i=20, theta_r=10, phi=180) == 0.1
    # azimuth 180: away from the normal
    assert at(ds, theta_i=50, theta_r=80, phi=0) == 0.6
    assert at(ds, theta_i=20, theta_r=50, phi=0) == 0.3


def test_out_of_the_plane_the_radial_angle_is_that_between_the_rays(text_file):
    ds = read(text_file(SMALL, "paint.bsdf"))
    side = ds.isel(geometry=(ds["I"].values == 0.5))
    theta_i, theta_r, phi = (np.float64(side[n].values[0]) for n in ("theta_i", "theta_r", "phi"))
    between = np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    assert_allclose(between, np.cos(np.deg2rad(30)))
    assert_allclose(np.cos(theta_r), np.cos(np.deg2rad(50)) * np.cos(np.deg2rad(30)))


def test_azimuth_turns_anticlockwise_seen_against_the_specular_ray():
    """With forward along x and the normal along z, azimuth 90° of the specular ray is towards −y."""
    theta_r, phi = from_specular_frame(np.deg2rad(40.0), np.deg2rad(90.0), np.deg2rad(10.0))
    assert phi < 0
    assert_allclose(np.sin(theta_r) * np.sin(phi), -np.sin(np.deg2rad(10.0)))


def test_header_facts_are_used(text_file):
    ds = read(text_file(SMALL, "paint.bsdf"))
    assert ds.attrs["quantity"] == "brdf"
    assert_array_equal(np.unique(ds["wavelength"]), [550.0])
    assert_array_equal(np.unique(ds["group"]), [20, 50])
    assert ds.attrs["title"] == "Made by hand; Wavelength (nm) = 550"
    assert "wavelength" not in read(text_file(SMALL.replace("#Wave", "#"), "b.bsdf")).coords


@pytest.mark.parametrize(
    ("comment", "nanometres"),
    [
        ("# Light source: red laser (650 nm, 3.5mm spot diam.)", 650),
        ("# wavelength: 1.55 um", 1550),
        ("# laser lines between 450 nm and 650 nm", None),
        ("# a coating of 300 nm", None),
        ("# sample 7 of 2008", None),
    ],
)
def test_the_one_wavelength_that_comments_name_is_it(text_file, comment, nanometres):
    ds = read(text_file(SMALL.replace("#Wavelength (nm) = 550", comment), "a.bsdf"))
    assert ds.attrs["title"] == f"Made by hand; {comment.removeprefix('# ')}"
    if nanometres is None:
        assert "wavelength" not in ds.coords
    else:
        assert_allclose(ds["wavelength"], nanometres)


def test_long_comments_are_cut_for_the_title(text_file):
    lines = "# ======\n" + "".join(f"# remark number {k}\n" for k in range(100))
    title = read(text_file(lines + SMALL, "a.bsdf")).attrs["title"]
    assert title.startswith("remark number 0; remark number 1;")
    assert len(title) == 200


def test_the_content_tells_the_format(text_file):
    for name in ("paint.txt", "paint.dat", "paint.unknown"):
        assert read(text_file(SMALL.upper() if name == "paint.dat" else SMALL, name)).sizes["geometry"] == 12


def test_several_rotations_are_groups(text_file):
    text = SMALL.replace("SampleRotation  1\n0", "SampleRotation  2\n0 90").replace(
        "PlaneSymmetrical", "ASymmetrical4D"
    )
    body = SMALL[SMALL.index("TIS 0.3\n1.5") : SMALL.index("DataEnd")]
    ds = read(text_file(text.replace("DataEnd", body + "DataEnd"), "a.bsdf"))
    assert_array_equal(ds["group"], np.repeat([0, 90], 12))


def test_tristimulus_blocks_are_groups(text_file):
    start = SMALL.index("Monochrome\nDataBegin")
    block = SMALL[start:]
    text = SMALL[:start].replace("SpectralContent  Monochrome", "SpectralContent XYZ")
    text += "".join(block.replace("Monochrome", f"Tristimulus{axis}") for axis in "XYZ")
    ds = read(text_file(text, "xyz.bsdf"))
    assert_array_equal(ds["group"], np.repeat(["X", "Y", "Z"], 12))


def test_a_cell_on_the_horizon_stays_and_one_below_goes(text_file):
    on = read(text_file(SMALL.replace("0 30\n", "0 40\n"), "on.bsdf"))
    assert on.sizes["geometry"] == 12
    assert on["theta_r"].max() < np.pi / 2
    below = read(text_file(SMALL.replace("0 30\n", "0 45\n"), "below.bsdf"))
    assert below.sizes["geometry"] == 11


def test_zeros_are_cells_that_were_not_measured(text_file):
    ds = read(text_file(SMALL.replace("2.5 0.6", "2.5 0.0"), "a.bsdf"))
    assert ds.sizes["geometry"] == 11
    assert ds.attrs["assumptions"] == ["cells that hold 0 were taken as not measured and left out: 1"]


def test_every_takes_some_nodes(text_file):
    ds = read(text_file(SMALL, "a.bsdf"), every=2)
    assert_array_equal(ds["I"], [1.5, 1.5])
    assert "one node in 2" in ds.attrs["source"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ScatterType  BRDF", "ScatterType  BTDF", "transmission"),
        ("PlaneSymmetrical", "Axial", "line 4: Symmetry is 'Axial'"),
        ("20\t50", "20", r"line 11: AngleOfIncidence"),
        ("20\t50", "20\t95", "AngleOfIncidence: 95° is outside"),
        ("ScatterRadial 2", "ScatterRadial 1000000000", "ScatterRadial"),
        ("ScatterRadial 2", "ScatterRadial -2", "line 13: ScatterRadial: a count from 1"),
        ("1.5 0.2", "1.5 x", "line 20: a row of BSDF values: 'x' is not a number"),
        ("1.5 0.2", "1.5 1_0", "line 20: .*'1_0' is not a number"),
        ("1.5 0.2", "1.5 0.2 0.3", "line 20: a row of BSDF values: 2 numbers are needed"),
        ("2.5 0.6\nDataEnd\n", "", "the file ends where a row of BSDF values .* is it truncated"),
        ("2.5 0.6\n", "2.5 0.6\n1 2\n", "more rows than the header announces"),
        ("TIS 0.3\n2.5", "2.5", "TIS and its value"),
        ("\nMonochrome\nDataBegin", "", "'TIS'"),
        (SMALL[SMALL.index("Monochrome\nData") :], "", "before its data"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    assert old in SMALL
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new), "paint.bsdf"), format="zemax")


def test_the_black_paint_has_its_lobe_on_the_far_side_of_the_normal(measured):
    """At grazing incidence the off-specular peak lies beyond the mirror angle."""
    ds = read(measured("strangers/aeroglaze.bsdf"))
    assert not [issue for issue in check(ds) if issue.severity == "error"]
    grazing = ds.isel(geometry=(ds["group"] == 70).values)
    peak = grazing.isel(geometry=int(np.argmax(grazing["I"].values)))
    assert abs(float(peak["phi"])) < 1e-9
    assert float(peak["theta_r"]) > float(peak["theta_i"])
