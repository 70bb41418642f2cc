"""Errors whose message a user can act on.

Every error that bad input can cause derives from :class:`PbrdfError`. The command line prints its
message alone, without a traceback; in Python it is a ``ValueError`` like any other. Messages quote names and texts of
files; characters in these that would command a terminal are shown, not sent.
"""

from __future__ import annotations

import re

__all__ = ["BackendError", "DataError", "FitError", "ModelError", "PbrdfError", "PluginWarning", "visible"]

#: Control characters but for tabulators and ends of lines, and those that turn the direction of writing.
_COMMANDING = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def visible(text: str) -> str:
    """A text in which characters that command a terminal are spelled, ``\\x1b`` for one."""
    return _COMMANDING.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class PbrdfError(ValueError):
    """Base of all errors caused by input; the message says what is wrong and what to do."""

    def __str__(self) -> str:
        return visible(super().__str__())


class BackendError(PbrdfError):
    """No usable Dr.Jit backend (LLVM or CUDA) on this machine."""


class ModelError(PbrdfError):
    """A model parameter, an angle or an option is out of its domain."""


class DataError(PbrdfError):
    """A file or data set does not follow the schema; names the file, row and column where known."""


class FitError(PbrdfError):
    """A fit was asked for that the data or the options do not allow."""


class PluginWarning(UserWarning):
    """A model or reader of an installed package cannot be used; the others can."""
