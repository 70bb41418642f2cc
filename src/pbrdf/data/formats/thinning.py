"""Taking every n-th node of a table: tables hold far more cells than a fit needs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pbrdf.errors import DataError

__all__ = ["MOST_CELLS", "thinning", "thinning_in_words"]

#: Without an instruction, a table is thinned to at most this many cells at each wavelength.
MOST_CELLS = 20_000


def thinning(counts: Sequence[int], every: int | None, origin: str) -> int:
    """The n of "every n-th node along each axis".

    Parameters
    ----------
    counts
        Nodes along each axis.
    every
        What was asked for; None is the smallest n that leaves at most :data:`MOST_CELLS` cells.
    origin
        The file's name, for the message.

    Raises
    ------
    DataError
        If `every` is not a whole number from 1.
    """
    if every is None:
        every = 1
        while math.prod(-(-count // every) for count in counts) > MOST_CELLS:
            every += 1
    elif isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise DataError(f"{origin}: every={every!r}: give a whole number from 1, which takes every node")
    return every


def thinning_in_words(every: int) -> str:
    """An appendix to the source of a data set; empty where nothing was left out."""
    return "" if every == 1 else f", one node in {every} of each angle"
