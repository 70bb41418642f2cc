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
    stored(ds, tmp_path / "second.zarr", **VERSIONS[0])
    for name, words in (("data", r"zarr\.json"), ("second", r"\.zmetadata")):
        path = tmp_path / f"{name}.zarr"
        shutil.rmtree(path / "Q")
        with pytest.raises(
            DataError, match=rf"{name}\.zarr: the array 'Q' is missing, though {words} lists it"
        ):
            read(path)


@pytest.fixture
def sharded(tmp_path):
    """7 x 9 numbers in shards of 4 x 6 with chunks of 2 x 3: the last ones reach beyond the array."""
    numbers = np.random.default_rng(1).normal(size=(7, 9))
    ds = xr.Dataset({"I": (("y", "x"), numbers)})

    def made(**encoding):
        encoding = {"shards": (4, 6), "chunks": (2, 3)} | encoding
        path = stored(ds, tmp_path / "s.zarr", zarr_format=3, consolidated=False, encoding={"I": encoding})
        assert sorted(file.name for file in (path / "I" / "c").rglob("*") if file.is_file()) == list("0011")
        return path

    return made


@pytest.mark.parametrize("codecs", [{}, {"compressors": None}, {"compressors": "blosc"}])
def test_a_shard_that_is_missing_cut_off_or_lacks_a_chunk_is_named(sharded, codecs):
    if codecs.get("compressors") == "blosc":
        from zarr.codecs import BloscCodec

        codecs = {"compressors": BloscCodec(cname="lz4")}
    path = sharded(**codecs)
    shard = path / "I" / "c" / "1" / "0"
    content = shard.read_bytes()
    index = len(content) - 16 * 4 - 4
    for keep in (*range(0, len(content), 7), index, len(content) - 1):
        shard.write_bytes(content[:keep])
        with pytest.raises(DataError, match=r"s\.zarr: the chunk I/c/1/0 .*(cut off|lacks|damaged)"):
            require_complete(path)
    for place, words in ((0, "lacks 1 of the 4"), (3, "lacks 1 of the 4")):
        holed = bytearray(content)
        holed[index + 16 * place : index + 16 * (place + 1)] = b"\xff" * 16
        shard.write_bytes(holed)
        with pytest.raises(DataError, match=rf"I/c/1/0 {words}"):
            require_complete(path)
    for at, value in ((0, 2**40), (8, 2**40), (8, 2**64 - 2), (8, 0)):
        holed = bytearray(content)
        holed[index + at : index + at + 8] = value.to_bytes(8, "little")
        shard.write_bytes(holed)
        if value or "compressors" in codecs:
            with pytest.raises(DataError, match=r"I/c/1/0 .*damaged"):
                require_complete(path)
    shard.unlink()
    with pytest.raises(DataError, match=r"the chunk I/c/1/0 is missing \(4 are needed\)"):
        require_complete(path)


def test_a_shard_with_its_index_first_and_one_whose_index_cannot_be_read(sharded):
    from zarr.codecs import ShardingCodec

    codec = ShardingCodec(chunk_shape=(2, 3), index_location="start")
    path = sharded(chunks=(4, 6), shards=None, serializer=codec, compressors=None, filters=None)
    shard = path / "I" / "c" / "0" / "1"
    content = shard.read_bytes()
    for keep in (len(content) - 1, 67, 0):
        shard.write_bytes(content[:keep])
        with pytest.raises(DataError, match=r"I/c/0/1 .*cut off"):
            require_complete(path)
    shard.write_bytes(content)
    file = path / "I" / "zarr.json"
    described = json.loads(file.read_text(encoding="utf-8"))
    configuration = described["codecs"][0]["configuration"]
    configuration["index_codecs"].append({"name": "gzip"})
    file.write_text(json.dumps(described), encoding="utf-8")
    require_complete(path)
    configuration["chunk_shape"] = [3, 3]
    file.write_text(json.dumps(described), encoding="utf-8")
    with pytest.raises(DataError, match=r"chunks \[3, 3\] of a shard of the shape \[4, 6\]"):
        require_complete(path)


@pytest.mark.parametrize("numbers", ["noise", "constant", "few"])
def test_every_cut_of_a_zstandard_file_is_found(tmp_path, numbers):
    values = {
        "noise": np.random.default_rng(2).normal(size=40_000),
        "constant": np.full(100_000, 1.5),
        "few": np.arange(3.0),
    }[numbers]
    from zarr.codecs import ZstdCodec

    for codec in (ZstdCodec(level=0), ZstdCodec(level=3, checksum=True)):
        path = stored(
            xr.Dataset({"I": ("y", values)}),
            tmp_path / "z.zarr",
            zarr_format=3,
            consolidated=False,
            encoding={"I": {"compressors": codec, "chunks": values.shape}},
        )
        chunk = path / "I" / "c" / "0"
        content = chunk.read_bytes()
        step = max(len(content) // 50, 1)
        for keep in [*range(min(len(content), 40)), *range(40, len(content), step), len(content) - 1]:
            chunk.write_bytes(content[:keep])
            with pytest.raises(DataError, match=r"the chunk I/c/0 .*cut off"):
                require_complete(path)
        for other, words in (
            (content + b"\0", "is damaged"),
            (b"\0" + content[1:], "does not begin as Zstandard"),
        ):
            chunk.write_bytes(other)
            with pytest.raises(DataError, match=words):
                require_complete(path)


def test_what_this_package_writes_holds_chunks_of_nothing_but_the_fill_value(tmp_path):
    nothing = make_dataset(0.0, 0.0, 0.0, quantity="brdf", I=np.nan, wavelength=np.nan)
    write(nothing, tmp_path / "data.zarr")
    assert read(tmp_path / "data.zarr").identical(nothing)


def test_declared_sizes_are_compared_with_the_folder(tmp_path, ds):
    stored(ds, tmp_path / "data.zarr", **VERSIONS[0])
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
        ({"shape": [10**400]}, "are no lengths"),
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


def test_declared_sizes_of_the_third_version_are_compared_with_the_folder(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    file = tmp_path / "data.zarr" / "I" / "zarr.json"
    described = json.loads(file.read_text(encoding="utf-8"))
    grid = {"name": "regular", "configuration": {"chunk_shape": [10**12]}}
    for change, words in (
        ({"shape": [10**12], "chunk_grid": grid}, "holds 48 bytes where 8000000000000 are needed"),
        ({"shape": [10**12]}, "the chunk I/c/1 is missing"),
        ({"shape": [6, 6]}, "not the description of an array .chunks .6. of an array of the shape .6, 6."),
        ({"codecs": []}, "not the description of an array"),
    ):
        file.write_text(json.dumps(described | change), encoding="utf-8")
        with pytest.raises(DataError, match=words):
            read(tmp_path / "data.zarr")


def test_frames_that_lost_a_chunk_are_refused(tmp_path):
    from pbrdf.instruments.frames.frame_grids import open_grid

    frames = xr.Dataset({"frames": (("state", "y", "x"), np.arange(48, dtype=np.uint16).reshape(2, 4, 6))})
    path = tmp_path / "frames.zarr"
    encoding = {"frames": {"chunks": (1, 4, 6)}}
    for options, chunk in zip(VERSIONS, ("1.0.0", "c/1/0/0"), strict=True):
        stored(frames, path, encoding=encoding, **options)
        assert open_grid(path, ("a", "b")).read(0, 0, 4).shape == (2, 4, 6)
        (path / "frames" / chunk).unlink()
        with pytest.raises(DataError, match=rf"frames\.zarr: the chunk frames/{chunk} is missing"):
            open_grid(path, ("a", "b"))
        shutil.rmtree(path)


def test_a_folder_without_rights_or_of_another_kind_is_no_traceback(tmp_path):
    (tmp_path / "data.zarr").mkdir()
    (tmp_path / "data.zarr" / ".zgroup").write_text("[]", encoding="utf-8")
    with pytest.raises(pbrdf.PbrdfError, match=r"data\.zarr"):
        read(tmp_path / "data.zarr")
