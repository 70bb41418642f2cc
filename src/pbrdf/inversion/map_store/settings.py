"""What decides the numbers of a map, as text that can be compared."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any

__all__ = ["differences", "digest_of", "settings_text"]


def settings_text(settings: Any) -> str:
    """Settings as JSON, the same for the same settings.

    Raises
    ------
    TypeError, ValueError
        If they hold what JSON cannot.
    """
    return json.dumps(settings, sort_keys=True, ensure_ascii=False)


def digest_of(settings: Any) -> str:
    """SHA-256 of settings, hexadecimal."""
    return hashlib.sha256(settings_text(settings).encode()).hexdigest()


def differences(stored: Any, ours: Any, name: str = "") -> Iterator[str]:
    """Say where settings differ: ``fit.seed: 1 in the store, 2 here``."""
    if isinstance(stored, dict) and isinstance(ours, dict):
        for key in sorted({*stored, *ours}):
            yield from differences(
                stored.get(key, _ABSENT), ours.get(key, _ABSENT), f"{name}.{key}" if name else key
            )
    elif isinstance(stored, list) and isinstance(ours, list) and len(stored) == len(ours):
        for number, (one, other) in enumerate(zip(stored, ours, strict=True)):
            yield from differences(one, other, f"{name}[{number}]")
    elif settings_text(stored) != settings_text(ours):
        yield f"{name}: {_shown(stored)} in the store, {_shown(ours)} here"


#: What stands for a setting that is not there.
_ABSENT = "(none)"
_LONGEST = 40
#: What ends a text, a list or a table in JSON.
_ENDS = '"]}'


def _shown(value: Any) -> str:
    text = value if value is _ABSENT else settings_text(value)
    return (
        text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…{text[-1] if text[-1] in _ENDS else ''}"
    )
