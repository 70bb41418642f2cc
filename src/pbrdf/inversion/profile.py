"""Profile likelihood: intervals of one parameter, with all others refitted.

The standard error of a fit is the curvature at the optimum. A profile follows χ² itself: the parameter is held
at a value, the others are fitted again, and the interval ends where χ² has risen by the threshold. Intervals
come out asymmetric where χ² is, and end at a bound where a bound ends them. Every held value is one lane of the
batched solver, so a profile of all parameters is a handful of solver calls.
"""

from __future__ import annotations

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


__all__ = ["Interval", "Profile", "profile"]


@dataclass(frozen=True)
class Interval:
    """Profile-likelihood interval of one parameter, in the parameter's own unit.

    Attributes
    ----------
    name
        Name of the parameter.
    value
        Best value.
    lower, upper
        Ends of the interval.
    lower_at_bound, upper_at_bound
        Whether χ² has not yet risen by the threshold at the parameter's bound: the interval ends there because
        the bound does, and the data do not limit the parameter on this side.
    """

    name: str
    value: float
    lower: float
    upper: float
    lower_at_bound: bool
    upper_at_bound: bool


@dataclass(frozen=True)
class Profile:
    """Profile-likelihood intervals of some parameters.

    Attributes
    ----------
    level
        Confidence level of each interval by itself.
    rise
        Threshold: how far χ² rises above its minimum at the ends.
    intervals
        By parameter name.
    curves
        Over ``parameter`` and ``point``: ``value`` (the held value, own unit), ``chi2_rise`` (χ² above its
        minimum, NaN where the model gave no finite residuals) and, over ``other`` too, ``refitted`` (all free
        parameters at each point, own units).
    better
        Free parameters of an optimum with a lower χ² than the fit's if profiling found one, else None.
    better_chi2
        χ² there; NaN if there is none.
    notes
        Sentences that a reader of the intervals must know.
    """

    level: float
    rise: float
    intervals: dict[str, Interval]
    curves: xr.Dataset
    better: dict[str, float] | None
    better_chi2: float
    notes: list[str] = field(default_factory=list)


def profile(
    result: Optimum, names: Sequence[str] | None = None, *, level: float = 0.95, points: int = 31
) -> Profile:
    """Profile-likelihood intervals of free parameters.

    An interval reaches from the lowest to the highest value found at which χ², minimised over the other
    parameters, stays within the threshold of :func:`rise_of_chi2`; a second optimum within the threshold lies
    inside. For a parameter whose optimum lies on a bound the threshold is conservative: the interval holds the
    true value at least as often as the level says.

    Parameters
    ----------
    result
        A fit.
    names
        Free parameters to profile; None takes all.
    level
        Confidence level of each interval, between 0 and 1.
    points
        Points of each curve, at least 3.

    Returns
    -------
    Profile

    Raises
    ------
    FitError
        If a name is not that of a free parameter, or ``level`` or ``points`` is out of range.
    """
    import xarray as xr

    chosen = list(result.space.names if names is None else names)
    columns = [free_column(result.space, name) for name in chosen]
    if not columns:
        raise FitError("profile: no parameter was named")
    check_points(points)
    optima = Optima.of(result)
    rise = rise_of_chi2(result, level, 1)
    best = optima.u[0]
    # all parameters are searched whichever are asked for: each may lead the others to a lower χ²
    ends = interval_ends(optima, np.array([rise]), range(len(best))).of(columns)

    starts = []
    for number, column in enumerate(columns):
        middle = best[column]
        lower, upper = ends.value[0, 2 * number : 2 * number + 2]
        low = max(middle - (1.0 + MARGIN) * (middle - lower), optima.low[column])
        high = min(middle + (1.0 + MARGIN) * (upper - middle), optima.high[column])
        along = np.linspace(low, high, points)
        # the others start on the straight lines from the optimum to the two ends
        side = 2 * number + (along > middle)
        start = best + ends.path[0, side] * (along - middle)[:, None]
        start[:, column] = along
        starts.append(start)
    curve = _curves(optima, np.repeat(columns, points), np.concatenate(starts), rise)
    chi2, u = curve.chi2[0].reshape(-1, points), curve.u[0].reshape(len(columns), points, -1)
    refitted = result.space.to_parameters(u)
    curves = xr.Dataset(
        {
            "value": (("parameter", "point"), refitted[np.arange(len(columns)), :, columns]),
            "chi2_rise": (("parameter", "point"), chi2 - optima.chi2[0]),
            "refitted": (("parameter", "point", "other"), refitted),
        },
        coords={"parameter": chosen, "other": result.space.names},
        attrs={"level": level, "threshold": rise},
    )

    intervals = {}
    values = clipped(result.space, best)
    for number, (name, column) in enumerate(zip(chosen, columns, strict=True)):
        limits: list[float] = []
        for side in (2 * number, 2 * number + 1):
            at = best.copy()
            at[column] = ends.value[0, side]
            limits.append(float(clipped(result.space, at)[column]))
        lower_at_bound, upper_at_bound = map(bool, ends.at_bound[0, 2 * number : 2 * number + 2])
        intervals[name] = Interval(
            name, float(values[column]), limits[0], limits[1], lower_at_bound, upper_at_bound
        )

    lowest = min(ends.lowest, curve.lowest(), key=lambda found: found.chi2[0])
    better, better_chi2 = better_optimum(optima, lowest, rise)
    notes = better_notes(optima, better, better_chi2)
    for number, (name, interval) in enumerate(intervals.items()):
        for offset, side in enumerate(("lower", "upper")):
            end = result.space.free[columns[number]].shown((interval.lower, interval.upper)[offset])
            others = np.flatnonzero(ends.blocked[0, 2 * number + offset])
            if ends.at_bound[0, 2 * number + offset]:
                notes.append(
                    f"{name}: the interval reaches the {side} bound ({end}); the data do not limit it on this "
                    "side."
                )
            elif len(others):
                joined = ", ".join(result.space.names[i] for i in others)
                notes.append(
                    f"{name}: at the {side} end ({end}) {joined} lies on a bound; the end depends on where that "
                    "bound is."
                )
    unresolved = [chosen[i // 2] for i in np.flatnonzero(~ends.found[0])]
    if unresolved:
        notes.append(
            f"An end of the interval of {', '.join(dict.fromkeys(unresolved))} was not found to full precision: "
            "χ² is not smooth there; look at the curve."
        )
    notes.extend(unsettled_note(curve))
    return Profile(level, rise, intervals, curves, better, better_chi2, notes)


def _curves(optima: Optima, column: np.ndarray, start: np.ndarray, rise: float) -> Refit:
    """Hold one unknown at each of N points, then try again from points nearby that have a lower χ².

    ``column`` is the unknown that each point holds, shape (N,), ``start`` the unknowns, shape (N, P).
    """
    held = np.eye(len(optima.low), dtype=bool)[column]
    rows = np.arange(len(column))
    value = start[rows, column]
    # a curve's points are equally spaced
    spacing = np.array([np.ptp(value[column == c]) / max((column == c).sum() - 1, 1) for c in column])
    found = optima.refit(held, start[None])
    lowered_before = False
    for turn in range(2 * PASSES):
        climb = np.where(np.isnan(found.chi2[0]), np.inf, found.chi2[0] - optima.chi2[0])
        apart = (found.u[0][:, column].T - value[:, None]) / np.maximum(spacing, 1e-300)[:, None]
        # a point a step away may cost a third of the threshold less before it is worth a trial
        score = climb + 0.3 * rise * apart**2
        # from below and from above in turn: the better branch may come from either side
        score[apart <= 0.0 if turn % 2 else apart >= 0.0] = np.inf
        score[rows, rows] = np.inf
        source = score.argmin(axis=1)
        tried = np.flatnonzero(score[rows, source] < climb)
        lower = optima.retry(found, held, tried, source[tried], BETTER * rise)
        if turn % 2 and not (lower or lowered_before):
            break
        lowered_before = lower
    return found
