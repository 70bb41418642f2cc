"""Whether a Zarr folder holds all that it declares.

Zarr reads a chunk that is not there as the fill value, so a folder of which a file was lost reads as whole. Here every
array's chunks are counted: each one that its metadata call for must be there, and as long as they say where that is
known: without a compressor, for Blosc, whose header states it, and for Zstandard, whose blocks state theirs (RFC 8878).
A shard, a file of many chunks, must hold each of them between its ends as its index says. The formats are those of the
Zarr specifications, version 2 (``.zarray``, ``.zmetadata``) and 3 (``zarr.json``, codec ``sharding_indexed``).
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.hdf5_guard import available_memory
from pbrdf.files.hdf5_probe import ALWAYS_ALLOWED, amount
from pbrdf.files.plain_numbers import json_from_text

__all__ = ["StoredArray", "array_names", "require_complete"]

#: The strongest compressors pack some ten thousand equal bytes into one.
_MOST_TIMES_ITS_SIZE = 100_000
#: Version, version of the codec, flags, size of an item; bytes unpacked, in a block, packed.
_BLOSC_HEADER = struct.Struct("<4B3I")
#: What a frame of Zstandard begins with, and how much of it is its header at most.
_ZSTD_MAGIC, _ZSTD_HEADER = b"\x28\xb5\x2f\xfd", 18
#: Offset and length of a chunk that a shard does not hold.
_NOT_THERE = 2**64 - 1


@dataclass(frozen=True)
class _Shards:
    """The chunks in a shard: their shape, codec, and where the index stands, of how many bytes beyond its entries."""

    chunks: tuple[int, ...]
    codec: str
    at_start: bool
    besides: int


@dataclass(frozen=True)
class StoredArray:
    """What the metadata of an array declare.

    Attributes
    ----------
    path, name
        The group's folder and the array's name in it.
    shape, chunks
        Of the array and of what a file holds of it.
    item
        The size of a number, None where it is not known.
    separator, prefix
        Of the names of files.
    codec
        What packs a file: ``"none"``, ``"crc32c"``, ``"blosc"``, ``"zstd"``, or another.
    shards
        What a file holds where it is a shard.
    """

    path: Path
    name: str
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    item: int | None
    separator: str
    prefix: str
    codec: str
    shards: _Shards | None = None

    @classmethod
    def of(cls, path: Path, name: str) -> StoredArray:
        """Read what is declared; raises DataError if that is damaged and OSError if it cannot be read."""
        folder = path / name
        file = folder / ".zarray" if (folder / ".zarray").is_file() else folder / "zarr.json"
        content = _json(file)
        try:
            return cls(path, name, *(_second_version if file.name == ".zarray" else _third_version)(content))
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise DataError(f"{file}: not the description of an array ({error}): it is damaged") from error

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of files along each dimension."""
        return tuple(-(-length // chunk) for length, chunk in zip(self.shape, self.chunks, strict=True))

    @property
    def count(self) -> int:
        """Number of files."""
        return 0 if 0 in self.shape else math.prod(self.grid)

    def indices(self) -> Iterator[tuple[int, ...]]:
        """Places of all files in the grid."""
        grid = self.grid
        for number in range(self.count):  # itertools.product would list the ranges, however long
            index = []
            for length in reversed(grid):
                number, i = divmod(number, length)
                index.append(i)
            yield tuple(reversed(index))

    def key(self, index: tuple[int, ...]) -> str:
        """Name of a file, relative to the array's folder."""
        if not self.shape:
            return self.prefix or "0"
        start = f"{self.prefix}{self.separator}" if self.prefix else ""
        return start + self.separator.join(map(str, index))

    def file(self, index: tuple[int, ...]) -> Path:
        """A file of the array."""
        return self.path / self.name / self.key(index)

    def require_chunk(self, index: tuple[int, ...]) -> int:
        """Check one file; returns its size.

        Raises
        ------
        DataError
            If it is missing, cut off or damaged; names it.
        """
        where = f"{self.path}: the chunk {self.name}/{self.key(index)}"
        file = self.file(index)
        try:
            size = os.stat(file).st_size  # noqa: PTH116  one call a chunk
        except (FileNotFoundError, NotADirectoryError):
            raise DataError(
                f"{where} is missing ({self.count} are needed); if it was left out because it holds nothing but the "
                "fill value, write the folder again with write_empty_chunks=True"
            ) from None
        if self.shards is not None:
            self._check_shard(file, where, size, index)
        elif self.codec in ("none", "crc32c", "blosc", "zstd"):
            whole = None if self.item is None else math.prod(self.chunks) * self.item
            _check_packed(file, where, size, self.codec, whole)
        if not size:
            raise DataError(f"{where} is empty: it is cut off")
        return size

    def _check_shard(self, file: Path, where: str, size: int, index: tuple[int, ...]) -> None:
        """Check that a shard holds the chunks that the array reaches, each between its ends."""
        shards = self.shards
        assert shards is not None
        inner = tuple(outer // chunk for outer, chunk in zip(self.chunks, shards.chunks, strict=True))
        entries = 16 * math.prod(inner)
        stored = size - entries - shards.besides
        if stored < 0:
            raise DataError(f"{where} has {size} bytes, less than its index: it is cut off")
        with file.open("rb") as opened:
            opened.seek(0 if shards.at_start else stored)
            table = np.frombuffer(opened.read(entries), "<u8").reshape(*inner, 2)
        # chunks that lie beyond the end of the array are not needed
        reached: tuple[Any, ...] = tuple(
            slice(min(-(-(length - i * outer) // chunk), most))
            for length, i, outer, chunk, most in zip(
                self.shape, index, self.chunks, shards.chunks, inner, strict=True
            )
        )
        offset, length = table[(*reached, 0)].ravel(), table[(*reached, 1)].ravel()
        missing = int(((offset == _NOT_THERE) & (length == _NOT_THERE)).sum())
        if missing:
            raise DataError(f"{where} lacks {missing} of the {len(offset)} chunks that it should hold")
        first = entries + shards.besides if shards.at_start else 0
        # compared without sums, which would run over
        if (
            (offset < first).any()
            or (offset > first + stored).any()
            or (length > first + stored - offset).any()
        ):
            raise DataError(
                f"{where} has {size} bytes, which its index does not fit: it is cut off or damaged"
            )
        whole = None if self.item is None else math.prod(shards.chunks) * self.item
        extra = {"none": 0, "crc32c": 4}.get(shards.codec)
        fit = length > 0 if whole is None or extra is None else length == whole + extra
        if not fit.all():
            raise DataError(f"{where} holds chunks of another size than the array's: it is damaged")


def require_complete(path: Path, *, loaded: bool = True) -> None:
    """Check the arrays of the group that a folder is.

    Parameters
    ----------
    path
        The folder.
    loaded
        Whether all of it is going to be in memory.

    Raises
    ------
    DataError
        If an array or a chunk is missing or cut off, or an array declares what the folder cannot hold; names it.
    """
    try:
        names = array_names(path)
        total = 0
        for name in names:
            total += _check_array(StoredArray.of(path, name))
    except OSError as error:
        raise DataError(
            f"{error.filename or path}: cannot be read: {error.strerror or error}; the Zarr folder is not complete"
        ) from error
    if loaded and total > (available := available_memory()):
        raise DataError(
            f"{path}: its arrays take {amount(total)} of memory, of which {amount(available)} are left"
        )


def array_names(path: Path) -> list[str]:
    """Names of the arrays of a group; raises DataError if one is missing that its list of contents names."""
    names = [
        entry.name
        for entry in sorted(path.iterdir())
        if (entry / ".zarray").is_file() or _kind(entry / "zarr.json") == "array"
    ]
    listed: Any = {}
    for file, suffix in ((path / ".zmetadata", "/.zarray"), (path / "zarr.json", "")):
        if not file.is_file():
            continue
        content = _json(file)
        content = content.get("consolidated_metadata") or {} if not suffix else content
        listed = content.get("metadata", {}) if isinstance(content, dict) else None
        if not isinstance(listed, dict):
            raise DataError(f"{file}: its list of arrays has another form: it is damaged")
        for key, described in listed.items():
            is_array = key.endswith(suffix) if suffix else _node_type(described) == "array"
            name = key.removesuffix(suffix)
            if is_array and "/" not in name and name not in names:
                raise DataError(f"{path}: the array {name!r} is missing, though {file.name} lists it")
    return names


def _kind(file: Path) -> Any:
    return _node_type(_json(file)) if file.is_file() else None


def _node_type(content: Any) -> Any:
    return content.get("node_type") if isinstance(content, dict) else None


def _json(file: Path) -> Any:
    try:
        return json_from_text(file.read_bytes())
    except ValueError as error:
        raise DataError(f"{file}: not JSON ({error}): the Zarr folder is damaged") from error


def _check_array(array: StoredArray) -> int:
    """Check one array; returns the bytes that it takes in memory."""
    stored = sum(array.require_chunk(index) for index in array.indices())
    item = array.item or 1
    most = max(ALWAYS_ALLOWED, _MOST_TIMES_ITS_SIZE * stored)
    for what, lengths in (("array", array.shape), ("chunks", array.chunks)):
        if array.count and math.prod(lengths) * item > most:
            raise DataError(
                f"{array.path}: {array.name} declares {what} of {amount(math.prod(lengths) * item)}, which its files "
                f"of {amount(stored)} cannot hold: it is damaged"
            )
    return math.prod(array.shape) * item


def _check_packed(chunk: Path, where: str, size: int, codec: str, whole: int | None) -> None:
    """Check a file of `size` bytes that a codec has made of `whole` bytes."""
    if codec == "blosc":
        with chunk.open("rb") as file:
            header = file.read(_BLOSC_HEADER.size)
        if len(header) < _BLOSC_HEADER.size:
            raise DataError(f"{where} has {size} bytes, less than its header: it is cut off")
        *_, unpacked, _, wanted = _BLOSC_HEADER.unpack(header)
    elif codec == "zstd":
        unpacked, wanted = _zstd_lengths(chunk, where, size)
    else:
        unpacked, wanted = whole, None if whole is None else whole + (4 if codec == "crc32c" else 0)
    if None not in (whole, unpacked) and unpacked != whole:
        raise DataError(f"{where} holds {unpacked} bytes where {whole} are needed: it is damaged")
    if wanted is not None and size != wanted:
        state = "cut off" if size < wanted else "damaged"
        raise DataError(f"{where} has {size} bytes where {wanted} are needed: it is {state}")


def _zstd_lengths(chunk: Path, where: str, size: int) -> tuple[int | None, int]:
    """Bytes that the Zstandard frame of a file unpacks to, if it says so, and how long the frame is.

    Past the end of the file nothing is known: the length is then the least that is needed.
    """
    with chunk.open("rb") as file:
        head = file.read(_ZSTD_HEADER)
        if size < 5:
            raise DataError(f"{where} has {size} bytes, less than its header: it is cut off")
        if head[:4] != _ZSTD_MAGIC:
            raise DataError(f"{where} does not begin as Zstandard does: it is damaged")
        descriptor = head[4]
        single, checksum = descriptor >> 5 & 1, descriptor >> 2 & 1
        at = 5 + (1 - single) + (0, 1, 2, 4)[descriptor & 3]
        width = (single, 2, 4, 8)[descriptor >> 6]
        unpacked = (
            int.from_bytes(head[at : at + width], "little") + (256 if width == 2 else 0) if width else None
        )
        at += width
        last = False
        while not last:
            file.seek(at)
            block = int.from_bytes(file.read(3), "little")
            if at + 3 > size:
                return None, at + 3
            last, kind, length = bool(block & 1), block >> 1 & 3, block >> 3
            if kind == 3:
                raise DataError(f"{where} holds a block of no known kind: it is damaged")
            at += 3 + (1 if kind == 1 else length)
    return unpacked, at + 4 * checksum


def _lengths(value: Any, least: int) -> tuple[int, ...]:
    if not isinstance(value, list) or not all(type(v) is int and least <= v < 2**63 for v in value):
        raise ValueError(f"{value!r} are no lengths")
    return tuple(value)


def _second_version(content: Any) -> tuple[Any, ...]:
    """Attributes of a :class:`StoredArray` from its shape on."""
    shape, chunks = _lengths(content["shape"], 0), _lengths(content["chunks"], 1)
    if len(shape) != len(chunks):
        raise ValueError(f"chunks {list(chunks)} of an array of the shape {list(shape)}")
    separator = content.get("dimension_separator", ".")
    if separator not in (".", "/"):
        raise ValueError(f"dimension_separator is {separator!r}")
    dtype = content["dtype"]
    plain = isinstance(dtype, str) and not content.get("filters") and np.dtype(dtype).kind != "O"
    compressor = content.get("compressor")
    return (
        shape,
        chunks,
        np.dtype(dtype).itemsize if plain else None,
        separator,
        "",
        "none" if compressor is None else str(compressor["id"]),
    )


def _third_version(content: Any) -> tuple[Any, ...]:
    """Attributes of a :class:`StoredArray` from its shape on."""
    shape = _lengths(content["shape"], 0)
    grid, encoding = content["chunk_grid"], content.get("chunk_key_encoding", {"name": "default"})
    if grid["name"] != "regular":
        raise ValueError(f"the chunk grid {grid['name']!r} is not known")
    chunks = _lengths(grid["configuration"]["chunk_shape"], 1)
    if len(shape) != len(chunks):
        raise ValueError(f"chunks {list(chunks)} of an array of the shape {list(shape)}")
    default = encoding["name"] == "default"
    separator = encoding.get("configuration", {}).get("separator", "/" if default else ".")
    if separator not in (".", "/"):
        raise ValueError(f"the separator of chunks is {separator!r}")
    dtype, item = content["data_type"], None
    if isinstance(dtype, str) and dtype not in ("string", "bytes"):
        item = np.dtype(dtype).itemsize
    codecs = content["codecs"]
    names = [str(codec["name"]) for codec in codecs]
    shards = _shards(codecs[0]["configuration"], chunks) if names == ["sharding_indexed"] else None
    return shape, chunks, item, separator, "c" if default else "", _last_codec(names), shards


def _last_codec(names: list[str]) -> str:
    """What packs the bytes of an array: one codec behind ``bytes`` or what stores text; else ``"other"``."""
    if names[0] not in ("bytes", "vlen-utf8", "vlen-bytes") or len(names) > 2:
        return "other"
    return names[1] if len(names) == 2 else "none"


def _shards(configuration: Any, shard: tuple[int, ...]) -> _Shards | None:
    """What is in a shard, None where its index cannot be read without its codecs."""
    chunks = _lengths(configuration["chunk_shape"], 1)
    if len(chunks) != len(shard) or any(s % c for s, c in zip(shard, chunks, strict=True)):
        raise ValueError(f"chunks {list(chunks)} of a shard of the shape {list(shard)}")
    index = [
        (str(codec["name"]), codec.get("configuration", {}).get("endian", "little"))
        for codec in configuration["index_codecs"]
    ]
    if index not in ([("bytes", "little")], [("bytes", "little"), ("crc32c", "little")]):
        return None
    return _Shards(
        chunks,
        _last_codec([str(codec["name"]) for codec in configuration["codecs"]]),
        configuration.get("index_location", "end") == "start",
        4 * (len(index) - 1),
    )
