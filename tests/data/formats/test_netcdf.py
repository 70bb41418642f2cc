from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from dataset_strategies import datasets, same_bits
from hypothesis import HealthCheck, given, settings
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import make_dataset
from pbrdf.data.formats.netcdf import read_netcdf, write_netcdf
from pbrdf.errors import DataError


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ds=datasets())
def test_round_trip_is_bit_for_bit(tmp_path, ds):
    write_netcdf(ds, tmp_path / "data.nc")
    assert same_bits(read_netcdf(tmp_path / "data.nc"), ds)


@pytest.mark.parametrize(
    "attrs",
    [
        {"title": "", "note": "json:[1]", "lines": 'a "b"\n\tc', "nul": "a\0b", "greek": "φ = 0 → вперёд"},
        {
            "empty": [],
            "one": [1],
            "one_text": ["a"],
            "texts": ["a,b", "", "ö"],
            "floats": [0.1, 2.0],
            "n": -3,
        },
    ],
)
def test_attributes_of_every_kind_survive(tmp_path, attrs):
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, attrs=attrs)
    write_netcdf(ds, tmp_path / "data.nc")
    assert same_bits(read_netcdf(tmp_path / "data.nc"), ds)


def test_angles_are_stored_in_degrees_with_their_unit(tmp_path):
    ds = make_dataset(
        np.deg2rad(30.0), np.deg2rad(45.0), np.pi, quantity="brdf", I=1.0, dolp=0.1, aolp=np.pi / 2
    )
    write_netcdf(ds, tmp_path / "data.nc")
    with xr.open_dataset(tmp_path / "data.nc", engine="h5netcdf") as stored:
        for name, value in [("theta_i", 30.0), ("theta_r", 45.0), ("phi", 180.0), ("aolp", 90.0)]:
            assert stored[name].attrs["units"] == "degree"
            assert stored[name].values[0] == value


def test_strangers_units_are_converted_and_strangers_variables_listed(tmp_path):
    ds = make_dataset([0.1, 0.2], 0.2, 0.0, quantity="brdf", I=1.0, wavelength=500.0)
    stored = ds.assign(temperature=("geometry", [20.0, 21.0]))
    stored["theta_i"] = ("geometry", [30.0, 60.0], {"units": "degrees"})
    stored["wavelength"] = ("geometry", [0.5, 0.6], {"units": "um"})
    stored.set_coords(["theta_i", "wavelength"]).to_netcdf(tmp_path / "data.nc", engine="h5netcdf")
    read = read_netcdf(tmp_path / "data.nc")
    assert_allclose(read["theta_i"], np.deg2rad([30.0, 60.0]))
    assert_array_equal(read["wavelength"], [500.0, 600.0])
    assert read["wavelength"].attrs["units"] == "nm"
    assert read.attrs["ignored_variables"] == ["temperature"]


def test_units_that_are_not_understood_are_named(tmp_path):
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0)
    ds["phi"].attrs["units"] = "gon"
    ds.to_netcdf(tmp_path / "data.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"data\.nc: the units 'gon' of phi"):
        read_netcdf(tmp_path / "data.nc")


def test_a_file_that_breaks_the_schema_is_named(tmp_path):
    xr.Dataset({"I": ("x", [1.0])}).to_netcdf(tmp_path / "data.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"data\.nc does not follow the schema: .*; .*") as caught:
        read_netcdf(tmp_path / "data.nc")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_netcdf_is_named(text_file):
    with pytest.raises(DataError, match=r"data\.nc: cannot be read as netCDF"):
        read_netcdf(text_file("no", "data.nc"))


def test_invalid_data_are_not_written(tmp_path):
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0)
    ds["theta_i"][0] = 2.0
    with pytest.raises(DataError, match="theta_i"):
        write_netcdf(ds, tmp_path / "data.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda ds: ds["theta_i"].attrs.update(units=[1.0, 2.0]),
            r"the units .* of theta_i are not understood",
        ),
        (lambda ds: ds.attrs.update(note="json:{"), "the attribute note is not JSON, line 1 column 2"),
        (
            lambda ds: ds.attrs.update(note="json:" + "[" * 50_000),
            "the attribute note is not JSON, brackets stand",
        ),
        (lambda ds: ds.update({"phi": ("geometry", ["a"])}), r"phi"),
        (lambda ds: ds.update({"wavelength": ("geometry", ["a"])}), r"wavelength"),
        (lambda ds: ds.attrs.update(quantity=[1, 2]), "the attribute quantity is"),
        (
            lambda ds: ds.attrs.update(assumptions=3),
            "the attribute assumptions is 3, not a list of sentences",
        ),
        (lambda ds: ds.attrs.update(simulated=[0, 1]), "the attribute simulated is"),
    ],
)
def test_what_another_program_stores_in_another_form_is_named(tmp_path, change, words):
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0)
    change(ds)
    ds.to_netcdf(tmp_path / "data.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=rf"data\.nc.*{words}"):
        read_netcdf(tmp_path / "data.nc")


@pytest.mark.parametrize(
    ("dims", "name", "words"),
    [
        (("y", "x"), "I", "Stokes pictures, whose pixels have no geometry yet: `pbrdf map"),
        (
            ("geometry", "sample"),
            "I",
            "data of pixels, with sample beside geometry: `pbrdf map` and pbrdf.fit_map",
        ),
        (("parameter", "y", "x"), "estimate", "a map of fitted parameters, not measurements: pbrdf.open_map"),
    ],
)
def test_pictures_pixels_and_maps_say_what_takes_them(tmp_path, dims, name, words):
    xr.Dataset({name: (dims, np.ones((2,) * len(dims)))}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=rf"a\.nc: holds {words}"):
        read_netcdf(tmp_path / "a.nc")


@pytest.mark.parametrize("order", ["IUQV", "VUQI"])
def test_stokes_components_are_found_by_their_labels(tmp_path, order):
    rng = np.random.default_rng(5)
    matrices = rng.uniform(-0.1, 0.1, (3, 4, 4))
    matrices[:, 0, 0] = 1.0
    spread = np.eye(4) + 0.1 * np.add.outer(np.arange(4), np.arange(4))
    for ds, axes in (
        (
            make_dataset([0.1, 0.2, 0.3], 0.2, 0.0, quantity="brdf", mueller=matrices),
            ("stokes_out", "stokes_in"),
        ),
        (
            make_dataset(
                [0.1, 0.2], 0.2, 0.0, quantity="brdf", I=1.0, Q=0.1, U=0.2, V=0.0, covariance=spread
            ),
            ("stokes_row", "stokes_column"),
        ),
    ):
        write_netcdf(ds, tmp_path / "data.nc")
        with xr.open_dataset(tmp_path / "data.nc", engine="h5netcdf") as stored:
            other = stored.sel({axis: list(order) for axis in axes}).load()
        other.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        assert same_bits(read_netcdf(tmp_path / "other.nc"), ds)
