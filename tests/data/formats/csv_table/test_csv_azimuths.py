"""Where the viewer stands to the source: two azimuths, signed angles, and azimuths that must not get lost."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.errors import DataError

QUANTITY = "# quantity: brdf\n"
PAIRS = "30,0,30,180,0.90\n30,0,30,0,0.30\n30,90,30,270,0.90\n30,90,30,90,0.30\n30,200,30,20,0.90\n30,200,30,200,0.30\n"
FORWARD = [0.0, 180.0, 0.0, 180.0, 0.0, 180.0]


@pytest.mark.parametrize(
    ("names", "options"),
    [
        ("theta_i,phi_i,theta_r,phi_r,I", {}),
        ("theta_in,phi_in,theta_out,phi_out,I", {}),
        ("sza,saa,vza,vaa,I", {}),
        ("theta_i,source azimuth,theta_r,view azimuth,I", {}),
        ("theta_i,azimuth_i (deg),theta_r,azimuth_o (deg),I", {}),
        ("theta_i,a,theta_r,b,I", {"column": {"phi_i": "a", "phi_r": "b"}}),
        ("theta_i,phi_i,theta_r,phi_r,I", {"azimuth": "forward=180"}),
    ],
)
def test_two_azimuths_are_forward_where_they_differ_by_half_a_turn(text_file, names, options):
    """The case C2."""
    ds = read(text_file(f"{QUANTITY}{names}\n{PAIRS}"), **options)
    assert_array_equal(np.rad2deg(ds["phi"]), FORWARD)
    assumed = [i for i in map(str, check(ds)) if "two azimuths" in i]
    assert len(assumed) == (0 if "azimuth" in options else 1)


def test_two_azimuths_of_the_paths_of_the_light(text_file):
    """Counted along the light, the mirror direction has the same azimuth as the source."""
    ds = read(
        text_file(f"{QUANTITY}theta_i,phi_i,theta_r,phi_r,I\n30,10,30,10,1\n30,10,30,190,1\n"),
        azimuth="forward=0",
    )
    assert_allclose(np.rad2deg(ds["phi"]), [0.0, 180.0], atol=1e-12)


def test_two_azimuths_in_two_units_and_signed_zenith_angles(text_file):
    """A source at −30°, azimuth 180°, is one at 30°, azimuth 0°."""
    ds = read(text_file(
        f"{QUANTITY}theta_i,phi_i (deg),theta_r,phi_r (rad),I\n-30,180,30,{np.pi!r},1\n30,0,-30,{np.pi!r},1\n"
    ))  # fmt: skip
    assert_allclose(np.rad2deg(ds["theta_i"]), [30, 30])
    assert_allclose(np.cos(ds["phi"]), [1.0, -1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("names", "options"),
    [
        ("theta_i,phi_i,theta_r,phi_r,I", {"column": {"phi": "phi_r"}, "azimuth": "forward=180"}),
        ("theta_i,phi_i,theta_r,phi,I", {}),
    ],
)
def test_an_azimuth_of_the_source_that_varies_does_not_get_lost(text_file, names, options):
    path = text_file(f"{QUANTITY}{names}\n{PAIRS}")
    with pytest.raises(
        DataError, match="the azimuth 'phi_i' is not constant and would not be used beside phi"
    ):
        read(path, **options)
    assert read(path, **options, ignore=["phi_i"]).sizes["geometry"] == 6


def test_a_constant_azimuth_of_the_source_is_named_unless_it_is_0(text_file):
    zero = read(
        text_file(
            f"{QUANTITY}# azimuth: forward=0\ntheta_i,phi_i,theta_r,phi,I\n30,0,30,0,1\n30,0.0,40,0,1\n"
        )
    )
    assert check(zero) == []
    other = read(text_file(f"{QUANTITY}# azimuth: forward=0\ntheta_i,phi_i,theta_r,phi,I\n30,90,30,0,1\n"))
    assert "the azimuth 'phi_i' is 90 everywhere and is not used" in str(check(other)[0])


def test_a_relative_azimuth_by_its_name_goes_before_both(text_file):
    ds = read(
        text_file(
            f"{QUANTITY}# azimuth: forward=0\nsza,saa,vza,vaa,raa,I\n30,10,30,55,45,1\n30,20,30,80,60,1\n"
        )
    )
    assert_allclose(np.rad2deg(ds["phi"]), [45, 60])


@pytest.mark.parametrize(
    "names", ["theta_i,phi_i,theta_r,I", "theta_i,phi_r,theta_r,I", "theta_i,azimuth,theta_r,I"]
)
def test_one_azimuth_alone_is_asked_about(text_file, names):
    with pytest.raises(DataError, match="looks like an azimuth"):
        read(text_file(f"{QUANTITY}{names}\n30,10,30,1\n"))


def test_the_side_of_the_viewer_that_s_stands_for(text_file):
    """Scattered beside an incident angle, sun beside a viewing angle."""
    ds = read(text_file(f"{QUANTITY}thetai,thetas,raa,I\n30,40,0,1\n"))
    assert_allclose(np.rad2deg([ds["theta_i"][0], ds["theta_r"][0]]), [30, 40])
    ds = read(text_file(f"{QUANTITY}thetas,thetav,raa,I\n30,40,0,1\n"))
    assert_allclose(np.rad2deg([ds["theta_i"][0], ds["theta_r"][0]]), [30, 40])


SCAN = "theta_i,theta_r,I\n60,-75,0.9\n60,-60,0.5\n60,0,0.1\n60,75,0.07\n"


def test_the_azimuth_option_counts_in_the_plane_of_incidence(text_file):
    """The case D1: with forward at 180° the specular side is that of negative viewing angles."""
    path = text_file(QUANTITY + SCAN)
    assert_array_equal(np.rad2deg(read(path)["phi"]), [180, 180, 0, 0])
    turned = read(path, azimuth="forward=180")
    assert_array_equal(np.rad2deg(turned["phi"]), [0, 0, 0, 180])
    assert_allclose(np.rad2deg(turned["theta_r"]), [75, 60, 0, 75])
    assert check(turned) == []
    in_file = read(text_file(f"{QUANTITY}# azimuth: forward=180\n{SCAN}"))
    assert_array_equal(in_file["phi"], turned["phi"])


def test_signed_angles_of_both_with_a_stated_side(text_file):
    path = text_file(f"{QUANTITY}theta_i,theta_r,I\n-30,30,1\n30,-30,2\n30,30,3\n-30,-30,4\n")
    with pytest.raises(
        DataError, match=r"line 3, column 'theta_i': a negative theta_i .*azimuth='forward=180'"
    ):
        read(path)
    assert_array_equal(np.rad2deg(read(path, azimuth="forward=180")["phi"]), [0, 0, 180, 180])
    assert_array_equal(np.rad2deg(read(path, azimuth="forward=0")["phi"]), [180, 180, 0, 0])
    assert_allclose(np.rad2deg(read(path, azimuth="forward=0")["theta_i"]), [30] * 4)


def test_an_assumed_azimuth_is_a_warning(text_file):
    """The case E1, as far as reading goes."""
    ds = read(text_file(f"{QUANTITY}theta_i,theta_r,raa,I\n30,30,180,0.48\n"))
    assert "does not say where phi = 0 lies" in str(check(ds)[0])
