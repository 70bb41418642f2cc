"""The one place that imports Mitsuba 3 and says what to install where it is missing."""

from __future__ import annotations

from typing import Any

from pbrdf.errors import BackendError

__all__ = ["import_mitsuba"]


def import_mitsuba() -> Any:
    """The module ``mitsuba``; raises BackendError if it is not installed."""
    try:
        import mitsuba
    except ImportError as error:
        raise BackendError(f"rendering needs Mitsuba: pip install 'pbrdf[render]' ({error})") from error
    return mitsuba
