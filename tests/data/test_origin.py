"""Lines and columns of a file, as they travel with a data set."""

from __future__ import annotations

import pickle

import numpy as np

from pbrdf.data import check, read, write
from pbrdf.data.origin import of_rows, origin_of

TEXT = "# azimuth: forward=0\n# quantity: brdf\ntheta_i,theta_r,phi,I,error\n"
TEXT += "30,20,0,0.3,1\n30,30,0,0,1\n30,40,0,0.2,1\n"


def test_warnings_name_the_line_of_the_file(text_file):
    """The case K3."""
    words = [str(issue) for issue in check(read(text_file(TEXT)))]
    assert any(
        w.startswith("I (column 'I'), line 5: I = 0 is not positive, and a fit uses it") for w in words
    )


def test_rows_that_were_chosen_keep_their_lines(text_file):
    ds = read(text_file(TEXT))
    keep = np.array([False, True, True])
    assert origin_of(of_rows(ds, keep, ds.isel(geometry=keep))).lines == (5, 6)
    assert origin_of(of_rows(ds, [2, 0], ds.isel(geometry=[2, 0]))).lines == (6, 4)


def test_rows_that_were_moved_have_no_lines_but_what_was_left_out_is_known(text_file):
    ds = read(text_file(TEXT))
    for moved in (ds.isel(geometry=[2, 1, 0]), ds.isel(geometry=[0, 1])):
        words = [str(issue) for issue in check(moved)]
        assert any("index 1: I = 0" in w for w in words)
        assert not any("line " in w for w in words)


def test_nothing_of_it_is_in_the_data_or_written(text_file, tmp_path):
    ds = read(text_file(TEXT))
    assert set(ds.attrs) == {"quantity", "stokes_convention", "illumination", "simulated", "ignored_columns"}
    for name in ("again.nc", "again.csv"):
        write(ds, tmp_path / name)
    assert origin_of(read(tmp_path / "again.nc")) is None
    again = pickle.loads(pickle.dumps(ds))
    assert again.identical(ds)
    assert origin_of(again).lines == (4, 5, 6)


def test_skipped_rows_do_not_shift_lines(text_file):
    text = TEXT.replace("30,20,0,0.3,1", "95,20,0,0.3,1")
    assert origin_of(read(text_file(text), skip_invalid=True)).lines == (5, 6)
