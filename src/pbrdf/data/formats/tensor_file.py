"""Mitsuba's tensor files: named arrays in one binary file.

Little-endian. ``tensor_file`` and a zero byte, version 1.0 as two bytes, the number of fields (uint32); then for
each field the length of its name (uint16), the name, the number of dimensions (uint16), the type (uint8), the
offset of its values from the start of the file (uint64) and the shape (uint64 each). The values stand in C order.
Source: ``src/core/tensor.cpp`` of Mitsuba 3.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.text import first_bytes

__all__ = ["is_tensor_file", "read_tensors", "write_tensors"]

_MAGIC = b"tensor_file\0"
_HEADER = struct.Struct("<12s2BI")
#: The enumeration of Mitsuba's ``Struct::Type``, from 1.
_TYPES = ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")
_ALIGNMENT = 8
#: More than an array can have in any version of NumPy are damage.
_MOST_DIMENSIONS = 32


def is_tensor_file(path: Path) -> bool:
    """Whether a file begins as a tensor file."""
    return first_bytes(path, len(_MAGIC)) == _MAGIC


def read_tensors(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a tensor file by name, mapped from the file: nothing is loaded before it is used.

    Raises
    ------
    DataError
        If the file cannot be read, is no tensor file or is truncated.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            fields = _read_fields(file.read(_HEADER.size), file, path)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    arrays: dict[str, NDArray[Any]] = {}
    for name, (kind, offset, shape) in fields.items():
        if len(shape) > _MOST_DIMENSIONS or max(shape, default=0) > size:
            raise DataError(f"{path}: the field {name!r} has the shape {shape}: the file is damaged")
        stop = offset + kind.itemsize * math.prod(shape)
        if stop > size:
            raise DataError(
                f"{path}: the field {name!r} should end at byte {stop}, but the file ends at {size}: it is "
                "truncated"
            )
        if math.prod(shape):
            arrays[name] = np.memmap(path, kind, "r", offset, shape)
        else:
            arrays[name] = np.empty(shape, kind)
    return arrays


def _read_fields(header: bytes, file: Any, path: Path) -> dict[str, tuple[np.dtype, int, tuple[int, ...]]]:
    if not header.startswith(_MAGIC):
        raise DataError(f"{path}: this is not a tensor file: it does not begin with 'tensor_file'")
    if len(header) < _HEADER.size:
        raise DataError(f"{path}: the file ends within its header: it is truncated")
    _, major, minor, count = _HEADER.unpack(header)
    if (major, minor) != (1, 0):
        raise DataError(f"{path}: version {major}.{minor} of tensor files is not known, only 1.0")

    def take(layout: str) -> tuple[Any, ...]:
        data = file.read(struct.calcsize(layout))
        if len(data) < struct.calcsize(layout):
            raise DataError(f"{path}: the file ends within its header: it is truncated")
        return struct.unpack(layout, data)

    fields = {}
    for _ in range(count):
        (length,) = take("<H")
        (raw,) = take(f"<{length}s")
        name = raw.decode("utf-8", errors="replace")
        ndim, kind, offset = take("<HBQ")
        shape = take(f"<{ndim}Q")
        if not 1 <= kind <= len(_TYPES):
            raise DataError(f"{path}: the field {name!r} has the unknown type {kind}: the file is damaged")
        fields[name] = (np.dtype(_TYPES[kind - 1]), offset, shape)
    return fields


def write_tensors(arrays: Mapping[str, NDArray[Any]], path: Path) -> None:
    """Write arrays as a tensor file, in their order; it replaces `path` when complete.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    names = {name: name.encode() for name in arrays}
    stored = {name: np.ascontiguousarray(a, a.dtype.newbyteorder("<")) for name, a in arrays.items()}
    offset = _HEADER.size + sum(2 + len(names[n]) + 2 + 1 + 8 + 8 * a.ndim for n, a in stored.items())
    header = [_HEADER.pack(_MAGIC, 1, 0, len(stored))]
    starts = {}
    for name, array in stored.items():
        offset += -offset % _ALIGNMENT
        starts[name] = offset
        kind = [np.dtype(t) for t in _TYPES].index(array.dtype) + 1
        header.append(struct.pack("<H", len(names[name])) + names[name])
        header.append(struct.pack(f"<HBQ{array.ndim}Q", array.ndim, kind, offset, *array.shape))
        offset += array.nbytes
    with atomic_file(path) as beside, beside.open("wb") as file:
        file.write(b"".join(header))
        for name, array in stored.items():
            file.seek(starts[name])
            file.write(array.data)
