"""The side in words: the light comes from azimuth 90°, so 270° is the specular half-plane."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError

SMALL = """# made
Symmetry Asymmetric
SpectralContent Monochrome
ScatterAzimuth 2
90 270
ScatterRadial 3
0 30 90
DataBegin
AOI 30
POI 0
Side Front
Wavelength 550
ScatterType BRDF
TIS 0.3
0.1 0.2 0.0
0.1 0.9 0.0
AOI 30
POI 0
Side Front
Wavelength 550
ScatterType BTDF
TIS 0.3
7 7 7
7 7 7
DataEnd
"""


def test_forward_is_opposite_the_incident_azimuth(text_file):
    ds = read(text_file(SMALL, "paint.bsdf"))
    assert_allclose(np.rad2deg(ds["theta_r"]), [0, 30, 0, 30])
    assert_allclose(np.abs(ds["phi"][[1, 3]]), [np.pi, 0.0], atol=1e-12)
    assert_array_equal(ds["I"], [0.1, 0.2, 0.1, 0.9])
    assert_array_equal(np.unique(ds["wavelength"]), [550])
    assert_array_equal(np.unique(ds["group"]), [30])
    said = ds.attrs["assumptions"]
    assert said[0] == "tables of the back side or of transmission were left out: 1"
    assert "azimuth 270 was taken as the forward half-plane" in said[1]


def test_the_azimuth_can_be_stated(text_file):
    ds = read(text_file(SMALL, "paint.bsdf"), azimuth="forward=0")
    assert_allclose(np.abs(ds["phi"][[1, 3]]), [0.0, np.pi], atol=1e-12)
    assert not [said for said in ds.attrs["assumptions"] if "phi" in said]


def test_tristimulus_values_are_groups(text_file):
    block = SMALL[
        SMALL.index("AOI") : SMALL.index("AOI 30\nPOI 0\nSide Front\nWavelength 550\nScatterType BT")
    ]
    text = SMALL[: SMALL.index("AOI")].replace("Monochrome", "XYZ")
    text += "".join(block.replace("TIS", f"TristimulusValue Tris{axis}\nTIS") for axis in "XYZ") + "DataEnd\n"
    ds = read(text_file(text, "xyz.txt"))
    assert_array_equal(ds["group"], np.repeat(["X", "Y", "Z"], 4))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Asymmetric", "Axisymmetric", "line 2: Symmetry is 'Axisymmetric'"),
        ("ScatterRadial 3", "ScatterRadial 4", "ScatterRadial"),
        ("ScatterType BRDF", "ScatterType BTDF", "there is no reflection"),
        ("AOI 30\nPOI 0", "POI 0", "line 13: the table has no AOI"),
        ("0.1 0.2 0.0", "0.1 x 0.0", "line 15: a row of BSDF values: 'x' is not a number"),
        ("0.1 0.9 0.0\n", "0.1 0.9 0.0\n1 2 3\n", "line 17: '1' is not a key of a table"),
        ("7 7 7\nDataEnd\n", "", "the file ends where a row of BSDF values"),
        ("DataEnd\n", "", "DataEnd is missing: is the file truncated"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    assert old in SMALL
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new, 1), "paint.bsdf"), format="lighttools")
