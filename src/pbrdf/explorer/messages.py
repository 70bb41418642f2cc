"""Messages between the page and this machine: a JSON object and buffers of bytes, in one frame of a WebSocket.

A frame is the length of the JSON text (uint32, little-endian), the text, and the buffers, each beginning at a multiple
of eight bytes; the text's ``buffers`` says how long each is. Notebooks have messages with buffers of their own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from pbrdf.errors import DataError

__all__ = ["pack", "unpack"]

_ALIGNMENT = 8


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
        If the frame is not one of :func:`pack`.
    """
    view = memoryview(frame)
    length = int.from_bytes(view[:4], "little")
    try:
        content = json.loads(bytes(view[4 : 4 + length]))
        lengths = content.pop("buffers", [])
        at, buffers = 4 + length, []
        for size in lengths:
            at += -at % _ALIGNMENT
            if not isinstance(size, int) or size < 0 or at + size > len(view):
                raise ValueError
            buffers.append(view[at : at + size])
            at += size
    except (ValueError, AttributeError, TypeError, RecursionError):
        raise DataError("a message that is no frame of the explorer") from None
    return content, buffers
