"""Numbers as people and instruments write them, and nothing else that Python takes for one.

Python also reads ``1_0`` as 10 and digits of other scripts (``٣``), which in a file or an option are slips. JSON and
TOML know texts that make Python recurse too deep, and integers too long for it: they are refused in a sentence.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from typing import Any

__all__ = ["count_from_text", "json_from_text", "number_from_text", "toml_from_text"]

_NUMBER = re.compile(r"\s*[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|nan|inf|infinity)\s*", re.ASCII | re.IGNORECASE)

_COUNT = re.compile(r"[0-9]{1,18}")


def number_from_text(text: str) -> float:
    """The number that a text is; raises ValueError if it is none."""
    if _NUMBER.fullmatch(text) is None:
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def count_from_text(text: str) -> int:
    """The whole number from 0 that a text is; raises ValueError if it is none, or longer than 18 digits."""
    if _COUNT.fullmatch(text) is None:
        raise ValueError(f"{text!r} is not a count")
    return int(text)


def json_from_text(text: str | bytes) -> Any:
    """What a JSON text stands for.

    Raises
    ------
    ValueError
        Says, in a part of a sentence, where and why it is none.
    """
    try:
        return _read(json.loads, text)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno} column {error.colno}: {error.msg}") from error


def toml_from_text(text: str) -> dict[str, Any]:
    """What a TOML text stands for; raises ValueError as :func:`json_from_text` does."""
    found: dict[str, Any] = _read(tomllib.loads, text)
    return found


def _read(loads: Callable[[Any], Any], text: str | bytes) -> Any:
    try:
        return loads(text)
    except RecursionError:
        raise ValueError("brackets stand too deep in each other") from None
    except ValueError as error:
        if "integer string conversion" in str(error):
            raise ValueError("an integer has more digits than a number can have") from None
        raise
