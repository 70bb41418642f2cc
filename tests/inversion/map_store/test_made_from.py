"""What a map was made from: told by its attributes, found again wherever the folder was moved to."""

import json
import shutil

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.inversion.map_store.made_from import MadeFrom
from pixel_helpers import blank


def pictures(path):
    blank(4, 5).to_netcdf(path, engine="h5netcdf")


def test_files_are_found_relative_to_the_map(tmp_path):
    (tmp_path / "run" / "maps").mkdir(parents=True)
    pictures(tmp_path / "run" / "stokes.nc")
    told = MadeFrom.relative_to(
        tmp_path / "run" / "maps",
        [tmp_path / "run" / "stokes.nc"],
        ["flat:theta_i=30,theta_r=40,phi=0,reference=0"],
        2.0,
    )
    assert told.files == ("../stokes.nc",)
    again = MadeFrom.of({"other": 1, **told.attribute})
    assert again == told
    shutil.move(tmp_path / "run", tmp_path / "elsewhere")
    source = again.open(tmp_path / "elsewhere" / "maps")
    assert source.sizes == {"y": 4, "x": 5} and source.scale == 2.0
    pixel = source.block({"y": slice(1, 2), "x": slice(2, 3)})
    np.testing.assert_allclose(np.rad2deg(pixel["theta_r"]), 40.0)
    with pytest.raises(DataError, match=r"stokes\.nc: there is no such file"):
        again.open(tmp_path / "run" / "maps")


@pytest.mark.parametrize(
    "told", [None, "", "[]", "{", json.dumps({"files": 3}), json.dumps({"files": ["x"], "geometry": []})]
)
def test_what_says_nothing_is_nothing(told):
    assert MadeFrom.of({} if told is None else {"made_from": told}) is None


def test_a_map_that_names_no_file(tmp_path):
    with pytest.raises(DataError, match="names no file"):
        MadeFrom(()).open(tmp_path)
