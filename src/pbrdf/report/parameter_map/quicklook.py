"""A picture of a map while its store is filled: only what has come since is read, and the file changes in one step."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.files.atomic import atomic_file
from pbrdf.inversion.map_store import open_map
from pbrdf.report.parameter_map.shown_map import ShownMap, Window

if TYPE_CHECKING:
    from pbrdf.inversion.map_store import MapStore

__all__ = ["QuickLook"]

#: Seconds between two pictures at least; drawing takes no more than one part in so many of the time.
_EVERY, _PART = 5.0, 10.0
#: Pixels along the longer side of the picture.
_PIXELS = 240


class QuickLook:
    """A picture of all parameters that fills as the work goes on, whoever does it.

    Parameters
    ----------
    store
        What is being filled.
    path
        The picture, PNG; its folder is made where it is missing.
    every
        Seconds between two pictures, at least.
    """

    def __init__(self, store: MapStore, path: Path, *, every: float = _EVERY) -> None:
        self._store, self._path, self._every = store, path, every
        self._shown: ShownMap | None = None
        self._left = set(range(store.grid.count))
        self._next = time.monotonic()

    def __call__(self) -> None:
        """Draw what is done by now, if the last picture is old enough and something has come since."""
        if time.monotonic() < self._next:
            return
        new = [number for number in sorted(self._left) if self._store.is_done(number)]
        if not new:
            return
        from pbrdf.report.parameter_map.figure import overview_figure
        from pbrdf.report.style import save_figure

        began = time.monotonic()  # without the time to load the plotting library
        with open_map(self._store.path, partial=True) as stored:
            if self._shown is None:
                self._shown = ShownMap(stored, Window.of(stored, _PIXELS), empty=True)
            for number in new:
                self._shown.update(stored, self._store.grid.slices(number))
        self._left.difference_update(new)
        done = self._store.grid.count - len(self._left)
        title = f"{self._store.path.name}: {done} of {self._store.grid.count} units are done"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(self._path) as beside:
            save_figure(overview_figure(self._shown, title), beside)
        now = time.monotonic()
        self._next = now + max(self._every, _PART * (now - began))
