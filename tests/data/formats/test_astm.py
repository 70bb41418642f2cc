"""The side in words: directions point away from the surface; azimuths that differ by π are the specular half-plane."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError

SMALL = """LAB_NAME Some lab
SYSTEM_NAME goniometer

SAMPLE_NAME "Blue paint"
MEAS_NAME BRDF
NUM_POINTS 3
VARS theta_i,phi_i,theta_s,phi_s,465nm,630nm

0.5,0.0,0.5,3.141592653589793,0.9,0.8
0.5,0.25,0.3,0.25,0.3,0.2
0.5,0.0,-0.3,0.0,0.7,0.6
"""


def test_radians_and_forward_at_pi(text_file):
    ds = read(text_file(SMALL, "paint.astm"))
    assert_array_equal(ds["I"], [0.9, 0.8, 0.3, 0.2, 0.7, 0.6])
    assert_array_equal(ds["wavelength"], [465, 630] * 3)
    assert_allclose(ds["theta_r"][::2], [0.5, 0.3, 0.3])
    assert_allclose(ds["phi"][::2], [0.0, np.pi, 0.0], atol=1e-12)
    assert ds.attrs["title"] == "Blue paint"
    assert ds.attrs["instrument"] == "goniometer"
    assert ds.attrs["quantity"] == "brdf"
    assert "assumptions" not in ds.attrs


def test_a_wavelength_is_selected(text_file):
    assert_array_equal(read(text_file(SMALL, "paint.astm"), wavelength=630)["I"], [0.8, 0.2, 0.6])


def test_colours_are_groups(text_file):
    text = SMALL.replace("465nm,630nm", "R,G,B").replace("\n0.5", "\n0.5").replace(",0.8\n", ",0.8,0.1\n")
    text = text.replace(",0.2\n", ",0.2,0.1\n").replace(",0.6\n", ",0.6,0.1\n")
    path = text_file(text, "paint.astm")
    assert_array_equal(read(path)["group"], ["R", "G", "B"] * 3)
    with pytest.raises(DataError, match="are of no wavelength"):
        read(path, wavelength=550)


def test_the_content_tells_the_format(text_file):
    assert read(text_file(SMALL, "paint.txt")).sizes["geometry"] == 6


def test_what_cannot_be_radians_is_degrees_and_said(text_file):
    text = SMALL.replace("0.5,0.0,0.5,3.141592653589793", "30,0,60,180").replace("0.5,", "30,")
    ds = read(text_file(text, "paint.astm"))
    assert_allclose(np.rad2deg(ds["theta_r"][0]), 60)
    assert "degrees were assumed" in ds.attrs["assumptions"][0]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("NUM_POINTS 3", "NUM_POINTS 30", "NUM_POINTS is 30, but there are 3 rows: is the file truncated"),
        (",phi_s,", ",phi,", "line 7: VARS has no column phi_s"),
        (",465nm,630nm", "", "line 7: VARS has no column of values"),
        (",465nm,630nm", ",465nm,R", "line 7: VARS mixes wavelengths and others"),
        ("0.3,0.2\n", "0.3\n", "line 10: there are 5 cells; VARS names 6"),
        ("0.3,0.2\n", "0.3,x\n", "line 10: 630nm: 'x' is not a number"),
        ("VARS", "VAR", "line 9: '0.5,0.0"),
        (SMALL[SMALL.index("VARS") :], "", "the file ends where a key of the header"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    assert old in SMALL
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new, 1), "paint.astm"), format="astm")
