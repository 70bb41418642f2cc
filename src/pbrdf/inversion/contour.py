"""Joint confidence regions of two parameters: χ² over a grid of the two, with all others refitted.

Every point of the grid is one lane of the batched solver; the grid is walked from the optimum outwards, and spans
the profile intervals of the two at the region's own threshold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.errors import FitError
from pbrdf.inversion.confidence import (
    BETTER,
    MARGIN,
    PASSES,
    better_notes,
    better_optimum,
    check_points,
    clipped,
    free_column,
    rise_of_chi2,
    unsettled_note,
)
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.profile_ends import interval_ends
from pbrdf.inversion.refits import Optima, Refit

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Contour", "contour"]


@dataclass(frozen=True)
class Contour:
    """Joint confidence regions of two parameters.

    Attributes
    ----------
    a, b
        Names of the parameters.
    rises
        Threshold of each level: the region is where ``chi2_rise`` is at most this.
    grid
        ``chi2_rise`` over the two parameters, dimensions (``a``, ``b``), coordinates in their own units; NaN far
        outside the largest region.
    better, better_chi2, notes
        As in :class:`pbrdf.inversion.profile.Profile`.
    """

    a: str
    b: str
    rises: dict[float, float]
    grid: xr.Dataset
    better: dict[str, float] | None
    better_chi2: float
    notes: list[str] = field(default_factory=list)


def contour(
    result: Optimum, a: str, b: str, *, levels: Sequence[float] = (0.68, 0.95), points: int = 41
) -> Contour:
    """Joint confidence regions of two parameters, the others refitted at every point of a grid.

    These are regions for the pair: 95 % of them hold both true values at once. Their thresholds are those of
    two degrees of freedom (χ² + 2.28 for 68 % and + 5.99 for 95 % where the uncertainties are known), so the shadow
    of a region on an axis is wider than the interval of that parameter by itself, for which
    :func:`pbrdf.inversion.profile.profile` is.

    Parameters
    ----------
    result
        A fit.
    a, b
        Two free parameters.
    levels
        Confidence levels, between 0 and 1.
    points
        Points along each axis, at least 3. A narrow region (strongly correlated parameters) needs more.

    Returns
    -------
    Contour

    Raises
    ------
    FitError
        If a name is not that of a free parameter, the two are the same, or ``levels`` or ``points`` is out of
        range.
    """
    import xarray as xr

    columns = [free_column(result.space, name) for name in (a, b)]
    if a == b:
        raise FitError(f"contour: two different parameters are needed, got {a!r} twice")
    if not levels:
        raise FitError("contour: at least one level is needed")
    check_points(points)
    rises = {float(level): rise_of_chi2(result, level, 2) for level in levels}
    optima = Optima.of(result)
    best = optima.u[0]
    # the largest region's shadow on an axis is the profile interval at the region's own threshold
    ends = interval_ends(optima, np.array([max(rises.values())]), range(len(best))).of(columns)
    axes = []
    for number, column in enumerate(columns):
        lower, upper = ends.value[0, 2 * number : 2 * number + 2]
        margin = 0.25 * MARGIN * (upper - lower)
        low, high = max(lower - margin, optima.low[column]), min(upper + margin, optima.high[column])
        axes.append(np.linspace(low, high, points))

    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    refit = _grid(optima, columns, grid, max(rises.values()))
    values = []
    for axis, column in zip(axes, columns, strict=True):
        at = np.tile(best, (points, 1))
        at[:, column] = axis
        values.append(clipped(result.space, at)[:, column])
    dataset = xr.Dataset(
        {"chi2_rise": ((a, b), (refit.chi2[0] - optima.chi2[0]).reshape(points, points))},
        coords={a: values[0], b: values[1]},
        attrs={"levels": list(rises), "thresholds": list(rises.values())},
    )
    lowest = min(ends.lowest, refit.lowest(), key=lambda found: found.chi2[0])
    better, better_chi2 = better_optimum(optima, lowest, min(rises.values()))
    notes = better_notes(optima, better, better_chi2)
    notes.extend(unsettled_note(refit))
    return Contour(a, b, rises, dataset, better, better_chi2, notes)


def _grid(optima: Optima, columns: Sequence[int], grid: np.ndarray, rise: float) -> Refit:
    """Hold two unknowns at the points of a grid, from the optimum outwards until χ² is well above the threshold.

    Each point starts from its lowest neighbour, which follows a bent valley as it does a straight one; points
    with no neighbour within twice the threshold are left out as NaN. ``grid`` has shape (A, B, 2).
    """
    shape, size = grid.shape[:2], len(optima.low)
    number = np.pad(np.arange(shape[0] * shape[1]).reshape(shape), 1, mode="edge")
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.stack([number[i : i + shape[0], j : j + shape[1]].ravel() for i, j in shifts], axis=-1)
    points = grid.reshape(-1, 2)
    held = np.zeros((len(points), size), dtype=bool)
    held[:, list(columns)] = True
    u = np.tile(optima.u[0], (len(points), 1))
    u[:, list(columns)] = points
    found = Refit(u[None], np.full((1, len(points)), math.nan), np.ones((1, len(points)), dtype=bool))

    def retry(tried: np.ndarray, source: np.ndarray) -> bool:
        return optima.retry(found, held, tried, source, BETTER * rise)

    step = np.maximum(np.abs(grid[-1, -1] - grid[0, 0]), 1e-300) / np.array(shape)
    first = np.array([np.argmin((((points - optima.u[0][list(columns)]) / step) ** 2).sum(axis=1))])
    retry(first, first)
    visited = np.zeros(len(points), dtype=bool)
    visited[first] = True
    spare = PASSES
    while spare:
        climb = np.where(np.isnan(found.chi2[0]), np.inf, found.chi2[0] - optima.chi2[0])
        source = np.take_along_axis(around, climb[around].argmin(axis=1)[:, None], axis=1)[:, 0]
        worth = climb[source] < 2.0 * rise
        tried = np.flatnonzero(worth & ~visited)
        if len(tried):
            retry(tried, source[tried])
            visited[tried] = True
            continue
        tried = np.flatnonzero(worth & (climb[source] < climb))
        spare = spare - 1 if retry(tried, source[tried]) else 0
    return found
