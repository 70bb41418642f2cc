"""What a CSV file states, and what is made of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.errors import DataError


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
