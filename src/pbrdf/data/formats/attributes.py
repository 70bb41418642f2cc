"""Attributes of a data set as files hold them: plain Python values, and one line of text each."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrdf.data.schema import TEXT_ATTRIBUTES
from pbrdf.files.plain_numbers import json_from_text

__all__ = ["decode_attribute", "encode_attribute", "plain_attributes"]

_NUMBER = re.compile(r"-?\d+(\.\d*)?([eE][+-]?\d+)?")


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
            return json_from_text(text)
        except ValueError:
            return text
    return text
