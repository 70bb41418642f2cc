"""Whether a picture file can hold the picture that it declares, and holds it undamaged.

PNG (ISO/IEC 15948): after eight bytes of signature come chunks, each its length (4 bytes, the highest first), its name
(4), its content, and the CRC-32 of name and content (4); the last one is IEND. Decoders skip the checksums of pixels.

TIFF (revision 6.0, and BigTIFF): the header names the byte order and where the first directory of a page stands; a
directory is a number of entries of one size, and where the next one stands, 0 after the last.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.hdf5_probe import ALWAYS_ALLOWED, MOST_TIMES_ITS_SIZE, amount

__all__ = ["require_checksums", "require_pages", "require_possible"]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = struct.Struct(">I4s")
#: Of a TIFF by its version: where the header names the first directory, and the codes of an offset and of a count, the
#: bytes of an entry.
_DIRECTORIES = {42: (4, "I", "H", 12), 43: (8, "Q", "Q", 20)}


def require_possible(path: Path, shape: tuple[int, ...], dtype: np.dtype) -> None:
    """Check the size of a picture against that of its file, before anything is allocated.

    Raises
    ------
    DataError
        If no compression packs so much into so little.
    """
    declared = math.prod(map(int, shape)) * dtype.itemsize
    if declared > max(ALWAYS_ALLOWED, MOST_TIMES_ITS_SIZE * path.stat().st_size):
        raise DataError(
            f"{path}: declares {' × '.join(map(str, shape))} pixels, {amount(declared)}, which a file of this size "
            "cannot hold: it is damaged"
        )


def require_checksums(path: Path) -> None:
    """Check every chunk of a PNG file.

    Raises
    ------
    DataError
        If a checksum is wrong, or the file ends too early; names the chunk.
    """
    content = memoryview(path.read_bytes())
    where = f"{path}: cannot be read as a picture"
    if content[:8] != _SIGNATURE:
        raise DataError(f"{where}: this is not a PNG file")
    at, kind = 8, b""
    while kind != b"IEND":
        if at + _CHUNK.size > len(content):
            raise DataError(f"{where}: it ends at byte {len(content)}, before its last part: it is cut off")
        length, kind = _CHUNK.unpack_from(content, at)
        end = at + _CHUNK.size + length
        if end + 4 > len(content):
            raise DataError(f"{where}: it ends within its part {kind!r}: it is cut off")
        if zlib.crc32(content[at + 4 : end]) != int.from_bytes(content[end : end + 4], "big"):
            raise DataError(
                f"{where}: the checksum of its part {kind!r} at byte {at} is wrong: it is damaged"
            )
        at = end + 4


def require_pages(path: Path) -> None:
    """Check that the directories of a TIFF file's pages follow each other, each once and within the file.

    Raises
    ------
    DataError
        If one stands outside of the file, or comes again.
    """
    size = path.stat().st_size
    where = f"{path}: cannot be read as a picture"
    with path.open("rb") as file:

        def number(at: int, code: str) -> int:
            file.seek(at)
            raw = file.read(struct.calcsize(code))
            if len(raw) < struct.calcsize(code):
                raise DataError(f"{where}: page {len(seen) + 1} stands outside of the file: it is damaged")
            return int(struct.unpack(order + code, raw)[0])

        seen: set[int] = set()
        order = {b"II": "<", b"MM": ">"}.get(file.read(2), "")
        version = number(2, "H") if order else 0
        if version not in _DIRECTORIES:
            raise DataError(f"{where}: this is not a TIFF file")
        first, offset, count, entry = _DIRECTORIES[version]
        at = number(first, offset)
        while at:
            if at in seen:
                raise DataError(
                    f"{where}: after page {len(seen)} comes one that was there before: it is damaged"
                )
            entries = number(at, count) if at < size else size
            after = at + struct.calcsize(count) + entries * entry
            if after > size:
                raise DataError(f"{where}: page {len(seen) + 1} stands outside of the file: it is damaged")
            seen.add(at)
            at = number(after, offset)
