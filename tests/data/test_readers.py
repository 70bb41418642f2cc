from __future__ import annotations

import pytest
from numpy.testing import assert_array_equal

from pbrdf.data import make_dataset, read, write
from pbrdf.errors import DataError

TABLE = "theta_i,theta_r,brdf\n30,30,0.5\n"


@pytest.fixture
def ds():
    return make_dataset(0.5, 0.25, 0.0, quantity="brdf", I=1.0)


@pytest.mark.parametrize("name", ["data.csv", "data.nc"])
def test_the_extension_chooses_the_format(tmp_path, ds, name):
    write(ds, tmp_path / name)
    assert read(tmp_path / name).identical(ds)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_existing_file_is_replaced(tmp_path, ds):
    (tmp_path / "data.csv").write_text("old")
    write(ds, str(tmp_path / "data.csv"))
    assert read(str(tmp_path / "data.csv")).identical(ds)


def test_the_format_can_be_stated(text_file):
    assert_array_equal(read(text_file(TABLE, "data.asc"), format="csv")["I"], [0.5])


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        (
            "data.csv",
            {"format": "xml"},
            "'xml' is not known; use one of csv, netcdf, zarr, scatmech, cornell",
        ),
        ("data.xyz", {}, r"extension '\.xyz' is not known"),
        ("data.csv", {"were": {}}, "no option 'were'; its options are column, where, skip_invalid"),
        ("data.brdf", {"column": {}}, "no option 'column'; its options are wavelength"),
        ("data.nc", {"wavelength": 5}, "it has no options"),
    ],
)
def test_what_is_not_known_is_answered_with_the_choices(text_file, name, options, words):
    with pytest.raises(DataError, match=words):
        read(text_file(TABLE, name), **options)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match=r"no\.csv: there is no such file"):
        read(tmp_path / "no.csv")


def test_only_formats_that_keep_everything_are_written(tmp_path, ds):
    with pytest.raises(DataError, match=r"'\.brdf' cannot be written; use \.csv or \.nc or \.zarr"):
        write(ds, tmp_path / "data.brdf")
