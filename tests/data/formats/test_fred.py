"""The side in words: equal azimuths are the specular half-plane; in the plane, positive polar angles are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError

SMALL = """type bsdf_data
format angles=deg bsdf=value scale=1
10 0
0\t0\t0.031
-10 0 0.036
30 90 0.030
50 20
50 20 0.090
50 200 0.060
"""


def test_forward_is_where_the_azimuths_are_equal(text_file):
    ds = read(text_file(SMALL, "paint.txt"))
    assert ds.sizes["geometry"] == 5
    assert_allclose(np.rad2deg(ds["theta_i"]), [10, 10, 10, 50, 50])
    assert_allclose(np.rad2deg(ds["theta_r"]), [0, 10, 30, 50, 50])
    assert_allclose(np.rad2deg(ds["phi"]), [0, 180, 90, 0, 180])
    assert_array_equal(ds["I"], [0.031, 0.036, 0.030, 0.090, 0.060])
    assert_array_equal(ds["group"], [10, 10, 10, 50, 50])


def test_the_format_line_states_unit_and_scale(text_file):
    text = SMALL.replace("angles=deg", "angles=rad").replace("scale=1", "scale=2")
    ds = read(
        text_file(
            text.replace("50 20", "0.5 0.2")
            .replace("10 0\n", "0.1 0\n")
            .replace("30 90", "0.3 1.5")
            .replace("-10 0", "-0.1 0")
            .replace("50 200", "0.5 0.2"),
            "paint.fred",
        )
    )
    assert_allclose(ds["theta_i"][-1], 0.5)
    assert_allclose(ds["I"][-1], 0.12)


def test_comments_blanks_and_commas_do_not_matter(text_file):
    plain = read(text_file(SMALL, "paint.fred"))
    dressed = (
        "// by hand\n! and for a friend\n\n"
        + SMALL.replace("=", " = ").replace("30 90 0.030", "  30 ,\t90, 0.030 ").upper()
    )
    other = read(text_file(dressed, "other.txt"))
    for name in ("theta_i", "theta_r", "phi", "I"):
        assert_array_equal(other[name], plain[name])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("angles=deg", "angles=dircos", "line 2: angles=dircos is not understood"),
        ("bsdf=value", "bsdf=log", "line 2: bsdf=log"),
        ("scale=1", "scale=0", "line 2: scale=0"),
        ("scale=1", "units=1", "line 2: 'units=1' is not understood"),
        ("30 90 0.030", "30 90 x", "line 6: .*'x' is not a number"),
        ("30 90 0.030", "30", "line 6: there are 1 numbers"),
        ("10 0\n0\t0", "0\t0", "line 3: a row of three stands before"),
        ("30 90 0.030", "120 90 0.030", "theta_r, line 6"),
        (SMALL[SMALL.index("10 0") :], "", "there are no rows"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    assert old in SMALL
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new, 1), "paint.txt"))


def test_one_paint_in_two_formats_leans_to_the_same_side(measured):
    """FRED's signed angles and Zemax's azimuths about the specular ray: the lobe beyond the mirror angle."""
    fred = read(measured("strangers/aeroglaze_bsdf_final.txt"))
    zemax = read(measured("strangers/aeroglaze.bsdf"))
    assert fred.sizes["geometry"] == 4 * 161
    for theta_i in (10, 30, 50, 70):
        curves = []
        for ds in (fred, zemax):
            one = ds.isel(geometry=(ds["group"] == theta_i).values)
            signed = np.rad2deg(one["theta_r"]) * np.where(np.abs(one["phi"]) < 1, 1, -1)
            order = np.argsort(signed.values)
            _, first = np.unique(np.round(signed.values[order]), return_index=True)
            curves.append((np.round(signed.values[order])[first], one["I"].values[order][first]))
        common = np.intersect1d(curves[0][0], curves[1][0])
        assert len(common) > 140
        a, b = (np.log(values[np.isin(angle, common)]) for angle, values in curves)
        if theta_i >= 50:
            assert np.corrcoef(a, b)[0, 1] > 0.95
            assert np.corrcoef(a, b[::-1])[0, 1] < 0.5
