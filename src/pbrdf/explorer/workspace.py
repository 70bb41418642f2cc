"""What is open beside the models: measured data, maps, the state that the page begins with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.fit_process import FitProcess
from pbrdf.models.base import Model

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Workspace"]


class Workspace:
    """What one page works with.

    Parameters
    ----------
    models
        Names and models to begin with; none for the empty state.
    datasets
        Names and measured data.

    Attributes
    ----------
    measured
        Points of the data that were shown, see :mod:`pbrdf.explorer.points`.
    fitting
        The process that fits.
    """

    def __init__(
        self, models: Sequence[tuple[str, Model]] = (), datasets: Sequence[tuple[str, xr.Dataset]] = ()
    ) -> None:
        self.models = list(models)
        self.datasets = list(datasets)
        self.measured: dict[Any, Any] = {}
        self.fitting = FitProcess()

    def state(self) -> dict[str, Any] | None:
        """The state to begin with, None where nothing was given."""
        if not self.models:
            return None
        return state_of([layer_of(name, model) for name, model in self.models])

    def close(self) -> None:
        """Give up what is open."""
        self.fitting.close()
