"""Normals and angles from arrays and files."""

import math

import numpy as np
import pytest
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.normal_map import AngleMaps, NormalMap
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pixel_helpers import blank

LAMP = Lamp(math.radians(50.0), math.radians(30.0))
CAMERA = PixelCamera(focal=80.0)
BALL = Sphere(x=20.0, y=15.0, r=14.0, lamps=[LAMP], camera=CAMERA)


def normals():
    """Of the ball, one after another twice as long; the rest is off the sample."""
    found = BALL.located(blank(30, 40)).surface(np.arange(40)[None] + 0.5, np.arange(30)[:, None] + 0.5)
    vectors = np.where(found.seen[..., None], found.normal, 0.0)
    vectors[::2] *= 2.0
    vectors[0] = np.nan
    return vectors


@pytest.mark.parametrize("kind", ["array", "npy", "nc"])
def test_normals_of_a_ball_are_the_ball(tmp_path, kind):
    vectors = normals()
    path = tmp_path / f"normals.{kind}"
    if kind == "npy":
        np.save(path, vectors)
    elif kind == "nc":
        xr.Dataset({"normal": (("y", "x", "component"), vectors)}).to_netcdf(path, engine="h5netcdf")
    given = vectors if kind == "array" else path
    geometry = NormalMap(normals=given, lamps=[LAMP], camera=CAMERA).located(blank(30, 40))
    found, ball = geometry.pixels(np.arange(40), np.arange(30)), BALL.of(blank(30, 40))
    for name in ("theta_i", "theta_r", "phi", "rotation"):
        np.testing.assert_allclose(found[name], ball[name], atol=1e-9)
    assert (found.mask == ball.mask).all()
    part = geometry.pixels(np.arange(7, 30), np.arange(10, 12))
    assert part.identical(found.isel(y=slice(10, 12), x=slice(7, 30)))


@pytest.mark.parametrize("units", ["rad", "degree"])
def test_stored_angles_come_back(tmp_path, units):
    """What a geometry gives is a file of angles: two series, one of them in degrees."""
    two = Sphere(x=20.0, y=15.0, r=14.0, lamps=[LAMP, Lamp(0.3, 2.0, 5.0)], camera=CAMERA).of(
        blank(30, 40, 2)
    )
    stored = two.copy()
    if units == "degree":
        for name in ("theta_i", "theta_r", "phi", "rotation"):
            stored[name] = np.rad2deg(stored[name]).assign_attrs(units="degree")
    stored.to_netcdf(tmp_path / "angles.nc", engine="h5netcdf")
    geometry = AngleMaps(tmp_path / "angles.nc").located(blank(30, 40, 2))
    found = geometry.pixels(np.arange(40), np.arange(30))
    for name in ("theta_i", "theta_r", "phi", "rotation", "irradiance", "mask"):
        np.testing.assert_allclose(found[name], two[name], atol=1e-12)
    part = geometry.pixels(np.arange(5, 9), np.arange(10, 30))
    assert part.identical(found.isel(y=slice(10, 30), x=slice(5, 9)))
    assert found.attrs == {"kind": "angles", "file": "angles.nc"}


def test_an_array_of_angles_is_in_degrees(tmp_path):
    angles = np.full((3, 4, 4), 30.0)
    angles[0, 0] = np.nan
    angles[1, 1, 0] = 95.0
    np.save(tmp_path / "angles.npy", angles)
    found = AngleMaps(tmp_path / "angles.npy").of(blank(3, 4))
    assert found.mask.values.sum() == 10 and not found.mask.values[[0, 1], [0, 1]].any()
    assert float(found.theta_i[2, 2]) == pytest.approx(math.radians(30.0))


def test_what_does_not_fit_is_said(tmp_path):
    with pytest.raises(DataError, match="normals have 3 × 4 rows and columns, the pictures 5 × 4"):
        NormalMap(normals=np.ones((3, 4, 3)), lamps=[LAMP]).of(blank(5, 4))
    with pytest.raises(DataError, match="shape"):
        NormalMap(normals=np.ones((3, 4, 2)), lamps=[LAMP]).of(blank(3, 4))
    with pytest.raises(DataError, match="a lamp cannot be near"):
        NormalMap(normals=np.ones((3, 4, 3)), lamps=[Lamp(0.1, 0.0, 2.0)])
    (tmp_path / "broken.npy").write_bytes(b"nothing")
    for name, words in (
        ("broken.npy", "cannot be read"),
        ("no.npy", "cannot be read"),
        ("a.png", "read from"),
    ):
        with pytest.raises(DataError, match=words):
            NormalMap(normals=tmp_path / name, lamps=[LAMP]).of(blank(3, 4))
    maps = xr.Dataset(
        {name: (("y", "x"), np.zeros((3, 4))) for name in ("theta_i", "theta_r", "phi", "rotation")}
    )
    with pytest.raises(DataError, match="give the attribute units"):
        AngleMaps(maps).of(blank(3, 4))
    with pytest.raises(DataError, match="there is no rotation"):
        AngleMaps(maps.drop_vars("rotation")).of(blank(3, 4))


@pytest.mark.parametrize("components", ["xyz", "zxy", "yxz"])
def test_components_of_normals_are_found_by_their_labels_and_dimensions_by_theirs(tmp_path, components):
    stored = xr.Dataset({"normal": (("y", "x", "component"), normals())}, {"component": list("xyz")})
    turned = stored.sel(component=list(components)).transpose("component", "x", "y")
    turned.to_netcdf(tmp_path / "normals.nc", engine="h5netcdf")
    geometry = NormalMap(normals=tmp_path / "normals.nc", lamps=[LAMP], camera=CAMERA).located(blank(30, 40))
    found, ball = geometry.pixels(np.arange(40), np.arange(30)), BALL.of(blank(30, 40))
    np.testing.assert_allclose(found["theta_i"], ball["theta_i"], atol=1e-9)
    named = stored.assign_coords(component=["nx", "ny", "nz"])
    named.to_netcdf(tmp_path / "named.nc", engine="h5netcdf")
    with pytest.raises(DataError, match="the components of normal are nx, ny, nz: they must be x, y, z"):
        NormalMap(normals=tmp_path / "named.nc", lamps=[LAMP]).located(blank(30, 40))


def test_normals_and_angles_of_other_rows_are_refused_with_both(tmp_path):
    stored = xr.Dataset({"normal": (("y", "x", "component"), normals())}, {"y": np.arange(30)[::-1]})
    stored.to_netcdf(tmp_path / "normals.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"y is 29, 28, … 0 in the normals, and 0, 1, … 29 in the pictures"):
        NormalMap(normals=tmp_path / "normals.nc", lamps=[LAMP]).located(blank(30, 40))
    maps = BALL.of(blank(30, 40)).isel(x=slice(None, None, -1))
    with pytest.raises(DataError, match=r"x is 39, 38, … 0 in the maps of angles, and 0, 1, … 39 in the"):
        AngleMaps(maps).located(blank(30, 40))
