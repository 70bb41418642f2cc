"""How sentences list things; used on every floor that says something."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["joined"]


def joined(words: Sequence[str], last: str) -> str:
    """Words with another one before the last of them: ``a``, ``a or b``, ``a, b or c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"
