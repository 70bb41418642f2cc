"""What the file formats share: whole-file reading and writing, exact degrees, attributes as text."""

from __future__ import annotations

import json
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrdf.data.schema import TEXT_ATTRIBUTES
from pbrdf.errors import DataError

__all__ = [
    "atomic_folder",
    "atomic_target",
    "decode_attribute",
    "encode_attribute",
    "exact_degrees",
    "name_beside",
    "plain_attributes",
    "read_lines",
]

_DECIMALS = (0, 2, 4, 6, 9, 12)
_NUMBER = re.compile(r"-?\d+(\.\d*)?([eE][+-]?\d+)?")


def read_lines(path: Path) -> list[str]:
    """Lines of a text file without their ends; UTF-8, with or without a byte order mark.

    Raises
    ------
    DataError
        If the file cannot be opened or is not UTF-8.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise DataError(f"{path}: line {line}: not UTF-8 text; save the file as UTF-8") from error
    # Not splitlines(): it also breaks at characters that may stand inside a title.
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def name_beside(path: Path) -> Path:
    """A new hidden name in the folder of `path`, for what is to take its place once it is complete."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


@contextmanager
def atomic_target(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to; it replaces `path` when the block ends well, and goes otherwise.

    Raises
    ------
    DataError
        If the folder does not exist or cannot be written to.
    """
    beside = name_beside(path)
    try:
        yield beside
        beside.replace(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # the error that matters is the one above
            beside.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """As :func:`atomic_target` for a folder: that of `path`, if there is one, is replaced as a whole.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    resolved = path.resolve()
    beside, old = name_beside(resolved), name_beside(resolved)
    try:
        yield beside
        if resolved.exists():
            resolved.replace(old)
        beside.replace(resolved)
    except OSError as error:
        if old.exists() and not resolved.exists():
            old.replace(resolved)
        raise DataError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def exact_degrees(radians: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Degrees from which :func:`numpy.deg2rad` gives back exactly these radians.

    Among the doubles that do, the one with the fewest decimals is taken, so that 30° is stored as 30.0.

    Returns
    -------
    ndarray or None
        None if some angle has none: about one double in ten lies between the images of its neighbours.
    """
    # An uncertainty may be too large a number for degrees; then there are none.
    with np.errstate(over="ignore", invalid="ignore"):
        nearest = np.rad2deg(radians)
        candidates = [np.round(nearest, decimals) for decimals in _DECIMALS]
        candidates += [nearest, np.nextafter(nearest, np.inf), np.nextafter(nearest, -np.inf)]
        degrees = np.array(nearest)
        missing = ~np.isnan(radians)
        for candidate in candidates:
            hit = missing & (np.deg2rad(candidate) == radians)
            degrees[hit] = candidate[hit]
            missing &= ~hit
    return None if np.any(missing) else degrees


def plain_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes with NumPy scalars and arrays turned into Python numbers and lists."""
    return {str(name): _plain(value) for name, value in attrs.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return int(value) if isinstance(value, bool) else value


def encode_attribute(name: str, value: Any) -> str:
    """One line of text from which :func:`decode_attribute` gives back `value`.

    Text stands as it is where that is unambiguous, everything else as JSON.
    """
    if isinstance(value, str) and value.isprintable() and decode_attribute(name, value.strip()) == value:
        return value
    readable = json.dumps(value, ensure_ascii=False)
    return readable if readable.isprintable() else json.dumps(value)


def decode_attribute(name: str, text: str) -> Any:
    """The attribute that `text` stands for: JSON text in quotes, a number, a list in brackets, or text.

    What looks like a number is text in a title, source, reference or instrument.
    """
    looks_like_json = text[:1] == '"' or (
        name not in TEXT_ATTRIBUTES and (text[:1] == "[" or _NUMBER.fullmatch(text) is not None)
    )
    if looks_like_json:
        try:
            return json.loads(text)
        except json.JSONDecodeError:
            return text
    return text
