"""The side in words: V and L point away from the surface, so azimuths that differ by π are the specular half-plane."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError
from pbrdf.optics.half_difference import half_difference

SMALL = """# A made file
#DIM 3 1
#PARAM_IN  ISOTROPIC_TV_TL_DPHI
#PARAM_OUT INV_STERADIAN
0.2\t0.5\t3.141592653589793\t0.9
0.3\t0.5\t0\t0.4
"""

#: The same two directions in every parametrisation: light at 0.5, view at 0.3, azimuth between them 2.0.
LIGHT, VIEW, AZIMUTH = 0.5, 0.3, 2.0


def vector(theta, phi):
    return np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)


def half():
    """Rusinkiewicz's angles with the view vector first, as ALTA has them."""
    return half_difference(VIEW, LIGHT, AZIMUTH - np.pi)


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("ISOTROPIC_TV_TL_DPHI", (VIEW, LIGHT, AZIMUTH)),
        ("ISOTROPIC_TL_TV_PROJ_DPHI", (LIGHT, VIEW * np.cos(AZIMUTH), VIEW * np.sin(AZIMUTH))),
        ("SPHERICAL_TL_PL_TV_PV", (LIGHT, 0.7, VIEW, 0.7 + AZIMUTH)),
        ("CARTESIAN", (*vector(VIEW, 1.0 + AZIMUTH), *vector(LIGHT, 1.0))),
        ("RUSIN_TH_TD_PD", half()),
        ("RUSIN_TH_PH_TD_PD", (half()[0], 0.4, *half()[1:])),
    ],
)
def test_parametrisations_mean_the_same_directions(text_file, name, numbers):
    row = " ".join(f"{float(x):.17g}" for x in numbers)
    text = f"#DIM {len(numbers)} 1\n#PARAM_IN {name}\n#PARAM_OUT INV_STERADIAN\n{row} 0.25\n"
    ds = read(text_file(text, "a.dat"))
    assert_allclose(ds["theta_i"], LIGHT)
    assert_allclose(ds["theta_r"], VIEW)
    assert_allclose(np.abs(ds["phi"]), np.pi - AZIMUTH)
    assert_array_equal(ds["I"], [0.25])


def test_forward_moves_from_pi_to_zero(text_file):
    ds = read(text_file(SMALL, "paint.alta"))
    assert_allclose(ds["phi"], [0.0, np.pi], atol=1e-12)
    assert_allclose(ds["theta_r"], [0.2, 0.3])
    assert_array_equal(ds["I"], [0.9, 0.4])
    assert ds.attrs["quantity"] == "brdf"
    assert "assumptions" not in ds.attrs


def test_two_angles_are_planes_of_their_own(text_file):
    """RUSIN_TH_TD lies across the plane of incidence, COS_TH_TD in it, a projected view under normal light."""
    across = read(text_file("#DIM 2 1\n#PARAM_IN RUSIN_TH_TD\n0.2 0.3 1\n", "a.alta"))
    assert_allclose(across["theta_i"], across["theta_r"])
    along = read(text_file("#DIM 2 1\n#PARAM_IN COS_TH_TD\n0.98 0.9 1\n", "b.alta"))
    assert_allclose(np.abs(np.sin(along["phi"])), 0.0, atol=1e-12)
    assert_allclose(along["theta_r"] - along["theta_i"], 2 * np.arccos(0.98))
    normal = read(text_file("#DIM 2 1\n#PARAM_IN ISOTROPIC_TV_PROJ_DPHI\n0.3 0.4 1\n", "c.alta"))
    assert_allclose([normal["theta_i"][0], normal["theta_r"][0]], [0.0, 0.5])


def test_values_may_be_colours_or_weighted(text_file):
    text = (
        SMALL.replace("3 1", "3 3")
        .replace("INV_STERADIAN", "RGB_COLOR")
        .replace("0.9", "1 2 3")
        .replace("0\t0.4", "0 4 5 6")
    )
    ds = read(text_file(text, "a.dat"))
    assert_array_equal(ds["I"], [1, 2, 3, 4, 5, 6])
    assert_array_equal(ds["group"], ["red", "green", "blue"] * 2)
    weighted = read(text_file(SMALL.replace("INV_STERADIAN", "INV_STERADIAN_COSINE_FACTOR"), "b.dat"))
    assert_allclose(weighted["I"], [0.9 / np.cos(0.2), 0.4 / np.cos(0.3)])
    unsaid = read(text_file(SMALL.replace("#PARAM_OUT INV_STERADIAN\n", ""), "c.dat"))
    assert unsaid.attrs["assumptions"] == [
        "the file does not say what its values are; BRDF in 1/sr was assumed"
    ]


def test_intervals_are_passed_over(text_file):
    text = SMALL.replace("#PARAM_IN", "#VS 2\n#PARAM_IN").replace("\t0.9", "\t0.9\t0.8\t1.0")
    assert_array_equal(read(text_file(text, "a.dat"))["I"], [0.9, 0.4])


def test_a_binary_file_holds_the_same(text_file, tmp_path):
    header = SMALL[: SMALL.index("0.2\t")] + (
        "#FORMAT binary\n#VERSION 0\n#PRECISION ieee754-double\n#SAMPLE_COUNT 2\n#VS 0\n#ENDIAN little\n#BEGIN_STREAM\n"
    )
    body = np.array([[0.2, 0.5, np.pi, 0.9], [0.3, 0.5, 0, 0.4]], "<f8").tobytes()
    path = tmp_path / "paint.alta"
    path.write_bytes(header.encode() + body + b"\n#END_STREAM\n")
    a, b = read(path), read(text_file(SMALL, "text.alta"))
    for name in ("theta_i", "theta_r", "phi", "I"):
        assert_array_equal(a[name], b[name])
    path.write_bytes(header.replace("COUNT 2", "COUNT 99999999999").encode() + body)
    with pytest.raises(DataError, match=r"99999999999 samples are .* it is truncated"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ISOTROPIC_TV_TL_DPHI", "COS_TH", "PARAM_IN COS_TH does not tell both directions"),
        ("ISOTROPIC_TV_TL_DPHI", "STARK_3D", "PARAM_IN STARK_3D does not tell"),
        ("ISOTROPIC_TV_TL_DPHI", "CARTESIAN", "DIM states 3 coordinates, but PARAM_IN CARTESIAN has 6"),
        ("INV_STERADIAN", "ENERGY", "PARAM_OUT ENERGY is not a BRDF"),
        ("INV_STERADIAN", "RGB_COLOR", "DIM states 1 values, but PARAM_OUT RGB_COLOR has 3"),
        ("\t0.4", "", "line 6: there are 3 numbers; 3 coordinates and 1 values"),
        ("\t0.4", "\tx", "line 6: .*'x' is not a number"),
        ("#DIM 3 1", "#DIM 3", "no '#DIM n m'"),
        ("#DIM 3 1", f"#DIM 3 {'1' * 5000}", "no '#DIM n m'"),
        ("#DIM 3 1", "#DIM 3 ١", "no '#DIM n m'"),
        (SMALL[SMALL.index("0.2\t") :], "", "there are no rows"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    assert old in SMALL
    with pytest.raises(DataError, match=words):
        read(text_file(SMALL.replace(old, new, 1), "paint.alta"), format="alta")
