"""Doing the units of a map: by one process, or by worker i of N without a coordinator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pbrdf.inversion.map_store.finished_map import finish
from pbrdf.inversion.map_store.map_store import MapStore

__all__ = ["Work", "run_units"]


@dataclass(frozen=True)
class Work:
    """What a worker did.

    Attributes
    ----------
    done
        Number of units that it did.
    found
        Number of units of its share that were done already.
    left
        Number of units of the whole map that are not done; with 0 the map is complete.
    """

    done: int
    found: int
    left: int


def run_units(
    store: MapStore,
    *,
    worker: tuple[int, int] | None = None,
    progress: Callable[[int, int], None] | None = None,
    within: Callable[[int, int], None] | None = None,
) -> Work:
    """Do the units of a map that are missing, in this process, with Dr.Jit's threads.

    Workers know nothing of each other: worker i of N does every N-th unit. Two that do the same unit do no harm. The
    one that finds no unit missing at its end, in its share or another's, completes the map.

    Parameters
    ----------
    store
        What :func:`pbrdf.inversion.map_store.prepare_store` gives.
    worker
        (i, N): this is worker i of N, counted from 1. None: this process does all units.
    progress
        Called with the number of finished units and of all, of this worker's share.
    within
        Called with the number of fitted pixels of a unit and of all of it, while it is being done.

    Raises
    ------
    DataError
        If the store cannot be written, or the input not be read; what is done is kept.
    """
    store.clear_up()
    share, missing = store.grid.share(worker), store.missing(worker)
    found = len(share) - len(missing)
    if progress is not None:
        progress(found, len(share))
    for number, unit in enumerate(missing, start=1):
        store.do(unit, within)
        if progress is not None:
            progress(found + number, len(share))
    return Work(len(missing), found, finish(store))
