"""Stokes pictures and the geometry of their pixels as the data of a parameter map."""

import math

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.data.formats.csv_table.columns import COVARIANCES
from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.files.netcdf_files import open_netcdf
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.map_dataset import map_block, map_dataset
from pbrdf.instruments.pixel_geometry.panel import Panel
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import rotating_polarizer
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.optics.elements import rotate_frame
from pixel_helpers import blank, painted

PAINT = pbrdf.DoubleGauss(sigma=0.2, n=1.6, a=0.3, k=1.2, b=0.2, t=0.6)
BALL = Sphere(
    x=20.3, y=15.6, r=14.0, lamps=[Lamp(0.9, 0.5), Lamp(0.6, 2.5, 4.0)], camera=PixelCamera(focal=90.0)
)


def rich(rows, columns, series=2, seed=0):
    """Pictures with correlated errors, flags, exposures and a wavelength."""
    rng = np.random.default_rng(seed)
    shape = (series, rows, columns)
    dims = ("series", "y", "x")
    root = rng.normal(0.0, 0.01, (*shape, 3, 3))
    covariance = root @ np.swapaxes(root, -1, -2)
    data = {n: (dims, rng.normal(1.0 if n == "I" else 0.0, 0.1, shape).astype("f4")) for n in "IQU"}
    for (i, j), name in COVARIANCES.items():
        if max(i, j) < 3:
            data[name] = (dims, covariance[..., i, j].astype("f4"))
    flags = (rng.random(shape) < 0.1).astype(np.uint8)
    for name in (*data,):
        data[name][1][flags != 0] = np.nan
    data["flags"] = (dims, flags)
    coords = {
        "exposure": ("series", np.linspace(1.0, 2.0, series)),
        "wavelength": ("series", np.full(series, 550.0)),
    }
    return xr.Dataset(data, blank(rows, columns, series).coords).assign_coords(coords)


def test_from_a_paint_to_the_camera_and_back():
    """Pictures of a painted ball in the camera's axes, with a far and a near lamp, become its BRDF in (p, s)."""
    pictures = painted(PAINT, BALL.of(blank(30, 40, 2)), scale=700.0)
    found = map_dataset(pictures, BALL, scale=700.0)
    good = np.isfinite(found.I.values)
    assert good.any(axis=(1, 2)).all() and not good.all()
    expected = PAINT.stokes(*(found[n].values[good] for n in ("theta_i", "theta_r", "phi")))
    for k, name in enumerate("IQU"):
        assert found[name].values[good] == pytest.approx(expected[:, k], rel=1e-9, abs=1e-12)
    assert (expected[:, 2] > 0.01).any() and (expected[:, 2] < -0.01).any()
    assert found.attrs["quantity"] == "brdf" and "scale" not in found.attrs
    relative = map_dataset(pictures, BALL)
    assert (relative.attrs["quantity"], relative.attrs["scale"]) == ("dn", "arbitrary")
    cosine = np.cos(found.theta_i.values[good])
    assert relative.I.values[good] == pytest.approx(700.0 * expected[:, 0] * cosine)


def test_errors_turn_with_the_values():
    """The covariance of a pixel is R C Rᵀ, and the standard errors are its diagonal; divided by the exposure."""
    pictures = rich(30, 40)
    geometry = BALL.of(pictures)
    found = map_dataset(pictures, geometry)
    for series, row, column in ((0, 12, 24), (1, 17, 19), (1, 10, 15)):
        here = pictures.isel(series=series, y=row, x=column)
        there = found.isel(geometry=series, y=row, x=column)
        if not np.isfinite(float(there.I)):
            assert int(here.flags) != 0 or not bool(geometry.mask[series, row, column])
            continue
        turn = rotate_frame(float(geometry.rotation[series, row, column]))[:3, :3]
        scale = float(here.exposure) * float(geometry.irradiance[series, row, column])
        covariance = np.empty((3, 3))
        for (i, j), name in COVARIANCES.items():
            if max(i, j) < 3:
                covariance[i, j] = covariance[j, i] = float(here[name])
        stokes = turn @ [float(here[n]) for n in "IQU"] / scale
        assert [float(there[n]) for n in "IQU"] == pytest.approx(stokes)
        expected = turn @ covariance @ turn.T / scale**2
        assert there.covariance.values[:3, :3] == pytest.approx(expected)
        assert np.isnan(there.covariance.values[3]).all()
        assert [float(there[f"{n}_std"]) for n in "IQU"] == pytest.approx(np.sqrt(np.diag(expected)))


def test_only_what_was_measured_has_values():
    pictures = rich(30, 40)
    geometry = BALL.of(pictures)
    found = map_dataset(pictures, geometry)
    good = (pictures.flags.values == 0) & geometry.mask.values
    assert (np.isfinite(found.Q.values) == good).all()
    # the angles of the others take part in nothing, and are numbers all the same
    assert np.isfinite(found.theta_i.values).all()
    assert (found.theta_i.values[~geometry.mask.values] == 0.0).all()
    assert "V" not in found
    assert found.wavelength.values.tolist() == [550.0, 550.0]
    assert found.series.values.tolist() == ["s0", "s1"]


def test_a_pixel_is_a_valid_data_set():
    found = map_dataset(rich(30, 40), BALL)
    where = np.argwhere(np.isfinite(found.I.values).all(axis=0))[0]
    pixel = found.isel(y=where[0], x=where[1]).drop_vars(["y", "x", "series"])
    pbrdf.validate(pixel)


@pytest.mark.parametrize("kind", ["ball", "flat", "flat in perspective", "data set"])
def test_lazy_pictures_stay_lazy(kind):
    """With Dask nothing is computed before it is asked for, and then it is the same to the last bit; so are blocks."""
    pytest.importorskip("dask")
    pictures = rich(30, 40)
    flat = Panel(0.5, 0.6, 0.3, 1.0)
    geometry = {
        "ball": BALL,
        "flat": flat,
        "flat in perspective": Panel(0.5, 0.6, 0.3, 1.0, camera=PixelCamera(focal=50.0)),
        "data set": BALL.of(pictures),
    }[kind]
    whole = map_dataset(pictures, geometry)
    loads = []

    def counted(block):
        loads.append(1)
        return block

    chunked = pictures.chunk(y=12, x=17)
    chunked["I"] = chunked.I.copy(
        data=chunked.I.data.map_blocks(counted, dtype=np.float32, meta=np.empty((0, 0, 0), "f4"))
    )
    lazy = map_dataset(chunked, geometry)
    assert not loads
    assert lazy.I.chunks == ((2,), (12, 12, 6), (17, 17, 6))
    assert ("y" in lazy.theta_i.dims) == (kind != "flat")
    xr.testing.assert_identical(lazy.compute(), whole)
    assert loads
    if kind != "data set":
        located = geometry.located(pictures)
        part = {"y": slice(5, 9), "x": slice(3, 30)}
        xr.testing.assert_identical(map_block(pictures.isel(part), located), whole.isel(part))


def test_a_geometry_of_other_pixels_is_refused_with_both():
    pictures = blank(6, 5)
    geometry = Sphere(x=2.5, y=3.0, r=2.0, lamps=[Lamp(0.5, 0.3)]).of(pictures)
    assert map_dataset(pictures, geometry).sizes["geometry"] == 1
    with pytest.raises(
        DataError, match="x is 4, 3, 2, 1, 0 in the geometry, and 0, 1, 2, 3, 4 in the pictures"
    ):
        map_dataset(pictures, geometry.isel(x=slice(None, None, -1)))


def test_one_geometry_serves_several_series_but_not_other_numbers():
    three = rich(10, 12, 3)
    found = map_dataset(three, Panel(0.5, 0.6, 0.3, 1.0))
    assert found.theta_i.dims == ("geometry",) and found.theta_i.values == pytest.approx([0.5] * 3)
    with pytest.raises(DataError, match="2 lamps for 3 series"):
        map_dataset(three, BALL)
    with pytest.raises(DataError, match="the geometry has 2 in series, the pictures have 3"):
        map_dataset(three, BALL.of(rich(10, 12)))
    with pytest.raises(DataError, match="the geometry has 30 in y, the pictures have 10"):
        map_dataset(rich(10, 12), BALL.of(rich(30, 12)))
    with pytest.raises(DataError, match="Stokes pictures have I, Q, U over series, y and x"):
        map_dataset(three.drop_vars("I"), BALL)
    with pytest.raises(DataError, match="no rotation"):
        map_dataset(three, Panel(0.5, 0.6, 0.3, 1.0).of(three).drop_vars("rotation"))
    with pytest.raises(DataError, match="scale is -1"):
        map_dataset(three, Panel(0.5, 0.6, 0.3, 1.0), scale=-1.0)


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_files_of_a_reduction(tmp_path, suffix):
    """What ``pbrdf reduce`` writes of frames behind a turning polariser, read and turned."""
    if suffix == ".zarr":
        pytest.importorskip("zarr")
    polarimeter = rotating_polarizer(np.deg2rad([0.0, 45.0, 90.0, 135.0]))
    camera = Instrument(polarimeter, Detector(bits=12), reference_angle=math.radians(90.0))
    stokes = np.array([1000.0, 300.0, -200.0, 0.0])
    frames = ArrayFrames(
        np.rint(polarimeter.intensities(np.broadcast_to(stokes[:, None, None], (4, 6, 8))))[None], ("one",)
    )
    path = tmp_path / f"stokes{suffix}"
    reduce(frames, camera, [MapWriter(path, frames, camera)])
    with (open_zarr if suffix == ".zarr" else open_netcdf)(path) as pictures:
        # the camera's x axis lies along s: Q and U change their signs
        found = map_dataset(pictures, Panel(0.5, 0.6, 0.0))
        assert found.Q.values == pytest.approx(np.full((1, 6, 8), -300.0), abs=1.0)
        assert found.U.values == pytest.approx(np.full((1, 6, 8), 200.0), abs=1.0)
        assert found.I_std.values == pytest.approx(np.sqrt(pictures.cov_II.values))
        assert found.attrs["quantity"] == "dn" and found.attrs["instrument"] == polarimeter.name
