"""Text files, in the encodings that programs write.

UTF-8 with or without a byte order mark; UTF-16 with one, or without where every second byte of the beginning is 0;
else Windows-1252, of which Latin-1 is a part (°, µ). A file with bytes that no text has is none.
"""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import toml_from_text

__all__ = ["first_bytes", "lines_of", "read_bytes", "read_lines", "read_toml", "utf8"]

_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
#: Control characters of no text: all but tab, the line ends, form feed and the end mark of old systems.
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a")) + b"\x7f"
_LOOKED_AT = 4096


def read_bytes(path: Path) -> bytes:
    """Content of a file; raises DataError if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error


def utf8(path: Path, raw: bytes) -> bytes:
    """The text of a file as UTF-8 without a byte order mark, its lines ended by ``\\n``.

    Parameters
    ----------
    path
        The file, for messages.
    raw
        Its bytes, or those of its beginning.

    Raises
    ------
    DataError
        If they are no text; names the line.
    """
    encoding = "utf-8" if raw.isascii() and b"\0" not in raw else _encoding(raw)
    if encoding == "utf-8":
        text = raw.removeprefix(codecs.BOM_UTF8)
        if text and text[-1] >= 0x80:  # perhaps within a character
            text = text.decode(errors="replace").encode()
    else:
        text = raw.decode(encoding, errors="replace").removeprefix("\ufeff").encode()
    if not text.isascii() or b"\0" in text:
        _require_text(path, text, encoding)
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return text


def _encoding(raw: bytes) -> str:
    if raw[:2] in _UTF16 and raw[:4] != codecs.BOM_UTF32_LE:
        return _UTF16[raw[:2]]
    head = raw[:_LOOKED_AT]
    if len(head) >= 4 and b"\0" in head:
        # Text of western scripts in UTF-16 has zeros at every second place, and at no other.
        even, odd = head[0::2], head[1::2]
        if odd.count(0) > 0.9 * len(odd) and not even.count(0):
            return "utf-16-le"
        if even.count(0) > 0.9 * len(even) and not odd.count(0):
            return "utf-16-be"
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError as error:
        # The end of a part may lie within a character.
        if error.end < len(raw) or error.reason != "unexpected end of data":
            return "cp1252"
    return "utf-8"


def _require_text(path: Path, text: bytes, encoding: str) -> None:
    """Refuse bytes that no text has: zeros, and with an encoding that takes everything all control characters."""
    unwanted = _CONTROL if encoding == "cp1252" else b"\0"
    first = min((at for at in map(text.find, (bytes([c]) for c in unwanted)) if at >= 0), default=-1)
    if first >= 0:
        line = text.count(b"\n", 0, first) + 1
        raise DataError(
            f"{path}: line {line}: a byte {text[first]:#04x} is in no text; this is a binary file, or a damaged one"
        )


def read_lines(path: Path) -> list[str]:
    """Lines of a text file without their ends.

    Raises
    ------
    DataError
        If the file cannot be read or is no text; then names the line.
    """
    return utf8(path, read_bytes(path)).decode(errors="replace").split("\n")


def lines_of(text: str) -> list[str]:
    """Lines without their ends, whichever system wrote them.

    Not :meth:`str.splitlines`, which also breaks at characters that may stand inside a title.
    """
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    DataError
        If it cannot be read, is not UTF-8 (names the line) or no TOML.
    """
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise DataError(f"{path}: line {line}: not UTF-8 text; save the file as UTF-8") from error
    try:
        return toml_from_text("\n".join(lines_of(text)))
    except DataError:
        raise
    except ValueError as error:
        raise DataError(f"{path}: not a TOML file: {error}") from error


def first_bytes(path: Path, count: int) -> bytes:
    """How a file begins, to recognise its format; fewer bytes if it is shorter, none if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""
