"""MATLAB's files up to version 7: their arrays of real numbers, and nothing else of them.

"MAT-File Format" (The MathWorks), level 5. 128 bytes of header, of which the last four are the version, 0x0100, and
``IM`` where numbers are little-endian, ``MI`` where they are big-endian. Then data elements: type and number of bytes
as two uint32, and the bytes, padded to 8; of small ones both stand in the halves of one uint32 and up to 4 bytes
follow. An element of type 15 is a deflated other one, one of type 14 an array: flags with its class, dimensions, name
and the numbers, in any type that holds them, the first dimension running fastest.

Read here and not by SciPy, whose reader lets damaged files crash the interpreter. Nothing is allocated by a count that
the file declares: it is compared with what is there.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from pbrdf.errors import DataError

__all__ = ["Mat5Array", "mat5_arrays"]

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
#: Classes of arrays of numbers: double, single, and the integers.
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800
#: Flags, dimensions and name of an array are looked for in so many bytes.
_DESCRIPTION = 4096


@dataclass(frozen=True)
class Mat5Array:
    """An array in a file, with what it takes to load it.

    Attributes
    ----------
    name, shape
        As MATLAB has them.
    is_real
        Whether it holds real numbers.
    """

    path: Path
    name: str
    shape: tuple[int, ...]
    is_real: bool
    _start: int
    _bytes: int
    _compressed: bool
    _numbers: int
    _order: str

    def load(self) -> NDArray[np.generic]:
        """The numbers, in the type that they are stored in.

        Raises
        ------
        DataError
            If they are not real numbers, or fewer than the shape declares.
        """
        if not self.is_real:
            raise DataError(f"{self.path}: the variable {self.name} does not hold real numbers")
        count = math.prod(self.shape)
        with self.path.open("rb") as file:
            data = _content(file, self, self._numbers + 8)
            kind, size, begin = _tag(data[self._numbers :], self._order, self.path)
            if kind not in _NUMBERS:
                raise _damaged(self.path, f"the numbers of {self.name} have the type {kind}")
            dtype = np.dtype(f"{self._order}{_NUMBERS[kind]}")
            if size != count * dtype.itemsize:
                raise _damaged(
                    self.path, f"{self.name} has {size} bytes of numbers for the shape {self.shape}"
                )
            first = self._numbers + begin
            data = _content(file, self, first + size)[first:]
        if len(data) < size:
            raise _damaged(self.path, f"the file ends within {self.name}: it is truncated")
        return np.frombuffer(data, dtype, count).reshape(self.shape, order="F")


def mat5_arrays(path: Path) -> list[Mat5Array]:
    """The arrays of a file, none of them loaded.

    Raises
    ------
    DataError
        If the file cannot be read, is of another level, or is damaged.
    """
    try:
        with path.open("rb") as file:
            return list(_arrays(file, path))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error


def _arrays(file: BinaryIO, path: Path) -> Iterator[Mat5Array]:
    size = path.stat().st_size
    header = file.read(_HEADER)
    order = {b"IM": "<", b"MI": ">"}.get(header[126:128], "")
    if len(header) < _HEADER or not order or struct.unpack(f"{order}H", header[124:126]) != (0x0100,):
        raise DataError(f"{path}: this is not a MATLAB file of version 5 to 7; save it with -v7 or -v7.3")
    while file.tell() < size:
        kind, count, begin = _tag(file.read(8), order, path)
        start = file.tell() - 8 + begin
        stop = start + count
        if stop > size:
            raise _damaged(
                path, f"an element should end at byte {stop}, but the file ends at {size}: it is truncated"
            )
        if kind in (_MATRIX, _COMPRESSED):
            array = _described(file, path, start, count, kind == _COMPRESSED, order)
            if array is not None:
                yield array
        file.seek(stop if kind == _COMPRESSED or begin == 4 else start + -(-count // 8) * 8)


def _described(
    file: BinaryIO, path: Path, start: int, count: int, compressed: bool, order: str
) -> Mat5Array | None:
    """The array whose element begins at a byte of the file; None if it has no name, as an object's parts."""
    blank = Mat5Array(path, "", (), False, start, count, compressed, 0, order)
    data = _content(file, blank, _DESCRIPTION)
    at = 8 if compressed else 0  # the tag of the element that is deflated
    parts = []
    for _ in range(3):
        kind, size, begin = _tag(data[at:], order, path)
        parts.append((kind, data[at + begin : at + begin + size]))
        if len(parts[-1][1]) < size:
            raise _damaged(path, "the description of an array is not whole")
        at += 8 if begin == 4 else begin + -(-size // 8) * 8
    (_, flags), (_, dimensions), (_, name) = parts
    if len(flags) < 4 or len(dimensions) % 4 or not dimensions:
        raise _damaged(path, "the description of an array is not understood")
    (word,) = struct.unpack(f"{order}I", flags[:4])
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    if min(shape) < 0:
        raise _damaged(path, f"an array has the shape {shape}")
    is_real = (word & 0xFF) in _NUMERIC and not word & _COMPLEX
    text = name.decode("ascii", errors="replace")
    return Mat5Array(path, text, shape, is_real, start, count, compressed, at, order) if text else None


def _content(file: BinaryIO, array: Mat5Array, most: int) -> bytes:
    """The first bytes of an array's element, inflated if need be."""
    file.seek(array._start)
    if not array._compressed:
        return file.read(min(most, array._bytes))
    try:
        return zlib.decompressobj().decompress(file.read(array._bytes), most)
    except zlib.error as error:
        raise _damaged(array.path, f"a compressed element cannot be unpacked: {error}") from error


def _tag(data: bytes, order: str, path: Path) -> tuple[int, int, int]:
    """Type and number of bytes of an element, and where these begin."""
    if len(data) < 8:
        raise _damaged(path, "the file ends within an element: it is truncated")
    kind, size = struct.unpack(f"{order}II", data[:8])
    if kind >> 16:
        return kind & 0xFFFF, kind >> 16, 4
    return kind, size, 8


def _damaged(path: Path, what: str) -> DataError:
    return DataError(f"{path}: cannot be read as a MATLAB file: {what}")
