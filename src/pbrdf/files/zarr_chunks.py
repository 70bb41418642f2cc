"""Whether a Zarr folder holds all that it declares.

Zarr reads a chunk that is not there as the fill value, so a folder of which a file was lost reads as whole. Here every
array's chunks are counted: each one that its metadata call for must be there, and as long as they say where that is
known (without a compressor, and for Blosc, whose header states it). The formats are those of the Zarr specifications,
version 2 (``.zarray``, ``.zmetadata``) and 3 (``zarr.json``).
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

__all__ = ["require_complete"]

#: The strongest compressors pack some ten thousand equal bytes into one.
_MOST_TIMES_ITS_SIZE = 100_000
#: Version, version of the codec, flags, size of an item; bytes unpacked, in a block, packed.
_BLOSC_HEADER = struct.Struct("<4B3I")


@dataclass(frozen=True)
class _Array:
    """What the metadata of an array declare; `item` is the size of a number, None where it is not known."""

    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    item: int | None
    separator: str
    prefix: str
    codec: str

    @property
    def grid(self) -> tuple[int, ...]:
        return tuple(-(-length // chunk) for length, chunk in zip(self.shape, self.chunks, strict=True))

    def keys(self) -> Iterator[str]:
        """Names of the files of all chunks."""
        if not self.shape:
            yield self.prefix or "0"
            return
        start = f"{self.prefix}{self.separator}" if self.prefix else ""
        grid = self.grid
        for number in range(math.prod(grid)):  # itertools.product would list the ranges, however long
            index = []
            for length in reversed(grid):
                number, i = divmod(number, length)
                index.append(str(i))
            yield start + self.separator.join(reversed(index))


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
        names = _arrays(path)
        total = 0
        for name in names:
            total += _check_array(path, name)
    except OSError as error:
        raise DataError(
            f"{error.filename or path}: cannot be read: {error.strerror or error}; the Zarr folder is not complete"
        ) from error
    if loaded and total > (available := available_memory()):
        raise DataError(
            f"{path}: its arrays take {amount(total)} of memory, of which {amount(available)} are left"
        )


def _arrays(path: Path) -> list[str]:
    """Names of the arrays of a group, those that its list of contents names among them."""
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


def _check_array(path: Path, name: str) -> int:
    """Check one array; returns the bytes that it takes in memory."""
    folder = path / name
    file = folder / ".zarray" if (folder / ".zarray").is_file() else folder / "zarr.json"
    content = _json(file)
    try:
        array = _second_version(content) if file.name == ".zarray" else _third_version(content)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise DataError(f"{file}: not the description of an array ({error}): it is damaged") from error
    needed = 0 if 0 in array.shape else math.prod(array.grid)
    stored = held = 0
    for key in array.keys() if needed else ():
        chunk = folder / key
        try:
            size = os.stat(chunk).st_size  # noqa: PTH116  one call a chunk
        except (FileNotFoundError, NotADirectoryError):
            raise DataError(
                f"{path}: the chunk {name}/{key} is missing ({needed} are needed); if it was left out because it holds "
                "nothing but the fill value, write the folder again with write_empty_chunks=True"
            ) from None
        held, stored = held + 1, stored + size
        _check_chunk(chunk, f"{path}: the chunk {name}/{key}", size, array)
    item = array.item or 1
    most = max(ALWAYS_ALLOWED, _MOST_TIMES_ITS_SIZE * stored)
    for what, lengths in (("array", array.shape), ("chunks", array.chunks)):
        if needed and math.prod(lengths) * item > most:
            raise DataError(
                f"{path}: {name} declares {what} of {amount(math.prod(lengths) * item)}, which its files of "
                f"{amount(stored)} cannot hold: it is damaged"
            )
    return math.prod(array.shape) * item


def _check_chunk(chunk: Path, where: str, size: int, array: _Array) -> None:
    whole = None if array.item is None else math.prod(array.chunks) * array.item
    wanted = None
    if array.codec in ("none", "crc32c"):
        wanted = None if whole is None else whole + (4 if array.codec == "crc32c" else 0)
    elif array.codec == "blosc":
        with chunk.open("rb") as file:
            header = file.read(_BLOSC_HEADER.size)
        if len(header) < _BLOSC_HEADER.size:
            raise DataError(f"{where} has {size} bytes, less than its header: it is cut off")
        *_, unpacked, _, wanted = _BLOSC_HEADER.unpack(header)
        if whole is not None and unpacked != whole:
            raise DataError(f"{where} holds {unpacked} bytes where {whole} are needed: it is damaged")
    if wanted is not None and size != wanted:
        state = "cut off" if size < wanted else "damaged"
        raise DataError(f"{where} has {size} bytes where {wanted} are needed: it is {state}")
    if not size:
        raise DataError(f"{where} is empty: it is cut off")


def _lengths(value: Any, least: int) -> tuple[int, ...]:
    if not isinstance(value, list) or not all(type(v) is int and v >= least for v in value):
        raise ValueError(f"{value!r} are no lengths")
    return tuple(value)


def _second_version(content: Any) -> _Array:
    shape, chunks = _lengths(content["shape"], 0), _lengths(content["chunks"], 1)
    if len(shape) != len(chunks):
        raise ValueError(f"chunks {list(chunks)} of an array of the shape {list(shape)}")
    separator = content.get("dimension_separator", ".")
    if separator not in (".", "/"):
        raise ValueError(f"dimension_separator is {separator!r}")
    dtype = content["dtype"]
    plain = isinstance(dtype, str) and not content.get("filters") and np.dtype(dtype).kind != "O"
    compressor = content.get("compressor")
    return _Array(
        shape,
        chunks,
        np.dtype(dtype).itemsize if plain else None,
        separator,
        "",
        "none" if compressor is None else str(compressor["id"]),
    )


def _third_version(content: Any) -> _Array:
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
    codecs = [str(codec["name"]) for codec in content["codecs"]]
    codec = codecs[-1] if len(codecs) > 1 else "none"
    if "sharding_indexed" in codecs or (codec == "crc32c" and len(codecs) > 2):
        codec = "other"
    return _Array(shape, chunks, item, separator, "c" if default else "", codec)
