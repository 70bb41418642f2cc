"""Whether a picture file can hold the picture that it declares, and holds it undamaged.

PNG (ISO/IEC 15948): after eight bytes of signature come chunks, each its length (4 bytes, the highest first), its name
(4), its content, and the CRC-32 of name and content (4); the last one is IEND. Decoders skip the checksums of pixels.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.hdf5_probe import ALWAYS_ALLOWED, MOST_TIMES_ITS_SIZE, amount

__all__ = ["require_checksums", "require_possible"]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = struct.Struct(">I4s")


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
