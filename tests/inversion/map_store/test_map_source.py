"""What tells one input of a map from another."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest
import xarray as xr
from stand_in_fit import picture

from pbrdf.data.formats.zarr_folder import create_zarr
from pbrdf.errors import DataError
from pbrdf.inversion.map_store import DatasetSource, file_identity
from pbrdf.inversion.map_store.settings import differences, digest_of

MIB = 2**20


def changed(one, other):
    return [line.partition(":")[0] for line in differences(one, other)]


def test_a_data_set_is_its_values_and_attributes():
    here = DatasetSource(picture()).identity()
    assert here == DatasetSource(picture().transpose("geometry", "y", "x").copy(deep=True)).identity()
    other = picture()
    other["I"][4, 39, 27] += 1e-15
    assert changed(here, DatasetSource(other).identity()) == ["variables.I.digest"]
    single = picture().astype(np.float32)
    assert changed(here, DatasetSource(single).identity()) == ["variables.I.digest", "variables.I.form"]
    named = picture().assign_coords(group=("geometry", list("abcde"))).assign_attrs(illumination=[1, 0, 0, 0])
    assert changed(here, DatasetSource(named).identity()) == [
        "attributes.illumination",
        "labels.group",
        "variables.group",
    ]
    renamed = named.assign_coords(group=("geometry", list("abcdf")))
    assert changed(DatasetSource(named).identity(), DatasetSource(renamed).identity()) == [
        "labels.group[4]",
        "variables.group.digest",
    ]
    assert digest_of(here) != digest_of(DatasetSource(named).identity())


@pytest.mark.slow
def test_a_file_is_its_size_variables_and_a_sample_wherever_it_lies(tmp_path):
    path = tmp_path / "a.nc"
    opened = xr.Dataset({"I": (("y", "x"), np.zeros((2, 3), np.float32))})
    content = np.random.default_rng(0).bytes(30 * MIB)
    path.write_bytes(content)
    here = file_identity(path, opened)
    assert here["size"] == 30 * MIB and here["variables"] == {"I": "float32(y: 2, x: 3)"}
    shutil.copy(path, tmp_path / "b.nc")
    os.utime(tmp_path / "b.nc", (1, 1))
    assert file_identity(tmp_path / "b.nc", opened) == here
    for place in (0, MIB - 1, 29 * MIB, 30 * MIB - 1, MIB + 28 * MIB // 2 + 5):
        other = bytearray(content)
        other[place] ^= 1
        path.write_bytes(other)
        assert changed(here, file_identity(path, opened)) == ["digest"]
    path.write_bytes(content + b"\0")
    assert changed(here, file_identity(path, opened)) == ["digest", "size"]
    small = content[: 3 * MIB]
    path.write_bytes(small)
    here = file_identity(path, opened)
    path.write_bytes(small[: 2 * MIB] + b"\0" + small[2 * MIB + 1 :])
    assert changed(here, file_identity(path, opened)) == ["digest"]
    with pytest.raises(DataError, match=r"none\.nc: cannot be read: No such file"):
        file_identity(tmp_path / "none.nc", opened)


@pytest.mark.slow
def test_a_zarr_folder_is_its_files(tmp_path):
    pytest.importorskip("zarr")
    ds = picture()
    path = tmp_path / "a.zarr"
    create_zarr(ds, path, encoding={"I": {"chunks": (1, 4, 4)}})
    here = file_identity(path, ds)
    shutil.copytree(path, tmp_path / "b.zarr")
    assert file_identity(tmp_path / "b.zarr", ds) == here
    last = path / "I" / "c" / "0" / "0" / "0"
    chunk = bytearray(last.read_bytes())
    chunk[-1] ^= 1
    last.write_bytes(chunk)
    assert changed(here, file_identity(path, ds)) == ["digest"]
    shutil.rmtree(path)
    create_zarr(ds.assign_attrs(title="another"), path, encoding={"I": {"chunks": (1, 4, 4)}})
    assert "digest" in changed(here, file_identity(path, ds))


def test_differences_are_named_by_their_place():
    here = {"fit": {"starts": 64, "free": ["a", "b"], "noise": None}, "input": {"size": 3}}
    there = {"fit": {"starts": 32, "free": ["a", "c"], "seed": 1, "noise": None}, "input": {"size": 3}}
    assert list(differences(here, there)) == [
        'fit.free[1]: "b" in the store, "c" here',
        "fit.seed: (none) in the store, 1 here",
        "fit.starts: 64 in the store, 32 here",
    ]
    assert list(differences(here, here)) == []
    assert list(differences([1], [1, 2], "share")) == ["share: [1] in the store, [1, 2] here"]
    (told,) = differences({"a": "x" * 100}, {"a": "y"})
    assert told == f'a: "{"x" * 38}…" in the store, "y" here'
    assert digest_of({"b": 1, "a": [2.5]}) == digest_of({"a": [2.5], "b": 1})
