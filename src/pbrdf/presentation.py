"""How a result shows itself, though what writes and draws lies on floors above it.

The floors above say here, at the import of ``pbrdf``, where their presenters are; results ask for them when they are
printed, drawn or saved. So a result has ``summary()`` and ``plot()`` and its module knows nothing of reports.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["presenter_of", "provide_presenter"]

_providers: dict[str, Callable[[], Any]] = {}


def provide_presenter(kind: str, load: Callable[[], Any]) -> None:
    """Say who presents results of a kind: ``load`` imports and returns it when it is first needed."""
    _providers[kind] = load


def presenter_of(kind: str) -> Any:
    """The presenter of results of a kind."""
    return _providers[kind]()
