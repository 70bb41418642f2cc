"""A Zarr folder that lost a file is refused, and the file named."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.data import make_dataset, read, write
from pbrdf.errors import DataError
from pbrdf.files.zarr_chunks import require_complete

pytest.importorskip("zarr")


@pytest.fixture
def ds():
    theta = np.deg2rad(np.linspace(5.0, 60.0, 6))
    return make_dataset(theta, theta, 0.0, quantity="brdf", I=np.cos(theta), Q=0.0 * theta)


def stored(ds, path, **options):
    ds.to_zarr(path, mode="w", write_empty_chunks=True, **options)
    require_complete(path)
    return path


VERSIONS = [{"zarr_format": 2, "consolidated": True}, {"zarr_format": 3, "consolidated": False}]


@pytest.mark.parametrize("options", VERSIONS)
@pytest.mark.parametrize("name", ["I", "phi", "group"])
def test_a_missing_chunk_is_named(tmp_path, ds, options, name):
    path = stored(ds, tmp_path / "data.zarr", encoding={name: {"chunks": (4,)}}, **options)
    last = sorted(file for file in (path / name).rglob("1") if file.is_file())[-1]
    last.unlink()
    key = last.relative_to(path).as_posix()
    with pytest.raises(DataError, match=rf"data\.zarr: the chunk {key} is missing \(2 are needed\)"):
        read(path)


@pytest.mark.parametrize("options", VERSIONS)
def test_a_chunk_that_is_cut_off_is_named(tmp_path, ds, options):
    for encoding in (None, {"I": {"compressors": None}}):
        path = stored(ds, tmp_path / "data.zarr", encoding=encoding, **options)
        chunk = path / ("I/c/0" if options["zarr_format"] == 3 else "I/0")
        for keep in (chunk.stat().st_size // 2, 3, 0):
            chunk.write_bytes(chunk.read_bytes()[:keep])
            with pytest.raises(
                DataError, match=r"data\.zarr: (the chunk I/.* cut off|cannot be read as Zarr)"
            ):
                read(path)
        shutil.rmtree(path)


def test_a_missing_array_is_named_where_the_folder_lists_it(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    shutil.rmtree(tmp_path / "data.zarr" / "Q")
    with pytest.raises(DataError, match=r"data\.zarr: the array 'Q' is missing, though \.zmetadata lists it"):
        read(tmp_path / "data.zarr")
    path = tmp_path / "third.zarr"
    with pytest.warns(Warning, match=r"."):
        ds.to_zarr(path, zarr_format=3, consolidated=True, write_empty_chunks=True)
    require_complete(path)
    shutil.rmtree(path / "Q")
    with pytest.raises(DataError, match=r"third\.zarr: the array 'Q' is missing, though zarr\.json lists it"):
        read(path)


def test_what_this_package_writes_holds_chunks_of_nothing_but_the_fill_value(tmp_path):
    nothing = make_dataset(0.0, 0.0, 0.0, quantity="brdf", I=np.nan, wavelength=np.nan)
    write(nothing, tmp_path / "data.zarr")
    assert read(tmp_path / "data.zarr").identical(nothing)


def test_declared_sizes_are_compared_with_the_folder(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    file = tmp_path / "data.zarr" / "I" / ".zarray"
    described = json.loads(file.read_text(encoding="utf-8"))
    for change, words in (
        ({"shape": [10**12], "chunks": [10**12]}, "where 8000000000000 are needed|declares array of 8000 GB"),
        ({"shape": [10**12]}, "the chunk I/1 is missing"),
        (
            {"shape": "six"},
            r"\.zarray: not the description of an array \('six' are no lengths\): it is damaged",
        ),
        ({"shape": [True]}, "are no lengths"),
        ({"chunks": [0]}, "are no lengths"),
        ({"chunks": [6, 6]}, "chunks .6, 6. of an array of the shape .6."),
        ({"dimension_separator": 5}, "dimension_separator is 5"),
        ({"dtype": {"a": 1}}, "cannot be read as Zarr"),
        ({"compressor": 3}, "not the description of an array"),
    ):
        file.write_text(json.dumps(described | change), encoding="utf-8")
        with pytest.raises(DataError, match=words):
            read(tmp_path / "data.zarr")
    file.write_text("{", encoding="utf-8")
    with pytest.raises(DataError, match=r"\.zarray: not JSON"):
        read(tmp_path / "data.zarr")


def test_frames_that_lost_a_chunk_are_refused(tmp_path):
    from pbrdf.instruments.frames.frame_grids import open_grid

    frames = xr.Dataset({"frames": (("state", "y", "x"), np.arange(48, dtype=np.uint16).reshape(2, 4, 6))})
    path = tmp_path / "frames.zarr"
    stored(frames, path, zarr_format=2, encoding={"frames": {"chunks": (1, 4, 6)}})
    assert open_grid(path, ("a", "b")).read(0, 0, 4).shape == (2, 4, 6)
    (path / "frames" / "1.0.0").unlink()
    with pytest.raises(DataError, match=r"frames\.zarr: the chunk frames/1\.0\.0 is missing"):
        open_grid(path, ("a", "b"))


def test_a_folder_without_rights_or_of_another_kind_is_no_traceback(tmp_path):
    (tmp_path / "data.zarr").mkdir()
    (tmp_path / "data.zarr" / ".zgroup").write_text("[]", encoding="utf-8")
    with pytest.raises(pbrdf.PbrdfError, match=r"data\.zarr"):
        read(tmp_path / "data.zarr")
