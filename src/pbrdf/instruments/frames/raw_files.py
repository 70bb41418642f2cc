"""Camera files that are nothing but pixels: 8 or 16 bits a pixel, and the packed formats of 10 and 12 bits.

Names and layouts are those of the GenICam Pixel Format Naming Convention and of GigE Vision:

``Mono8``, ``Mono10`` … ``Mono16``
    A byte a pixel, or two, the low one first; the number stands in the low bits.
``Mono10p``, ``Mono12p``
    A stream of bits: the low bits of a pixel come first, the next pixel follows without a gap; 4 pixels in 5 bytes and
    2 in 3.
``Mono10Packed``, ``Mono12Packed``
    2 pixels in 3 bytes: the high 8 bits of the first, a byte with the low bits of both (first pixel below), the high 8
    bits of the second.

``BayerRG12p`` and the like are packed as ``Mono12p``: colours are no matter of the file. Rows follow each other
without a gap, and so do the pictures of a file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError

__all__ = ["RAW_SUFFIXES", "RawFile", "RawFormat", "open_raw"]

#: Extensions that such files usually have.
RAW_SUFFIXES = (".raw", ".bin", ".img")
_KEYS = ("width", "height", "format", "header")
#: Bits of a pixel, pixels and bytes of a group, how it is packed.
_FORMATS: dict[str, tuple[int, int, int, str]] = {
    "Mono8": (8, 1, 1, "bytes"),
    **{f"Mono{bits}": (bits, 1, 2, "bytes") for bits in (10, 12, 14, 16)},
    "Mono10p": (10, 4, 5, "stream"),
    "Mono12p": (12, 2, 3, "stream"),
    "Mono10Packed": (10, 2, 3, "shared"),
    "Mono12Packed": (12, 2, 3, "shared"),
}


@dataclass(frozen=True)
class RawFormat:
    """What a file of nothing but pixels does not say itself.

    Attributes
    ----------
    width, height
        Of a picture, pixels.
    format
        Name of the pixel format.
    header
        Bytes before the first picture.
    """

    width: int
    height: int
    format: str
    header: int = 0

    @classmethod
    def from_table(cls, table: Any) -> RawFormat:
        """Check the table ``raw = { width = …, height = …, format = … }``; raises DataError."""
        if not isinstance(table, dict) or set(table) - set(_KEYS) or not set(table) >= set(_KEYS[:3]):
            raise DataError(
                f'[frames] raw is {table!r}: give {{ width = 2448, height = 2048, format = "Mono12p" }}, and header, '
                "bytes before the first picture, where there are any"
            )
        for key, least in (("width", 1), ("height", 1), ("header", 0)):
            value = table.get(key, 0 if key == "header" else None)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise DataError(f"[frames] raw: {key} is {value!r}: give a whole number from {least}")
        return cls(table["width"], table["height"], _known(table["format"]), table.get("header", 0))

    @property
    def bits(self) -> int:
        """Bits of a pixel's number."""
        return _FORMATS[self.format][0]

    @property
    def picture_bytes(self) -> int:
        """Bytes of a picture."""
        _, pixels, size, _ = _FORMATS[self.format]
        bits = 8 * size // pixels
        return -(-self.width * self.height * bits // 8)


def _known(name: Any) -> str:
    """Our name of a pixel format: those of colour and polarisation cameras are packed as the grey ones."""
    plain = re.sub(r"^(bayer(rg|gr|gb|bg)|polariz\w*?mono|mono)_?", "", str(name).lower())
    for known in _FORMATS:
        if plain == known.lower().removeprefix("mono"):
            return known
    raise DataError(f"[frames] raw: format {name!r} is not known; use {', '.join(_FORMATS)}")


@dataclass(frozen=True)
class RawFile:
    """Pictures in such a file, as :class:`pbrdf.instruments.frames.pictures.PictureFile` has them.

    Attributes
    ----------
    path
        The file.
    count
        Number of pictures.
    layout
        What they are.
    """

    path: Path
    count: int
    layout: RawFormat

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.count, self.layout.height, self.layout.width)

    @property
    def dtype(self) -> np.dtype[Any]:
        return np.dtype(np.uint8 if self.layout.bits == 8 else np.uint16)

    @property
    def rows(self) -> int:
        return self.layout.height

    @property
    def columns(self) -> int:
        return self.layout.width

    def read(self, picture: int, first_row: int, last_row: int) -> np.ndarray:
        """Rows of one of the pictures, shape (last_row − first_row, columns); raises DataError if they are missing."""
        _, pixels, size, packing = _FORMATS[self.layout.format]
        width = self.layout.width
        first, last = first_row * width, last_row * width
        # whole groups of pixels
        start, end = first // pixels, -(-last // pixels)
        wanted = min(end * size, self.layout.picture_bytes) - start * size
        try:
            with self.path.open("rb") as file:
                file.seek(self.layout.header + picture * self.layout.picture_bytes + start * size)
                data = np.frombuffer(file.read(wanted), np.uint8)
        except OSError as error:
            raise DataError(f"{self.path}: cannot be read: {error.strerror or error}") from error
        if data.size < wanted:
            raise DataError(f"{self.path}: the file has become shorter while it was read")
        # the last group of a picture may be cut where its pixels end
        data = np.concatenate([data, np.zeros((end - start) * size - wanted, np.uint8)])
        numbers = _UNPACK[packing](data.reshape(-1, size), self.layout.bits).reshape(-1)
        return numbers[first - start * pixels : last - start * pixels].reshape(last_row - first_row, width)


def _bytes(groups: np.ndarray, bits: int) -> np.ndarray:
    if bits == 8:
        return groups
    values: np.ndarray = groups[:, 0] | groups[:, 1].astype(np.uint16) << 8
    return values


def _stream(groups: np.ndarray, bits: int) -> np.ndarray:
    wide = np.zeros(len(groups), dtype=np.uint64)
    for k in range(groups.shape[1]):
        wide |= groups[:, k].astype(np.uint64) << np.uint64(8 * k)
    count = 8 * groups.shape[1] // bits
    mask = np.uint64(2**bits - 1)
    return np.stack([(wide >> np.uint64(bits * k) & mask).astype(np.uint16) for k in range(count)], axis=1)


def _shared(groups: np.ndarray, bits: int) -> np.ndarray:
    low = bits - 8
    wide = groups.astype(np.uint16)
    mask = np.uint16(2**low - 1)
    return np.stack(
        [wide[:, 0] << low | wide[:, 1] & mask, wide[:, 2] << low | wide[:, 1] >> 4 & mask], axis=1
    )


_UNPACK = {"bytes": _bytes, "stream": _stream, "shared": _shared}


def open_raw(path: Path, layout: RawFormat | None) -> RawFile:
    """Find out how many pictures a file of nothing but pixels holds.

    Raises
    ------
    DataError
        If there is no such file, nothing says what it holds, or its size does not fit.
    """
    if layout is None:
        raise DataError(
            f"{path}: a file of nothing but pixels does not say how they stand in it: set raw = {{ width = 2448, "
            'height = 2048, format = "Mono12p" } in [frames], with what the camera was set to'
        )
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    size = path.stat().st_size - layout.header
    one = layout.picture_bytes
    if size < one or size % one:
        exact = [
            name
            for name in _FORMATS
            if size == RawFormat(layout.width, layout.height, name).picture_bytes and name != layout.format
        ]
        hint = f"; the size fits {', '.join(exact)}" if exact else ""
        raise DataError(
            f"{path}: {path.stat().st_size} bytes are not whole pictures: {layout.width} × {layout.height} pixels of "
            f"{layout.format} take {one} bytes, after a header of {layout.header}{hint}: check raw in [frames]"
        )
    return RawFile(path, size // one, layout)
