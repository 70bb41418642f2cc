from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.errors import DataError

SMALL = """# A paint
#  with gloss
2 # wavelengths

500
600
# theta i, phi i, theta s, phi_s, values
0.5 0.0 0.5 3.141592653589793 1.0 2.0
0.5 0.25 0.3 0.25
3.0 4.0
"""


def test_numbers_follow_one_another_however_the_lines_break(text_file):
    ds = read(text_file(SMALL, "paint.brdf"))
    assert_array_equal(ds["I"], [1.0, 2.0, 3.0, 4.0])
    assert_array_equal(ds["wavelength"], [500.0, 600.0, 500.0, 600.0])
    assert_array_equal(ds["theta_r"], [0.5, 0.5, 0.3, 0.3])
    assert_array_equal(ds["group"], [29, 29, 29, 29])
    assert ds.attrs["title"] == "A paint; with gloss"
    assert ds.attrs["quantity"] == "brdf"


def test_the_heading_of_the_first_number_is_no_title(text_file):
    bare = "# num wls\n" + SMALL.replace("# wavelengths", "").removeprefix("# A paint\n#  with gloss\n")
    assert read(text_file(bare, "paint.brdf")).attrs.get("title", "") == ""
    assert read(text_file("# A paint\n" + bare, "other.brdf")).attrs["title"] == "A paint"


def test_forward_moves_from_pi_to_zero(text_file):
    """phi_s − phi_i = π is opposite the source, our 0; equal azimuths are backscatter, our π."""
    ds = read(text_file(SMALL, "paint.brdf"), wavelength=600)
    assert_array_equal(ds["phi"], [0.0, np.pi])
    assert_array_equal(ds["I"], [2.0, 4.0])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("3.0 4.0", "3.0 x", r"paint\.brdf: line 10: 'x' is not a number"),
        ("3.0 4.0", "3.0", "line 9: the last row has 5 numbers; four angles and 2 values"),
        ("0.5 0.25 0.3", "1.6 0.25 0.3", "theta_i, line 9: 1.6 rad"),
        ("2 # wave", "2.5 # wave", "number of wavelengths"),
        (SMALL, "", "number of wavelengths"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new), "paint.brdf"))


@pytest.mark.slow
def test_krylon_has_its_gloss_peak_in_the_forward_direction(measured):
    ds = read(measured("krylon/krylon_blue.brdf"), wavelength=[460, 550])
    assert ds.sizes["geometry"] == 2 * 1439
    assert not [issue for issue in check(ds) if issue.severity == "error"]
    blue = ds.isel(geometry=(ds["wavelength"] == 460).values)
    for group in np.unique(blue["group"]):
        rows = blue.isel(geometry=(blue["group"] == group).values)
        peak = rows.isel(geometry=int(np.argmax(rows["I"].values)))
        assert_allclose(peak["phi"], 0, atol=1e-5)
        # A rough gloss peak lies at the mirror direction or beyond it.
        assert float(peak["theta_r"]) >= float(peak["theta_i"]) - np.deg2rad(6)


def test_krylon_is_brighter_in_blue(measured):
    ds = read(measured("krylon/krylon_blue.brdf"), wavelength=[460, 550])
    at = {nm: ds["I"].values[(ds["wavelength"] == nm).values] for nm in (460, 550)}
    assert np.median(at[460]) > 2 * np.median(at[550])
