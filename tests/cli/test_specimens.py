"""What stands for measurements of a material on the command line."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.cli.specimens import BUNDLED, Measurement, open_library, open_pixels
from pbrdf.errors import DataError


@pytest.fixture
def cube(tmp_path):
    """Stokes parameters at three geometries of two by two pixels, angles in degrees."""
    values = np.full((3, 2, 2), 0.2)
    made = xr.Dataset(
        {"I": (("geometry", "y", "x"), values)},
        coords={n: ("geometry", [10.0, 20.0, 30.0], {"units": "degree"}) for n in ("theta_i", "theta_r")}
        | {"phi": ("geometry", [0.0, 1.0, 2.0], {"units": "rad"})},
        attrs={"quantity": "brdf"},
    )
    made.to_netcdf(tmp_path / "cube.nc", engine="h5netcdf")
    made.to_zarr(tmp_path / "cube.zarr", zarr_format=3)
    return tmp_path


@pytest.mark.parametrize("name", ["cube.nc", "cube.zarr"])
@pytest.mark.filterwarnings("ignore:Consolidated metadata")
def test_angles_of_pixels_are_turned_to_radians(cube, name):
    opened = open_pixels(str(cube / name))
    assert opened["theta_i"].values == pytest.approx(np.deg2rad([10.0, 20.0, 30.0]))
    assert opened["phi"].values.tolist() == [0.0, 1.0, 2.0]
    opened.close()


def test_what_has_no_pixels_is_no_map(tmp_path):
    pbrdf.write(pbrdf.open_experiment("white"), tmp_path / "white.nc")
    assert open_pixels(str(tmp_path / "white.nc")) is None
    assert open_pixels("white") is None
    assert open_pixels(str(tmp_path)) is None
    (tmp_path / "torn.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(DataError, match=r"torn\.nc"):
        open_pixels(str(tmp_path / "torn.nc"))


def test_origin_names_file_and_title():
    data = pbrdf.open_experiment("white")
    assert Measurement("a/b.csv", data.assign_attrs(title="two\n lines")).origin == "b.csv: two lines"
    assert Measurement("a/b.csv", data.assign_attrs(title="")).origin == "b.csv"


def test_without_a_file_the_library_is_the_bundled_one():
    assert open_library(None).names == list(pbrdf.PAINTS)
    assert "bundled" in BUNDLED
