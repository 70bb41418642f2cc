"""Errors whose message a user can act on.

Every error that bad input can cause derives from :class:`PbrdfError`. The command line prints its
message alone, without a traceback; in Python it is a ``ValueError`` like any other.
"""

from __future__ import annotations

__all__ = ["BackendError", "DataError", "FitError", "ModelError", "PbrdfError", "PluginWarning"]


class PbrdfError(ValueError):
    """Base of all errors caused by input; the message says what is wrong and what to do."""


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
