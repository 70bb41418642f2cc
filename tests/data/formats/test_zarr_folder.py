from __future__ import annotations

import json
import sys

import numpy as np
import pytest
import xarray as xr
from dataset_strategies import datasets, same_bits
from hypothesis import HealthCheck, given, settings

from pbrdf.data import make_dataset, read, write
from pbrdf.data.formats.zarr_folder import read_zarr, write_zarr
from pbrdf.errors import DataError

pytest.importorskip("zarr")


@pytest.fixture
def ds():
    return make_dataset(np.deg2rad(30.0), 0.25, 0.0, quantity="brdf", I=1.0, group="φ1")


@pytest.mark.slow
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ds=datasets())
def test_round_trip_is_bit_for_bit(tmp_path, ds):
    write_zarr(ds, tmp_path / "data.zarr")
    assert same_bits(read_zarr(tmp_path / "data.zarr"), ds)


def test_read_and_write_know_the_extension_and_others_read_it(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    assert read(tmp_path / "data.zarr").identical(ds)
    assert [path.name for path in tmp_path.iterdir()] == ["data.zarr"]
    with xr.open_dataset(tmp_path / "data.zarr", engine="zarr") as stored:
        assert stored["theta_i"].values[0] == 30.0
        assert stored["theta_i"].attrs["units"] == "degree"


def test_the_third_version_of_the_format_is_written_with_text_that_has_a_type_there(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    listed = json.loads((tmp_path / "data.zarr" / "zarr.json").read_text(encoding="utf-8"))
    assert listed["zarr_format"] == 3
    arrays = listed["consolidated_metadata"]["metadata"]
    assert {*arrays} == {"theta_i", "theta_r", "phi", "group", "I"}
    assert arrays["group"]["data_type"] == "string"


def test_the_second_version_of_the_format_is_read(tmp_path, ds):
    ds.to_zarr(tmp_path / "data.zarr", zarr_format=2, consolidated=True, write_empty_chunks=True)
    assert read(tmp_path / "data.zarr").identical(ds)


def test_a_zarr_folder_is_replaced_and_nothing_else_is(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    (tmp_path / "data.zarr" / "V").mkdir()
    write(ds, tmp_path / "data.zarr")
    assert not (tmp_path / "data.zarr" / "V").exists()
    (tmp_path / "mine.zarr").mkdir()
    (tmp_path / "mine.zarr" / "thesis.txt").write_text("dear")
    (tmp_path / "file.zarr").write_text("dear")
    for name in ("mine.zarr", "file.zarr"):
        with pytest.raises(DataError, match="something else of that name, which is left alone"):
            write(ds, tmp_path / name)
        with pytest.raises(DataError, match=f"{name}: this is not a Zarr folder"):
            read(tmp_path / name)
    assert (tmp_path / "mine.zarr" / "thesis.txt").read_text() == "dear"
    assert (tmp_path / "file.zarr").read_text() == "dear"


def test_what_is_refused_leaves_nothing_behind(tmp_path, ds):
    ds["theta_i"][0] = 2.0
    with pytest.raises(DataError, match="theta_i"):
        write(ds, tmp_path / "data.zarr")
    with pytest.raises(DataError, match=r"nowhere/data\.zarr: cannot be written"):
        write(make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0), "/proc/nowhere/data.zarr")
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_replacement_keeps_the_old_folder(tmp_path, ds, monkeypatch):
    """Where folders cannot change places, and the new one cannot have its name, the old one is put back."""
    from pathlib import Path

    from pbrdf.files import atomic

    write(ds, tmp_path / "data.zarr")
    replace = Path.replace

    def stubborn(self, target):
        if Path(target).name == "data.zarr" and not Path(target).exists() and (self / "new").exists():
            raise OSError(5, "no")
        return replace(self, target)

    monkeypatch.setattr(atomic, "_exchanged", lambda one, other: False)
    monkeypatch.setattr(Path, "replace", stubborn)
    with (
        pytest.raises(DataError, match=r"data\.zarr: cannot be written: no"),
        atomic.atomic_folder(tmp_path / "data.zarr") as target,
    ):
        (target / "new").write_text("")
    assert [path.name for path in tmp_path.iterdir()] == ["data.zarr"]
    assert read(tmp_path / "data.zarr").identical(ds)


def test_without_zarr_the_remedy_is_named(tmp_path, ds, monkeypatch):
    write(ds, tmp_path / "data.zarr")
    monkeypatch.setitem(sys.modules, "zarr", None)
    for use in (lambda: write(ds, tmp_path / "new.zarr"), lambda: read(tmp_path / "data.zarr")):
        with pytest.raises(DataError, match=r"needs the package zarr: pip install zarr, or use \.nc"):
            use()


def test_an_old_zarr_is_named_with_the_remedy(tmp_path, ds, monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda name: "2.18.7")
    with pytest.raises(DataError, match=r"needs zarr 3\.1\.3 or newer, not 2\.18\.7: pip install -U zarr"):
        write(ds, tmp_path / "new.zarr")


def test_a_folder_of_another_kind_is_no_file(tmp_path):
    with pytest.raises(DataError, match="this is a folder; name a file in it"):
        read(tmp_path)
