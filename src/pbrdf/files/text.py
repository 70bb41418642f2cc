"""Text files: UTF-8, with or without a byte order mark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import toml_from_text

__all__ = ["first_bytes", "lines_of", "read_lines", "read_toml"]


def read_lines(path: Path) -> list[str]:
    """Lines of a text file without their ends.

    Raises
    ------
    DataError
        If the file cannot be opened or is not UTF-8; then names the line.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise DataError(f"{path}: line {line}: not UTF-8 text; save the file as UTF-8") from error
    return lines_of(text)


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
        As :func:`read_lines`, and if it is not TOML.
    """
    try:
        return toml_from_text("\n".join(read_lines(path)))
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
