"""Where the rows and the variables of a data set came from: lines and columns of a file.

It travels with the data set, not in it: no attribute, no variable, nothing that is written. Rows that were chosen or
put in another order since have no lines.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

__all__ = ["Origin", "of_rows", "origin_of", "remember"]

_KEY = "pbrdf_origin"
_COORDINATES = ("theta_i", "theta_r", "phi")


@dataclass(frozen=True)
class Origin:
    """How a file was read.

    Attributes
    ----------
    lines
        Of the file, from 1, that each row came from.
    columns
        The file's column names by variable.
    meanings
        What each column was taken for, in words: pairs of its name and the meaning; ``""`` for one not used.
    remarks
        Sentences on what was not used and should be, or looks wrong.
    unused
        Columns that were not used, by name: the text of each row.
    dropped
        Names of the columns that the user left out.
    """

    lines: tuple[int, ...]
    columns: dict[str, str] = field(default_factory=dict)
    meanings: tuple[tuple[str, str], ...] = ()
    remarks: tuple[str, ...] = ()
    unused: dict[str, tuple[str, ...]] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()


def remember(ds: xr.Dataset, origin: Origin) -> None:
    """Note on a data set where it came from."""
    # a dictionary of its own: xarray lets a selection share that of the whole
    ds.encoding = {**ds.encoding, _KEY: (_fingerprint(ds), origin)}


def origin_of(ds: xr.Dataset) -> Origin | None:
    """Where a data set came from; None where that is not known. Rows that were moved have no lines."""
    found = ds.encoding.get(_KEY)
    if found is None:
        return None
    origin: Origin
    fingerprint, origin = found
    if fingerprint != _fingerprint(ds):
        return replace(origin, lines=(), unused={})
    return origin


def of_rows(source: xr.Dataset, keep: Sequence[int] | np.ndarray, taken: xr.Dataset) -> xr.Dataset:
    """Let `taken`, the rows `keep` of `source`, know where it came from."""
    origin = origin_of(source)
    if origin is not None:
        keep = np.asarray(keep)
        rows = np.flatnonzero(keep) if keep.dtype == bool else keep
        if origin.lines:
            unused = {name: tuple(cells[r] for r in rows) for name, cells in origin.unused.items()}
            origin = replace(origin, lines=tuple(origin.lines[r] for r in rows), unused=unused)
        remember(taken, origin)
    return taken


def _fingerprint(ds: xr.Dataset) -> tuple[Any, ...]:
    return tuple(
        zlib.crc32(np.ascontiguousarray(ds[name].values).tobytes())
        for name in _COORDINATES
        if name in ds.coords
    )
