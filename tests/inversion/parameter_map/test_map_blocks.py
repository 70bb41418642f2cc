"""Blocks: the same numbers whoever fits them, Dask arrays that stay lazy, memory that no image exceeds."""

from __future__ import annotations

import pickle
import tracemalloc

import numpy as np
import pytest
import xarray as xr
from map_helpers import directions, measured, varied

import pbrdf
from pbrdf.inversion.parameter_map.block_stack import stack_of_block
from pbrdf.inversion.parameter_map.fit_map import block_sizes

FEW = {"fix": {"k": 1.2504, "b": 0.1827}, "starts": 8}


@pytest.fixture(scope="module")
def data():
    return measured(varied((9, 7)), directions(4))


class Counting:
    """An array that lies elsewhere: tells what was read of it."""

    def __init__(self, values, read):
        self.values, self.read = values, read
        self.shape, self.dtype, self.ndim = values.shape, values.dtype, values.ndim

    def __getitem__(self, key):
        part = self.values[key]
        self.read.append(part.size)
        return part


@pytest.mark.slow
def test_a_block_depends_on_itself_alone(data):
    prepared = pbrdf.MapFit.prepare(data, **FEW)
    block = data.isel(y=slice(4, 8), x=slice(0, 5))
    first = prepared.fit_block(block)
    prepared.fit_block(data.isel(y=slice(0, 4)))
    again = pickle.loads(pickle.dumps(prepared)).fit_block(block.load())
    xr.testing.assert_identical(first, again)
    assert first["y"].values.tolist() == data["y"].values[4:8].tolist()
    whole = pbrdf.fit_map(data, block={"y": 4, "x": 5}, **FEW)
    part = whole.isel(y=slice(4, 8), x=slice(0, 5)).drop_attrs()
    xr.testing.assert_identical(part, first.drop_attrs())


@pytest.mark.slow
def test_blocks_of_other_sizes_find_the_same(data):
    one, other = pbrdf.fit_map(data, **FEW), pbrdf.fit_map(data, block=4, **FEW)
    off = (other["estimate"] - one["estimate"]) / one["standard_error"]
    assert float(np.abs(off).max()) < 1e-3


@pytest.mark.slow
def test_dask_arrays_stay_lazy(data):
    dask = pytest.importorskip("dask")
    da = pytest.importorskip("dask.array")
    read = []
    lazy = data.copy()
    for name in ("I", "Q", "U", "I_std", "Q_std", "U_std"):
        there = Counting(data[name].values, read)
        array = da.from_array(there, (-1, 5, 7), name=name, asarray=False, meta=np.empty((0, 0, 0)))
        lazy[name] = (data[name].dims, array)
    found = pbrdf.fit_map(lazy, correlation=True, **FEW)
    assert read == []
    assert {v.chunksizes["y"] for v in found.data_vars.values()} == {(5, 4)}
    part = found["estimate"].isel(y=slice(0, 5))
    assert read == []
    with dask.config.set(scheduler="threads"):
        part.compute()
        # one block was read, once
        assert sum(read) == 6 * data.sizes["geometry"] * 5 * 7
        computed = found.compute()
    eager = pbrdf.fit_map(data, correlation=True, block={"y": 5, "x": 7}, **FEW)
    xr.testing.assert_identical(computed.drop_attrs(), eager.drop_attrs())
    assert computed.attrs["settings"] == eager.attrs["settings"]
    assert [v.dtype for v in found.data_vars.values()] == [v.dtype for v in eager.data_vars.values()]


@pytest.mark.slow
def test_masks_labels_and_directions_of_each_pixel_with_dask(data):
    pytest.importorskip("dask.array")
    mask = np.ones((9, 7), dtype=bool)
    mask[3:6, 2] = False
    label = np.ones((9, 7), dtype=int)
    label[0] = 0
    over = ("y", "x")
    dataset = data.assign_coords(mask=(over, mask), height=(over, 1.0 * label))
    dataset["phi"] = dataset["phi"] + 0.0 * data["I"]
    dataset["region"] = (over, label)
    eager = pbrdf.fit_map(dataset, labels="region", block={"y": 5, "x": 7}, **FEW)
    for lazy in (dataset.chunk(y=5), dataset.assign({n: dataset[n].chunk(y=5) for n in "IQU"})):
        computed = pbrdf.fit_map(lazy, labels="region", **FEW).compute()
        for name in eager.data_vars:
            np.testing.assert_array_equal(computed[name].values, eager[name].values)
    assert (eager["status"] == 5).sum() == 10
    assert eager["height"].dims == over


def test_dask_arrays_that_cannot_stay_lazy_are_refused(data):
    pytest.importorskip("dask.array")
    with pytest.raises(
        pbrdf.DataError, match=r"6 chunks along 'geometry'.*dataset.chunk\(\{'geometry': -1\}\)"
    ):
        pbrdf.fit_map(data.chunk(geometry=2), **FEW)
    with pytest.raises(pbrdf.DataError, match=r"share: .* several passes"):
        pbrdf.fit_map(data.chunk(), share=["n"], **FEW)
    mixed = data.chunk(y=3).assign(Q=data["Q"].chunk(y=4))
    with pytest.raises(pbrdf.DataError, match="unify_chunks"):
        pbrdf.fit_map(mixed, **FEW)


@pytest.mark.slow
def test_a_file_is_read_block_by_block(data, tmp_path):
    path = tmp_path / "stokes.nc"
    data.to_netcdf(path, engine="h5netcdf")
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        attrs = dict(opened.attrs)
        opened.attrs = attrs | {"illumination": list(map(float, attrs["illumination"])), "simulated": 1}
        found = pbrdf.fit_map(opened, block=4, **FEW)
        assert not opened["I"].variable._in_memory
    xr.testing.assert_equal(found, pbrdf.fit_map(data, block=4, **FEW))


@pytest.mark.slow
def test_memory_is_that_of_a_block_whatever_the_image(data):
    one = data.isel(y=slice(0, 8), x=slice(0, 7))

    def peak(times):
        # the same numbers again and again: the image itself takes no memory
        wide = {
            name: (
                ("geometry", "t", "y", "x"),
                np.broadcast_to(column.values[:, None], (len(column), times, *column.shape[1:])),
            )
            for name, column in one.data_vars.items()
        }
        angles = {name: one[name] for name in ("theta_i", "theta_r", "phi", "group")}
        dataset = xr.Dataset(wide, angles, one.attrs)
        tracemalloc.start()
        found = pbrdf.fit_map(dataset, block={"t": 1}, **FEW)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most - found.nbytes

    peak(1)
    few, many = peak(2), peak(12)
    # what Dr.Jit leaves of a recording until it is collected, 10 kB a block, is of no account
    assert many < 1.1 * few + 12 * 15_000


def test_sizes_of_blocks(data):
    assert block_sizes(data, ("y", "x"), None) == {"y": 9, "x": 7}
    assert block_sizes(data, ("y", "x"), 4) == {"y": 4, "x": 4}
    assert block_sizes(data, ("y", "x"), {"x": 100}) == {"y": 9, "x": 7}
    big = xr.Dataset({"I": (("geometry", "y", "x"), np.broadcast_to(0.0, (42, 5000, 3000)))})
    sizes = block_sizes(big, ("y", "x"), None)
    assert 1 << 14 < sizes["y"] * sizes["x"] <= 1 << 16 and 0.5 <= sizes["y"] / sizes["x"] <= 2.0
    many = xr.Dataset({"I": (("geometry", "y", "x"), np.broadcast_to(0.0, (100_000, 50, 30)))})
    sizes = block_sizes(many, ("y", "x"), None)
    assert sizes["y"] * sizes["x"] * 100_000 <= 1 << 24


@pytest.mark.slow
def test_data_of_a_file_opened_with_xarray_are_data(data, tmp_path):
    """Files give numbers and lists among the attributes back as those of NumPy."""
    data.to_netcdf(tmp_path / "data.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "data.nc", engine="h5netcdf") as found:
        assert isinstance(found.attrs["illumination"], np.ndarray)
        xr.testing.assert_equal(pbrdf.fit_map(found, **FEW), pbrdf.fit_map(data, **FEW))


def test_no_pixels_are_refused(data):
    with pytest.raises(pbrdf.DataError, match="the data have no pixels: y: 0, x: 7"):
        pbrdf.fit_map(data.isel(y=slice(0, 0)), **FEW)


@pytest.mark.parametrize("order", ["IQUV", "IUQV", "VUQI"])
@pytest.mark.parametrize("dims", [("stokes_out", "stokes_in"), ("stokes_in", "stokes_out")])
def test_elements_of_matrices_go_by_their_labels(order, dims):
    """Where rows and columns stand in a file, and which come first, changes nothing."""
    rng = np.random.default_rng(2)
    values = rng.uniform(-0.1, 0.1, (2, 3, 4, 4))
    values[..., 0, 0] = 1.0
    angles = {name: ("geometry", [0.2, 0.4]) for name in ("theta_i", "theta_r", "phi")}
    labels = {"stokes_out": list("IQUV"), "stokes_in": list("IQUV")}
    attrs = {"quantity": "brdf", "illumination": [1.0, 0.0, 0.0, 0.0]}
    block = xr.Dataset({"mueller": (("geometry", "x", *labels), values)}, {**angles, **labels}, attrs)
    other = block.sel(stokes_out=list(order), stokes_in=list(order)).transpose("x", *dims, "geometry")
    here, there = stack_of_block(block, ["x"]), stack_of_block(other, ["x"])
    assert here.channels == there.channels
    np.testing.assert_array_equal(here.values, there.values)
    np.testing.assert_array_equal(there.values[there.channels.index("m12")], values[..., 1, 2])
