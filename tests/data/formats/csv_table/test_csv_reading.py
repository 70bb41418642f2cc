"""Rows and cells of CSV files: the plane of incidence, what is missing, what is wrong, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.errors import DataError


def test_signed_viewing_angles_mean_the_plane_of_incidence(text_file):
    """Without an azimuth: θ_r ≥ 0 on the specular side, φ = 0; θ_r < 0 on the source's side, φ = π."""
    ds = read(text_file("theta_i,theta_r,brdf\n30,40,1\n30,-40,2\n30,0,3\n"))
    assert_array_equal(ds["theta_r"], np.deg2rad([40.0, 40.0, 0.0]))
    assert_array_equal(ds["phi"], [0.0, np.pi, 0.0])
    assert "theta_r < 0 as backward" in ds.attrs["assumptions"][0]


def test_a_negative_viewing_angle_with_azimuth_is_the_opposite_direction(text_file):
    ds = read(text_file("theta_i,theta_r,phi,brdf\n30,-40,0,1\n30,-40,90,2\n"))
    assert_array_equal(ds["theta_r"], np.deg2rad([40.0, 40.0]))
    assert_allclose(ds["phi"], [np.pi, -np.pi / 2])


def test_a_negative_incidence_angle_in_plane_is_refused(text_file):
    with pytest.raises(DataError, match="line 3, column 'theta_i': a negative theta_i without an azimuth"):
        read(text_file("theta_i,theta_r,brdf\n30,40,1\n-30,40,1\n"))


def test_missing_cells_are_nan(text_file):
    ds = read(text_file("theta_i,theta_r,brdf,Q,U,V\n30,30,1,,nan,NA\n"))
    assert all(np.isnan(ds[name][0]) for name in "QUV")


def test_decimal_commas_are_read_between_semicolons(text_file):
    ds = read(text_file("theta_i;theta_r;brdf\n30,5;40;1,5e-2\n"))
    assert_allclose([np.rad2deg(ds["theta_i"][0]), ds["I"][0]], [30.5, 0.015])


def test_quoted_cells_may_span_lines_without_losing_count(text_file):
    text = 'note,theta_i,theta_r,brdf\n"two\nlines",30,30,1\n\n"b, c",30,30,x\n'
    with pytest.raises(DataError, match="line 5, column 'brdf': 'x' is not a number"):
        read(text_file(text))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("30,30,1\n30,30,abc\n", "line 3, column 'brdf': 'abc' is not a number"),
        ("30,30\n", "line 2: 2 cells under 3 column names"),
        ("30,30,1,5\n", "line 2: 4 cells under 3.*decimal commas"),
        ("", "no rows"),
        ("30,30,1\n\n95,30,1\n", r"theta_i \(column 'theta_i'\), line 4: .*\(95°\)"),
        ("30,30,inf\n", r"I \(column 'brdf'\), line 2: infinite"),
    ],
)
def test_cells_that_are_not_understood_are_named(text_file, rows, words):
    with pytest.raises(DataError, match=rf"data\.csv(.|\n)*{words}"):
        read(text_file("theta_i,theta_r,brdf\n" + rows))


def test_an_empty_file_is_refused(text_file):
    with pytest.raises(DataError, match="no line of column names"):
        read(text_file("# quantity: brdf\n"))


def test_windows_line_ends_and_byte_order_mark(text_file):
    assert read(text_file("\ufefftheta_i,theta_r,brdf\r\n30,30,1\r\n")).sizes["geometry"] == 1


MIXED = "material,theta_i,theta_r,brdf\nwhite,90,30,nan\nblack,30,30,1\nwhite,30,30,2\nwhite,30,40,nan\n"


def test_rows_are_selected_by_text(text_file):
    path = text_file(MIXED)
    assert_array_equal(read(path, where={"material": "black"})["I"], [1.0])
    with pytest.raises(
        DataError, match="no row has 'red' in the column 'material'; there are 'black', 'white'"
    ):
        read(path, where={"material": "red"})


def test_invalid_rows_are_refused_or_skipped_and_counted(text_file):
    path = text_file(MIXED)
    with pytest.raises(DataError, match="line 2"):
        read(path)
    ds = read(path, skip_invalid=True)
    assert_array_equal(ds["I"], [1.0, 2.0])
    assert ds.attrs["skipped_rows"] == 2
    assert "skipped_rows" not in read(path, where={"material": "black"}, skip_invalid=True).attrs


def test_skipping_does_not_excuse_other_errors(text_file):
    with pytest.raises(DataError, match="no rows"):
        read(text_file("theta_i,theta_r,brdf\n95,30,1\n"), skip_invalid=True)


@pytest.mark.parametrize("material", ["reference_paint_rough", "reference_paint_smooth"])
def test_a_strangers_table_of_paints(measured, material):
    path = measured("mwir-paint/mwir_brdf_inplane.csv")
    with pytest.raises(DataError, match=r"theta_i \(column 'theta_i_deg'\), lines .*\(90°\)"):
        read(path, where={"material": material})
    ds = read(
        path,
        column={"I": "f_r_per_sr", "theta_r": "theta_o_deg", "phi": "=0"},
        where={"material": material},
        skip_invalid=True,
    )
    assert ds.sizes["geometry"] == 890
    assert ds.attrs["skipped_rows"] == 10
    assert check(ds) == []
    # Source and camera on opposite sides: the peak at θ_r = 30° lies in the mirror direction.
    at_30 = ds.isel(geometry=np.isclose(ds["theta_r"], np.deg2rad(30)))
    peak = at_30.isel(geometry=int(np.argmax(at_30["I"].values)))
    assert abs(float(peak["theta_i"]) - np.deg2rad(30)) < np.deg2rad(3)
