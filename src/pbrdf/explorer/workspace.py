"""What is open beside the models: measured data, maps, the state that the page begins with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.models.base import Model

__all__ = ["Workspace"]


class Workspace:
    """What one page works with.

    Parameters
    ----------
    models
        Names and models to begin with; none for the empty state.
    """

    def __init__(self, models: Sequence[tuple[str, Model]] = ()) -> None:
        self.models = list(models)

    def state(self) -> dict[str, Any] | None:
        """The state to begin with, None where nothing was given."""
        if not self.models:
            return None
        return state_of([layer_of(name, model) for name, model in self.models])

    def close(self) -> None:
        """Give up what is open."""
