"""The pixels of one picture of a curved sample as the geometries of one data set."""

import math

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp
from pbrdf.instruments.pixel_geometry.cylinder import Cylinder
from pbrdf.instruments.pixel_geometry.geometries import as_geometries
from pbrdf.instruments.pixel_geometry.map_dataset import map_dataset
from pbrdf.instruments.pixel_geometry.panel import Panel
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pixel_helpers import painted

PAINT = pbrdf.DoubleGauss(sigma=0.15, n=1.6, a=0.3, k=1.2, b=0.2, t=0.6)
LAMPS = [Lamp(math.radians(60.0), 0.5), Lamp(math.radians(85.0), 2.5)]


def ball(size, noise, seed=0, scale=1.0):
    sphere = Sphere(x=0.5 * size, y=0.5 * size, r=0.45 * size, lamps=LAMPS)
    middle = {"series": 2, "y": size, "x": size}
    blank = xr.Dataset(coords={"series": ["near", "far"], **{k: np.arange(middle[k]) for k in ("y", "x")}})
    pictures = painted(PAINT, sphere.of(blank), noise=noise, seed=seed, scale=scale)
    return map_dataset(pictures.assign_coords(series=["near", "far"]), sphere, scale=scale)


@pytest.fixture(scope="module")
def noisy():
    return ball(240, 2e-3)


def test_pixels_by_themselves(noisy):
    """Every measured pixel is a geometry with its own values and errors; `every` takes a part of them."""
    found = as_geometries(noisy, bins=None, every=7)["sample"]
    pbrdf.validate(found)
    counts = np.isfinite(noisy.I.values).sum(axis=(1, 2))
    assert found.sizes["geometry"] == sum(-(-n // 7) for n in counts)
    assert set(found.group.values) == {"near", "far"}
    good = np.isfinite(noisy.I.values[0])
    assert found.I.values[: -(-counts[0] // 7)] == pytest.approx(noisy.I.values[0][good][::7])
    assert found.covariance.values[0, :3, :3] == pytest.approx(
        noisy.covariance.values[0][good][0, :3, :3], rel=1e-9
    )
    assert found.attrs["quantity"] == "brdf" and found.attrs["pixels"] == sum(-(-n // 7) for n in counts)


def test_bins_of_directions_are_the_paint_within_their_errors(noisy):
    """Some 40 000 pixels become some hundred geometries: their values are the paint's at their mean directions, lobe
    and all, within the errors that they state: the χ² of each component is one a value."""
    found = as_geometries(noisy, bins=math.radians(5.0))["sample"]
    pbrdf.validate(found)
    assert 300 < found.sizes["geometry"] < 2500
    assert int(noisy.I.count()) > 35_000
    expected = PAINT.stokes(found.theta_i.values, found.theta_r.values, found.phi.values)
    for k, name in enumerate("IQU"):
        pull = (found[name].values - expected[:, k]) / found[f"{name}_std"].values
        assert np.mean(pull**2) == pytest.approx(1.0, abs=0.25), name
        assert abs(np.mean(pull)) < 0.15
    # and they are errors of means
    single = as_geometries(noisy, bins=None)["sample"]
    assert found.I_std.min() < 0.25 * single.I_std.min()


def test_scatter_is_the_error_where_no_noise_is_stated(noisy):
    """Without a covariance bins have the error of their scatter, and those too small for one are left out."""
    bare = noisy.drop_vars(["covariance", "I_std", "Q_std", "U_std"])
    found = as_geometries(bare, bins=math.radians(6.0))["sample"]
    stated = as_geometries(noisy, bins=math.radians(6.0))["sample"]
    assert 0 < found.sizes["geometry"] < stated.sizes["geometry"]
    expected = PAINT.stokes(found.theta_i.values, found.theta_r.values, found.phi.values)
    pull = (found.Q.values - expected[:, 1]) / found.Q_std.values
    assert np.mean(pull**2) == pytest.approx(1.0, abs=0.35)


def test_a_surface_takes_the_bend_out_of_a_bin():
    """With hardly any noise, bins of 4° over a lobe of σ = 0.15: the root mean square error is below 0.02 % of its
    height, where plain means are off by six times as much."""
    clean = ball(240, 1e-7)
    found = as_geometries(clean, bins=math.radians(4.0))["sample"]
    expected = PAINT.stokes(found.theta_i.values, found.theta_r.values, found.phi.values)
    off = found.I.values - expected[:, 0]
    assert np.sqrt(np.mean(off**2)) < 2e-4 * expected[:, 0].max()


def test_pixels_along_a_cylinder_have_one_direction():
    """Directions on a cylinder make a line: bins fit a curve, and do not fail for want of a second direction."""
    cylinder = Cylinder(x=60.0, y=40.0, r=50.0, angle=0.5 * math.pi, lamps=[Lamp(0.9, 0.3)])
    blank = xr.Dataset(coords={"series": ["one"], "y": np.arange(80), "x": np.arange(120)})
    pictures = painted(PAINT, cylinder.of(blank), noise=1e-3, seed=4)
    found = as_geometries(map_dataset(pictures, cylinder, scale=1.0), bins=math.radians(3.0))["sample"]
    expected = PAINT.stokes(found.theta_i.values, found.theta_r.values, found.phi.values)
    pull = (found.I.values - expected[:, 0]) / found.I_std.values
    assert 20 < found.sizes["geometry"] < 120
    assert np.mean(pull**2) == pytest.approx(1.0, abs=0.5)


def test_labels_part_the_sample(noisy):
    numbers = np.zeros((240, 240), np.int32)
    numbers[:120], numbers[120:, :120] = 3, 8
    labels = xr.DataArray(
        numbers, dims=("y", "x"), attrs={"flag_values": [3, 8], "flag_meanings": "upper lower_left"}
    )
    found = as_geometries(noisy, labels, bins=None)
    assert list(found) == ["upper", "lower_left"]
    assert found["upper"].attrs["title"] == "upper"
    assert found["upper"].sizes["geometry"] == int(np.isfinite(noisy.I.values[:, :120]).sum())
    assert list(as_geometries(noisy, numbers, bins=None, every=50)) == ["3", "8"]


def test_one_geometry_for_all_pixels_is_one_bin():
    """A flat panel without perspective: the mean of its pixels."""
    panel = Panel(0.5, 0.6, 0.3, 1.0)
    shape = xr.Dataset(coords={"series": ["one"], "y": np.arange(20), "x": np.arange(20)})
    geometry = panel.of(shape)
    full = geometry.map(lambda v: v.expand_dims(y=20, x=20)).assign_coords(shape[["y", "x"]].coords)
    data = map_dataset(painted(PAINT, full, noise=1e-3), panel, scale=1.0)
    found = as_geometries(data)["sample"]
    assert found.sizes["geometry"] == 1
    assert float(found.I[0]) == pytest.approx(float(data.I.mean()), rel=1e-12)
    spread = float(data.I.std()) / math.sqrt(400)
    assert float(found.I_std[0]) == pytest.approx(spread, rel=0.05)


def test_what_does_not_fit_is_said(noisy):
    with pytest.raises(DataError, match="over geometry, y and x"):
        as_geometries(as_geometries(noisy, bins=None, every=50)["sample"])
    with pytest.raises(DataError, match="one for each of the picture's 240 × 240 pixels"):
        as_geometries(noisy, np.ones((3, 3), int))
    with pytest.raises(DataError, match="no pixel has a label"):
        as_geometries(noisy, np.zeros((240, 240), int))
    corner = np.zeros((240, 240), int)
    corner[:2, :2] = 4
    with pytest.raises(DataError, match="no pixel of '4' was measured"):
        as_geometries(noisy, corner)
    with pytest.raises(DataError, match="bins are from 0 to 90"):
        as_geometries(noisy, bins=0.0)


def test_chunks_of_dask_arrays_are_computed_once(noisy):
    da = pytest.importorskip("dask.array")
    calls = []

    def counted(block):
        calls.append(block.shape)
        return block

    sizes = noisy["I"].shape
    pictures = da.from_array(noisy["I"].values, chunks=sizes).map_blocks(counted, meta=np.empty((0, 0, 0)))
    lazy = noisy.assign(I=(noisy["I"].dims, pictures))
    found = as_geometries(lazy)["sample"]
    assert calls == [sizes]
    xr.testing.assert_identical(found, as_geometries(noisy)["sample"])


def test_dimensions_and_components_go_by_their_names(noisy):
    """Angles over (x, y), covariances of V, U, Q, I: the same geometries."""
    part = noisy.isel(y=slice(60, 120), x=slice(60, 120))
    expected = as_geometries(part, bins=None, every=7)["sample"]
    turned = part.transpose("x", "y", ...)
    axes = [axis for axis in ("stokes_row", "stokes_column") if axis in part.coords]
    assert axes
    turned = turned.sel({axis: list("VUQI") for axis in axes})
    xr.testing.assert_identical(as_geometries(turned, bins=None, every=7)["sample"], expected)


def test_labels_of_other_pixels_are_refused_with_both(noisy):
    labels = xr.DataArray(np.ones((240, 240), int), dims=("y", "x"), coords={"y": noisy["y"][::-1].values})
    with pytest.raises(DataError, match=r"y is 239, 238, … 0 in the labels, and 0, 1, … 239 in the pictures"):
        as_geometries(noisy, labels)
