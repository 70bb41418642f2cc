"""Messages between the page and this machine: a JSON object and buffers of bytes, in one frame of a WebSocket.

A frame is the length of the JSON text (uint32, little-endian), the text, and the buffers, each beginning at a multiple
of eight bytes; the text's ``buffers`` says how long each is. Notebooks have messages with buffers of their own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from pbrdf.errors import DataError

__all__ = ["MOST_BUFFERS", "MOST_TEXT", "error_answer", "pack", "unpack"]

_ALIGNMENT = 8
#: Bytes of the JSON text, and number of buffers, of a message of the page, at most.
MOST_TEXT, MOST_BUFFERS = 1 << 20, 64


def pack(content: Mapping[str, Any], buffers: Sequence[bytes | memoryview] = ()) -> bytes:
    """One frame of a JSON object, without NaN or infinities, and buffers."""
    described = {**content, "buffers": [len(b) for b in buffers]}
    text = json.dumps(described, allow_nan=False, separators=(",", ":")).encode()
    parts: list[bytes | memoryview] = [len(text).to_bytes(4, "little"), text]
    at = 4 + len(text)
    for buffer in buffers:
        gap = -at % _ALIGNMENT
        parts += [bytes(gap), buffer]
        at += gap + len(buffer)
    return b"".join(parts)


def unpack(frame: bytes) -> tuple[dict[str, Any], list[memoryview]]:
    """The JSON object and the buffers of a frame.

    Raises
    ------
    DataError
        If the frame is not one of :func:`pack`, or its text or the number of its buffers is beyond all measure.
    """
    view = memoryview(frame)
    length = int.from_bytes(view[:4], "little")
    try:
        if length > min(MOST_TEXT, len(view) - 4):
            raise ValueError
        content = json.loads(bytes(view[4 : 4 + length]), parse_constant=_no_number)
        lengths = content.pop("buffers", [])
        if len(lengths) > MOST_BUFFERS:
            raise ValueError
        at, buffers = 4 + length, []
        for size in lengths:
            at += -at % _ALIGNMENT
            if type(size) is not int or size < 0 or at + size > len(view):
                raise ValueError
            buffers.append(view[at : at + size])
            at += size
    except (ValueError, AttributeError, TypeError, RecursionError):
        raise DataError("a message that is no frame of the explorer") from None
    return content, buffers


def request_number(request: Mapping[str, Any]) -> int | str | None:
    """The number that a page gave its request; None where it is none that an answer can repeat."""
    number = request.get("id")
    return number if isinstance(number, int | str) else None


def error_answer(request: Mapping[str, Any], text: str, place: str = "") -> dict[str, Any]:
    """The answer to a request that has none, in words; ``place`` is the path in the state of what is at fault."""
    about = request.get("type")
    return {
        "type": "error",
        "id": request_number(request),
        "about": about if isinstance(about, str) else None,
        "place": place,
        "text": text,
    }


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")
