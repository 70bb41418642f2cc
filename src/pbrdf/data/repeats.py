"""One geometry measured more than once: exact duplicates of rows, and repeats that disagree.

Repeats that agree within their uncertainties are what a careful measurement has. Exact duplicates are no second
measurement and yet count as one: n copies of a row shrink the errors of a fit by √n. Repeats that disagree are often
two samples in one file; a column that was not used and has another value in each tells them apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.schema import VARIABLES, std_name
from pbrdf.optics.stokes import STOKES

__all__ = ["Repeats", "find_repeats", "separating_column"]

#: How many standard uncertainties of their difference two values may lie apart.
DEVIATIONS = 5.0
#: Share of the intensity by which they may differ where no uncertainty is stated, or that of a ratio.
SHARE = 0.1


@dataclass(frozen=True)
class Repeats:
    """Rows of one geometry, wavelength and group.

    Attributes
    ----------
    copies
        Rows that are exact copies of an earlier one.
    originals
        The rows that each is a copy of.
    disagreeing
        Rows of geometries whose values disagree.
    sets
        Number of the geometry of each row of `disagreeing`.
    """

    copies: NDArray[np.intp]
    originals: NDArray[np.intp]
    disagreeing: NDArray[np.intp]
    sets: NDArray[np.intp]


def find_repeats(ds: xr.Dataset) -> Repeats:
    """Look for rows of the same geometry in a valid data set."""
    names = [name for name in ("theta_i", "theta_r", "phi", "wavelength") if name in ds.coords]
    keys = [np.round(np.nan_to_num(ds[name].values), 9) + 0.0 for name in names]
    keys.append(np.unique(ds["group"].values, return_inverse=True)[1].astype(float))
    number = _numbered(keys)
    size = np.bincount(number)
    rows = np.flatnonzero(size[number] > 1)
    if not rows.size:
        none = np.array([], dtype=np.intp)
        return Repeats(none, none, none, none)
    number = np.unique(number[rows], return_inverse=True)[1]
    variables = [name for name in VARIABLES if name in ds.data_vars]
    values = np.hstack(
        [
            ds[name].values[rows].reshape(len(rows), -1)
            for v in variables
            for name in (v, std_name(v))
            if name in ds
        ]
    )
    # −0.0 is 0, and what was not measured twice is the same
    same = _numbered([number.astype(float), *(np.nan_to_num(values, nan=1e300) + 0.0).T])
    _, first = np.unique(same, return_index=True)
    copy = first[same] != np.arange(len(rows))
    disagree = np.zeros(int(number.max()) + 1, dtype=bool)
    for name in variables:
        disagree |= _disagreeing(ds, name, rows, number)
    chosen = disagree[number]
    return Repeats(rows[copy], rows[first[same]][copy], rows[chosen], number[chosen])


def separating_column(repeats: Repeats, columns: Mapping[str, Sequence[str]]) -> tuple[str, list[str]] | None:
    """The column whose values tell the rows that disagree apart, with its values; None if there is none.

    Parameters
    ----------
    repeats
        The rows.
    columns
        The text of each row of the data set, by name of the column.
    """
    for name, cells in columns.items():
        texts = np.array([cells[row] for row in repeats.disagreeing])
        values = list(dict.fromkeys(cells))
        codes = np.unique(texts, return_inverse=True)[1]
        pairs = _numbered([repeats.sets.astype(float), codes.astype(float)])
        # as many different texts as rows in every set, and a text that means more than one row
        if len(values) > 1 and len(np.unique(pairs)) == len(pairs) and len(values) <= max(2, len(cells) // 2):
            return name, values
    return None


def _disagreeing(
    ds: xr.Dataset, name: str, rows: NDArray[np.intp], number: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Whether a variable differs between the rows of each set by more than its uncertainty."""
    values = ds[name].values[rows].reshape(len(rows), -1)
    if name == "aolp":
        return np.zeros(int(number.max()) + 1, dtype=bool)
    spread = _largest(values, number) + _largest(-values, number)
    if std_name(name) in ds:
        deviation = _largest(ds[std_name(name)].values[rows].reshape(len(rows), -1), number)
    else:
        deviation = np.full(spread.shape, np.nan)
    scale = np.ones_like(spread)
    if name == "mueller" or (name in STOKES and "I" in ds):
        whole = ds["mueller"].values[rows][:, :1, 0] if name == "mueller" else ds["I"].values[rows][:, None]
        scale = np.broadcast_to(_largest(np.abs(whole), number), spread.shape)
    with np.errstate(invalid="ignore", over="ignore"):
        allowed = np.where(deviation > 0.0, DEVIATIONS * np.sqrt(2.0) * deviation, SHARE * scale)
        found: NDArray[np.bool_] = np.any(spread > allowed, axis=1)
        return found


def _largest(values: NDArray[np.float64], number: NDArray[np.intp]) -> NDArray[np.float64]:
    """The largest value of each set, NaN left out; −∞ where there is none."""
    result = np.full((int(number.max()) + 1, values.shape[1]), -np.inf)
    np.maximum.at(result, number, np.where(np.isnan(values), -np.inf, values))
    return result


def _numbered(keys: Sequence[NDArray[np.float64]]) -> NDArray[np.intp]:
    """The same number for rows that are equal in all keys."""
    order = np.lexsort(list(keys))
    changed = np.zeros(len(order), dtype=bool)
    for key in keys:
        changed[1:] |= key[order][1:] != key[order][:-1]
    numbers = np.empty(len(order), dtype=np.intp)
    numbers[order] = np.cumsum(changed)
    return numbers
