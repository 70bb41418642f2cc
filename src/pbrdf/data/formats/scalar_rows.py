"""Scalar BRDF tables of other programs as data sets: what their readers share.

Grids of angles hold cells below the horizon, which are left out, and cells exactly on it, which are kept just above
it. Where a program has no mark for a cell that was not measured it writes 0, so that is how a 0 is understood there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.build import assemble
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.optics.angles import within_half_turn

__all__ = ["incidence_groups", "scalar_rows"]

#: How far above the horizon a direction is kept that a file, to rounding, places on it, radians.
_ABOVE = 1e-6


def scalar_rows(
    path: Path,
    coordinates: Mapping[str, ArrayLike | None],
    values: ArrayLike,
    lines: Sequence[int] | NDArray[np.int64] | None,
    *,
    grid: bool = False,
    attrs: Mapping[str, Any] | None = None,
    assumptions: Sequence[str] = (),
) -> xr.Dataset:
    """A valid data set of BRDF values in 1/sr under natural light.

    Parameters
    ----------
    path
        The file, for messages and the attribute ``source``.
    coordinates
        By name, angles in radians with φ = 0 forward; arrays of N rows, or None.
    values
        BRDF, 1/sr, shape (N,); NaN was not measured, and is left out.
    lines
        Of the file, one for each row; None if it has none, and messages count rows.
    grid
        Whether the rows are the cells of a grid of angles: those below the horizon, and those that hold 0, are left
        out then, the latter with a sentence. Else a direction below the horizon is an error.
    attrs
        Further attributes.
    assumptions
        Sentences on what the file did not say.

    Raises
    ------
    DataError
        If nothing is left, or the data set is not valid.
    """
    values = np.asarray(values, dtype=np.float64)
    columns = {k: np.asarray(v) for k, v in coordinates.items() if v is not None}
    for name in ("theta_i", "theta_r"):
        angle = columns[name].astype(np.float64)
        on_horizon = np.abs(angle - np.pi / 2) < _ABOVE
        columns[name] = np.where(on_horizon, np.pi / 2 - _ABOVE, angle)
    columns["phi"] = within_half_turn(columns["phi"])
    keep = ~np.isnan(values)
    sentences = list(assumptions)
    if grid:
        keep &= (columns["theta_i"] < np.pi / 2) & (columns["theta_r"] < np.pi / 2)
        zero = keep & (values == 0.0)
        keep &= ~zero
        if zero.any():
            sentences.append(f"cells that hold 0 were taken as not measured and left out: {zero.sum()}")
    if not keep.any():
        raise DataError(f"{path}: no row of the table has a value above the horizon")
    extra = {key: value for key, value in (attrs or {}).items() if value != ""}
    if sentences:
        extra["assumptions"] = sentences
    ds = assemble(
        {name: column[keep] for name, column in columns.items()},
        {"I": values[keep]},
        {},
        {
            "quantity": "brdf",
            "illumination": list(NATURAL_LIGHT),
            "simulated": 0,
            "source": path.name,
            **extra,
        },
    )
    validate(ds, origin=str(path), lines=None if lines is None else np.asarray(lines)[keep].tolist())
    return ds


def incidence_groups(theta_i: ArrayLike) -> NDArray[np.int64]:
    """The label of each row: θ_i in whole degrees, from radians."""
    return np.round(np.rad2deg(np.asarray(theta_i, dtype=np.float64))).astype(np.int64)
