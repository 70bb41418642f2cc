"""The line that a command was called with, for reports that say how to repeat them."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextvars import ContextVar

__all__ = ["command_line", "given_arguments", "remember_arguments"]

_arguments: ContextVar[tuple[str, ...]] = ContextVar("arguments", default=())


def remember_arguments(arguments: Sequence[str]) -> None:
    """Keep the arguments of the whole program, as they came."""
    _arguments.set(tuple(arguments))


def given_arguments() -> tuple[str, ...]:
    """The arguments of the whole program."""
    return _arguments.get()


def command_line() -> str:
    """The running command as a line for a shell; empty where none is running."""
    arguments = _arguments.get()
    return shlex.join(["pbrdf", *arguments]) if arguments else ""
