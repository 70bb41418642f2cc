"""A picture of a map while it is being made: only what has come since is read, and the file changes in one step."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.files.atomic import atomic_file
from pbrdf.report.parameter_map.shown_map import ShownMap, Window

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["QuickLook"]

#: Seconds between two pictures at least; drawing takes no more than one part in so many of the time.
_EVERY, _PART = 5.0, 20.0
#: Pixels along the longer side of the picture.
_PIXELS = 240


class QuickLook:
    """A picture of all parameters that fills as the work goes on.

    Parameters
    ----------
    path
        The picture, PNG.
    title
        Above it.
    every
        Seconds between two pictures, at least.
    """

    def __init__(self, path: Path, title: str, *, every: float = _EVERY) -> None:
        self._path, self._title, self._every = path, title, every
        self._shown: ShownMap | None = None
        self._next = time.monotonic() + every
        self._stale = False

    def update(self, dataset: xr.Dataset, region: Mapping[str, slice]) -> None:
        """Take what a part of the map holds now, and draw if the last picture is old enough.

        Parameters
        ----------
        dataset
            The map as it is stored.
        region
            The part that is new, slices by dimension.
        """
        if self._shown is None:
            self._shown = ShownMap(dataset, Window.of(dataset, _PIXELS), empty=True)
        self._shown.update(dataset, region)
        self._stale = True
        if time.monotonic() >= self._next:
            self.draw()

    def draw(self) -> None:
        """Draw now if there is something new."""
        if self._shown is None or not self._stale:
            return
        from pbrdf.report.parameter_map.figure import overview_figure
        from pbrdf.report.style import save_figure

        began = time.monotonic()
        with atomic_file(self._path) as beside:
            save_figure(overview_figure(self._shown, self._title), beside)
        self._stale = False
        now = time.monotonic()
        self._next = now + max(self._every, _PART * (now - began))
