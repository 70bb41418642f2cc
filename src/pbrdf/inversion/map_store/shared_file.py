"""What pixels share, kept in a file: whoever goes on with a map, or fills it with others, need not find it again.

It takes several passes over all pixels. The file is NumPy's ``.npz`` with the digest of the settings and of the input
that it belongs to; one of others is made anew.
"""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.files.atomic import atomic_file
from pbrdf.inversion.map_store.map_source import MapSource
from pbrdf.inversion.map_store.settings import digest_of
from pbrdf.inversion.map_store.unit_grid import UnitGrid
from pbrdf.inversion.parameter_map.map_fit import MapFit
from pbrdf.inversion.parameter_map.shared import Shared

__all__ = ["with_shared"]

_DIGEST = "digest"


def with_shared(
    fit: MapFit,
    source: MapSource,
    grid: UnitGrid,
    path: Path,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> MapFit:
    """A fit that knows what pixels share, from the file or from all pixels.

    Parameters
    ----------
    fit
        The settings.
    source
        The pixels.
    grid
        The units in which they are gone through.
    path
        The file; written where it is not there.
    progress
        Called with the number of units that a pass has gone through, and of all.

    Raises
    ------
    FitError
        If no pixel can be fitted.
    DataError
        If the file cannot be written, or the input not be read.
    """
    if not fit.settings["share"]:
        return fit
    digest = digest_of({"fit": fit.settings, "input": source.identity()})
    found = _kept(path, digest)
    if found is None:
        solved = fit.solve_shared(_Units(source, grid, progress))
        assert solved.shared is not None
        found = solved.shared
        with atomic_file(path) as beside, beside.open("wb") as file:
            fields: dict[str, Any] = {f.name: getattr(found, f.name) for f in dataclasses.fields(found)}
            np.savez(file, **(fields | {_DIGEST: digest}))
    return fit.with_shared(found)


class _Units:
    """The units of a map, each read when it is its turn, as often as they are gone through."""

    def __init__(
        self, source: MapSource, grid: UnitGrid, progress: Callable[[int, int], None] | None
    ) -> None:
        self._source, self._grid, self._progress = source, grid, progress

    def __iter__(self) -> Iterator[xr.Dataset]:
        for number in range(self._grid.count):
            yield self._source.block(self._grid.slices(number))
            if self._progress is not None:
                self._progress(number + 1, self._grid.count)


def _kept(path: Path, digest: str) -> Shared | None:
    """What the file holds; None if there is none, or one of other settings."""
    try:
        with np.load(path, allow_pickle=False) as file:
            if str(file[_DIGEST]) != digest:
                return None
            fields = {f.name: file[f.name] for f in dataclasses.fields(Shared)}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return Shared(**{**fields, "passes": int(fields["passes"])})
