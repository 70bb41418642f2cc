"""Tables in the layouts of strangers as data sets: the cases J1 to J3 and what is told of a table that is not plain."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.data.validation import check
from pbrdf.errors import DataError

CASES = {
    "J1-names-in-a-comment-line": (
        "data.csv",
        "# theta_i, theta_r, phi, brdf\n30,20,0,0.3\n30,30,0,0.5\n",
        [0.3, 0.5],
    ),
    "J2-columns-separated-by-blanks": (
        "data.dat",
        "theta_i theta_r phi brdf\n30 20 0 0.3\n30 30 0 0.5\n",
        [0.3, 0.5],
    ),
    "J3-row-of-units": ("data.csv", "theta_i,theta_r,phi,brdf\ndeg,deg,deg,1/sr\n30,20,0,0.3\n", [0.3]),
}


def has_the_values_of(case, path):
    values = CASES[case][2]
    ds = read(path)
    assert ds.attrs["quantity"] == "brdf"
    assert_array_equal(ds["I"], values)
    assert_allclose(np.rad2deg(ds["theta_i"]), 30.0)
    assert_allclose(np.rad2deg(ds["theta_r"]), [20.0, 30.0][: len(values)])


@pytest.mark.parametrize("case", CASES)
def test_layouts_of_the_cases(text_file, case):
    name, text, _ = CASES[case]
    has_the_values_of(case, text_file(text, name))


@pytest.mark.parametrize("case", CASES)
def test_cases(measured, case):
    has_the_values_of(case, measured(f"../cases/{case}/{CASES[case][0]}"))


def test_statements_among_the_remarks_count(text_file):
    ds = read(text_file("quantity: brdf\nazimuth;forward=180\n\ntheta_i;theta_r;phi;I\n30;20;180;0,3\n"))
    assert_allclose(ds["phi"], 0.0, atol=1e-12)
    assert ds["I"].values.tolist() == [0.3]
    told = [str(issue) for issue in check(ds)]
    assert any(
        "lines 1 to 2 of the file ('quantity: brdf' …) were taken as remarks" in words for words in told
    )


def test_statements_between_names_in_a_comment_and_the_rows_count(text_file):
    ds = read(text_file("# theta_i, theta_r, I\n# quantity: reflectance_factor\n30,20,0.3\n"))
    assert ds.attrs["quantity"] == "reflectance_factor"


def test_a_file_that_seems_cut_off_is_told(text_file):
    ds = read(text_file("theta_i,theta_r,brdf\n30,20,0.31231\n30,30,0.41231\n30,40,0.51231\n30,50,0.6"))
    told = [str(issue) for issue in check(ds) if issue.severity == "warning"]
    assert any("line 5: the last number, '0.6', has fewer digits" in words for words in told)
    with pytest.raises(DataError, match=r"line 3: 2 cells under 3 column names.*cut off"):
        read(text_file("theta_i,theta_r,brdf\n30,20,0.31231\n30,3"))


def test_names_that_are_not_there_are_asked_for(text_file):
    with pytest.raises(DataError, match=r"data\.csv: line 1: numbers stand here, but no line above"):
        read(text_file("30,20,0,0.3\n30,30,0,0.5\n"))


def test_bytes_of_other_encodings(tmp_path):
    text = "# title: Größe 5 µm\ntheta_i [°];theta_r [°];brdf\n30;20;0,3\n"
    for encoding in ("latin-1", "utf-16", "utf-8-sig"):
        (tmp_path / "d.csv").write_bytes(text.encode(encoding))
        ds = read(tmp_path / "d.csv")
        assert ds.attrs["title"] == "Größe 5 µm"
        assert ds["I"].values.tolist() == [0.3]


@pytest.mark.parametrize("bad", ["abc", "1_0", "٣", "1,5.2"])
def test_a_bad_cell_of_a_long_table_is_named(text_file, bad):
    rows = [f"{k % 80};20;{0.1 + k * 1e-5:.17g}" for k in range(3000)]
    rows[1234] = f"30;20;{bad}"
    with pytest.raises(DataError, match=rf"line 1236, column 'brdf': '{bad}' is not a number"):
        read(text_file("theta_i;theta_r;brdf\n" + "\n".join(rows) + "\n"))


@pytest.mark.parametrize("remark", ["# red paint, 3 May, 550 nm, lab 2", "% red paint, second, try, today"])
def test_a_remark_taken_for_names_is_said_to_be_one(tmp_path, remark):
    path = tmp_path / "bare.csv"
    path.write_text(f"{remark}\n30,30,0,0.1\n30,40,0,0.2\n")
    with pytest.raises(
        DataError, match=r"columns are red paint, .*, by the comment in line 1; if that is a remark"
    ):
        read(path)
