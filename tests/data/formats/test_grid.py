"""Data over a grid of directions: arrays for xarray, the same list of geometries when read."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_array_equal

import pbrdf
from pbrdf.data.formats.grid import to_grid, write_grid
from pbrdf.errors import DataError


def grid(**more):
    theta_i, theta_r, phi = (
        np.deg2rad(a.ravel()) for a in np.meshgrid([60, 20], [0, 30, 60], [0, 90, 180, 270], indexing="ij")
    )
    M = np.asarray(pbrdf.load_paint("white").mueller(theta_i, theta_r, phi))
    columns = {"mueller": M, "std": {"mueller": 0.01}} if more.pop("mueller", False) else {"I": M[:, 0, 0]}
    return pbrdf.make_dataset(theta_i, theta_r, phi, quantity="brdf", wavelength=550.0, **columns, **more)


@pytest.mark.parametrize("mueller", [False, True])
def test_a_grid_is_written_with_dimensions_and_read_as_the_list(tmp_path, mueller):
    ds = grid(mueller=mueller, group=np.repeat([60, 20], 12))
    write_grid(ds, tmp_path / "g.nc")
    with xr.open_dataset(tmp_path / "g.nc", engine="h5netcdf") as stored:
        name = "mueller" if mueller else "I"
        assert stored[name].dims[:3] == ("theta_i", "theta_r", "phi")
        assert (
            stored["theta_i"].values.tolist() == [60.0, 20.0] and stored["theta_i"].attrs["units"] == "degree"
        )
        at = stored[name].sel(theta_i=20, theta_r=30, phi=270)
        assert_array_equal(at, ds[name].values[12 + 4 + 3])
        assert stored["wavelength"].ndim == 0
    xr.testing.assert_identical(pbrdf.read(tmp_path / "g.nc"), ds)


def test_the_order_of_the_rows_is_no_matter():
    ds = grid()
    mixed = ds.isel(geometry=np.random.default_rng(0).permutation(ds.sizes["geometry"]))
    xr.testing.assert_equal(
        to_grid(mixed).sortby(["theta_i", "theta_r", "phi"]), to_grid(ds).sortby(["theta_i"])
    )


def test_what_is_no_grid_is_refused():
    with pytest.raises(
        DataError, match=r"the 23 geometries are no grid: that would be 2 theta_i × 3 theta_r × 4 phi"
    ):
        to_grid(grid().isel(geometry=slice(1, None)))
    twice = grid().isel(geometry=[0, 0])
    with pytest.raises(DataError, match="no grid"):
        to_grid(twice)


def test_a_strangers_arrays_are_read(tmp_path):
    """One angle of incidence as a scalar, wavelengths as a dimension."""
    I = np.arange(1.0, 7.0).reshape(3, 2)  # noqa: E741
    stored = xr.Dataset(
        {"I": (("theta_r", "wavelength"), I)},
        {
            "theta_r": ("theta_r", [10.0, 20.0, 30.0], {"units": "degree"}),
            "wavelength": [450.0, 550.0],
            "theta_i": ((), 45.0, {"units": "degree"}),
            "phi": ((), 0.0, {"units": "degree"}),
        },
        {
            "quantity": "brdf",
            "stokes_convention": "p-s",
            "illumination": [1.0, 0.0, 0.0, 0.0],
            "simulated": 0,
        },
    )
    stored.to_netcdf(tmp_path / "s.nc", engine="h5netcdf")
    ds = pbrdf.read(tmp_path / "s.nc")
    assert_array_equal(ds["I"], I.ravel())
    assert_array_equal(ds["wavelength"], [450.0, 550.0] * 3)
    np.testing.assert_allclose(np.rad2deg(ds["theta_i"]), 45.0)
    assert_array_equal(np.rad2deg(ds["theta_r"].values).round(9), [10, 10, 20, 20, 30, 30])
