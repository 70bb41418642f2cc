"""Profile likelihood: intervals of one parameter and joint regions of two, with all others refitted.

The standard error of a fit is the curvature at the optimum. A profile follows χ² itself: the parameter is held
at a value, the others are fitted again, and the interval ends where χ² has risen by the threshold. Intervals
come out asymmetric where χ² is, and end at a bound where a bound ends them. Every held value is one lane of the
batched solver, so a profile of all parameters is a handful of solver calls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pbrdf.errors import FitError
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import Solution, Status, solve
from pbrdf.inversion.statistics import covariance, prior_spread

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Contour", "Interval", "Optima", "Profile", "contour", "interval_ends", "profile", "rise_of_chi2"]

#: Solver calls at most for the ends of all intervals; some four suffice where χ² is smooth.
ROUNDS = 30

#: Precision of an end, as a part of its distance from the optimum: 1e-3 of a standard error at 95 %.
PRECISION = 5e-4

#: The root of the rise must be this close to the threshold's before its slope is trusted.
NEAR = 0.02

#: A curve goes on beyond both ends by this part of their distance from the optimum, a contour's grid by half of it.
MARGIN = 0.5

#: How often curves and grids are gone over again from neighbouring points that have a lower χ².
PASSES = 4

#: An optimum counts as better if its χ² is lower by more than this part of the threshold.
BETTER = 1e-3


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
        As in :class:`Profile`.
    """

    a: str
    b: str
    rises: dict[float, float]
    grid: xr.Dataset
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
    _check_points(points)
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
    values = _clipped(result.space, best)
    for number, (name, column) in enumerate(zip(chosen, columns, strict=True)):
        limits: list[float] = []
        for side in (2 * number, 2 * number + 1):
            at = best.copy()
            at[column] = ends.value[0, side]
            limits.append(float(_clipped(result.space, at)[column]))
        lower_at_bound, upper_at_bound = map(bool, ends.at_bound[0, 2 * number : 2 * number + 2])
        intervals[name] = Interval(
            name, float(values[column]), limits[0], limits[1], lower_at_bound, upper_at_bound
        )

    lowest = min(ends.lowest, curve.lowest(), key=lambda found: found.chi2[0])
    better, better_chi2 = _better_optimum(optima, lowest, rise)
    notes = _better_notes(optima, better, better_chi2)
    for number, (name, interval) in enumerate(intervals.items()):
        for offset, side in enumerate(("lower", "upper")):
            end = (interval.lower, interval.upper)[offset]
            others = np.flatnonzero(ends.blocked[0, 2 * number + offset])
            if ends.at_bound[0, 2 * number + offset]:
                notes.append(
                    f"{name}: the interval reaches the {side} bound ({end:.4g}); the data do not limit it on this "
                    "side."
                )
            elif len(others):
                joined = ", ".join(result.space.names[i] for i in others)
                notes.append(
                    f"{name}: at the {side} end ({end:.4g}) {joined} lies on a bound; the end depends on where that "
                    "bound is."
                )
    unresolved = [chosen[i // 2] for i in np.flatnonzero(~ends.found[0])]
    if unresolved:
        notes.append(
            f"An end of the interval of {', '.join(dict.fromkeys(unresolved))} was not found to full precision: "
            "χ² is not smooth there; look at the curve."
        )
    notes.extend(_unsettled_note(curve))
    return Profile(level, rise, intervals, curves, better, better_chi2, notes)


def contour(
    result: Optimum, a: str, b: str, *, levels: Sequence[float] = (0.68, 0.95), points: int = 41
) -> Contour:
    """Joint confidence regions of two parameters, the others refitted at every point of a grid.

    These are regions for the pair: 95 % of them hold both true values at once. Their thresholds are those of
    two degrees of freedom (χ² + 2.28 for 68 % and + 5.99 for 95 % where the uncertainties are known), so the shadow
    of a region on an axis is wider than the interval of that parameter by itself, for which :func:`profile` is.

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
    _check_points(points)
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
        values.append(_clipped(result.space, at)[:, column])
    dataset = xr.Dataset(
        {"chi2_rise": ((a, b), (refit.chi2[0] - optima.chi2[0]).reshape(points, points))},
        coords={a: values[0], b: values[1]},
        attrs={"levels": list(rises), "thresholds": list(rises.values())},
    )
    lowest = min(ends.lowest, refit.lowest(), key=lambda found: found.chi2[0])
    better, better_chi2 = _better_optimum(optima, lowest, min(rises.values()))
    notes = _better_notes(optima, better, better_chi2)
    notes.extend(_unsettled_note(refit))
    return Contour(a, b, rises, dataset, better, better_chi2, notes)


def rise_of_chi2(result: Optimum, level: float, parameters: int) -> float:
    """How far χ² may rise above its minimum inside a confidence region.

    With known uncertainties the quantile of χ² with as many degrees of freedom as parameters are looked at (3.84
    for one at 95 %). With uncertainties known up to their scale, ν = data − free degrees of freedom estimate the
    scale, and the threshold is the F-test's: parameters · F(level; parameters, ν) · χ²_min/ν. Both are exact for a
    linear model with normal errors. Known uncertainties are taken at their word even where the reduced χ² is far
    from 1.

    Parameters
    ----------
    result
        A fit.
    level
        Confidence level, between 0 and 1.
    parameters
        How many parameters the region is of.

    Raises
    ------
    FitError
        If the level is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise FitError(f"level={level:g}: a confidence level lies between 0 and 1, for example 0.95")
    from scipy import special  # its quantiles: scipy.stats would take longer to import than the fit takes

    if result.std_known:
        return float(special.chdtri(parameters, 1.0 - level))
    freedom = result.goodness.data - result.goodness.free
    ratio = float(special.fdtri(parameters, freedom, level))
    return parameters * ratio * result.goodness.reduced_chi2


def free_column(space: Space, name: str) -> int:
    """Column of a free parameter; FitError, naming the free ones, if there is none of that name."""
    if name not in space.names:
        raise FitError(f"{name!r} is not a free parameter of this fit: free are {', '.join(space.names)}")
    return space.names.index(name)


class Lowest(NamedTuple):
    """The lowest χ² that was met, shape (D,), and the unknowns there, shape (D, P)."""

    chi2: np.ndarray
    u: np.ndarray


@dataclass(frozen=True)
class Refit:
    """Fits with some unknowns held; D data sets, S lanes each, P unknowns.

    Attributes
    ----------
    u
        Shape (D, S, P).
    chi2
        Shape (D, S); NaN where the residuals are not finite.
    settled
        Whether the lane stands at a minimum, shape (D, S).
    """

    u: np.ndarray
    chi2: np.ndarray
    settled: np.ndarray

    def lowest(self) -> Lowest:
        """The lowest χ² of each data set."""
        chi2 = np.where(np.isnan(self.chi2), np.inf, self.chi2)
        lane = chi2.argmin(axis=1)
        rows = np.arange(len(lane))
        return Lowest(chi2[rows, lane], self.u[rows, lane])


@dataclass(frozen=True)
class Optima:
    """Best fits of D data sets of one form, and what is needed to move away from them.

    Attributes
    ----------
    space
        The free parameters, P of them.
    data
        D data sets of the same form.
    low, high
        Bounds of the unknowns, shape (P,).
    u
        Unknowns at the optimum of each data set, shape (D, P).
    chi2
        χ² there, shape (D,).
    at_bound
        Which unknowns stand on a bound, shape (D, P).
    information
        JᵀJ there, shape (D, P, P).
    tangent
        ``tangent[d, i]`` is the change of all unknowns, shape (P,), with a unit change of unknown i, to first order.
    error
        Standard error of each unknown for known uncertainties, the others on no bound being free, shape (D, P).
    """

    space: Space
    data: Sequence[Observations]
    low: np.ndarray
    high: np.ndarray
    u: np.ndarray
    chi2: np.ndarray
    at_bound: np.ndarray
    information: np.ndarray
    tangent: np.ndarray
    error: np.ndarray

    @classmethod
    def of(cls, result: Optimum) -> Optima:
        """The optimum of a fit."""
        return cls.at(result.space, [result.data], result.unknowns[None], result.information[None])

    @classmethod
    def at(cls, space: Space, data: Sequence[Observations], u: np.ndarray, information: np.ndarray) -> Optima:
        """Optima of D data sets: unknowns of shape (D, P) and information of shape (D, P, P)."""
        low, high = space.box
        span = high - low
        at_bound = (u <= low + 1e-9 * span) | (u >= high - 1e-9 * span)
        linear = [
            _linearised(matrix, prior_spread(low, high), on)
            for matrix, on in zip(information, at_bound, strict=True)
        ]
        # χ² exactly as the solver sees it, priors included
        chi2 = 2.0 * solve(residuals(space, data, 1), u, u, u).cost
        tangent, error = (np.stack(column) for column in zip(*linear, strict=True))
        return cls(space, data, low, high, u, chi2, at_bound, information, tangent, error)

    def refit(self, held: np.ndarray, start: np.ndarray) -> Refit:
        """Fit every data set from S starts with some unknowns held at their starting values.

        Parameters
        ----------
        held
            Mask of shape (S, P).
        start
            Unknowns of shape (D, S, P); moved onto the bounds where outside.
        """
        sets, lanes, size = start.shape
        begin = np.clip(start, self.low, self.high)
        solution: Solution = solve(
            residuals(self.space, self.data, lanes),
            begin.reshape(-1, size),
            np.where(held, begin, self.low).reshape(-1, size),
            np.where(held, begin, self.high).reshape(-1, size),
        )
        # a stalled lane has found no lower χ² in any direction, however short the step: a minimum but for rounding
        settled = solution.converged | (solution.status == Status.STALLED)
        chi2 = np.where(np.isfinite(solution.cost), 2.0 * solution.cost, math.nan)
        shape = (sets, lanes)
        return Refit(solution.u.reshape(start.shape), chi2.reshape(shape), settled.reshape(shape))


@dataclass(frozen=True)
class Ends:
    """Ends of profile intervals: lower and upper of each column in turn, S sides in all, in unknowns.

    Attributes
    ----------
    value
        The unknown at the end, shape (D, S).
    at_bound
        Whether it is the bound, χ² below the threshold there, shape (D, S).
    found
        Whether the end is known to :data:`PRECISION`, shape (D, S).
    path
        Change of all unknowns per unit change of the profiled one between optimum and end, shape (D, S, P).
    blocked
        Other unknowns that stand on a bound at the end but not at the optimum, shape (D, S, P).
    lowest
        The lowest χ² met on the way.
    """

    value: np.ndarray
    at_bound: np.ndarray
    found: np.ndarray
    path: np.ndarray
    blocked: np.ndarray
    lowest: Lowest

    def of(self, columns: Sequence[int]) -> Ends:
        """Only the ends of some columns, where those of all unknowns are known."""
        sides = (2 * np.asarray(columns)[:, None] + np.arange(2)).ravel()
        names = ("value", "at_bound", "found", "path", "blocked")
        return replace(self, **{name: getattr(self, name)[:, sides] for name in names})


def interval_ends(optima: Optima, rise: np.ndarray, columns: Sequence[int]) -> Ends:
    """Where χ², minimised over the other unknowns, has risen by a threshold; all sides of all data sets at once.

    The root of the rise is nearly linear in the unknown, so a secant on it, kept inside its bracket, takes few
    rounds. The first trial is the end that the Jacobian predicts. Where the way of another unknown passes through
    lower values of χ² further out, the search goes on from there: the interval reaches to the farthest value found
    within the threshold, also where a local optimum of the others, or a barrier, lies between.

    Parameters
    ----------
    optima
        Where to start from, D data sets.
    rise
        Threshold of each data set, shape (D,).
    columns
        The unknowns to profile.
    """
    column = np.repeat(np.asarray(columns), 2)
    sign = np.tile([-1.0, 1.0], len(columns))
    sets, sides, size = len(optima.u), len(column), len(optima.low)
    held = np.eye(size, dtype=bool)[column]
    target = np.sqrt(rise)[:, None]
    bound = np.where(sign < 0.0, optima.low[column], optima.high[column])
    room = np.abs(bound - optima.u[:, column])
    # standing on this very bound: nothing to search
    margin = 1e-9 * (optima.high - optima.low)
    at_bound = room <= margin[column]
    trial = np.minimum(target * optima.error[:, column], room)
    tangent = optima.tangent[:, column] * sign[:, None]

    base = np.broadcast_to(optima.u[:, None], (sets, sides, size))
    inner, inner_root, inner_u = np.zeros((sets, sides)), np.zeros((sets, sides)), base.copy()
    outer, outer_root = np.full((sets, sides), np.inf), np.full((sets, sides), np.inf)
    end, path, done = np.where(at_bound, room, 0.0), tangent.copy(), at_bound.copy()
    blocked = np.zeros((sets, sides, size), dtype=bool)
    lowest = Lowest(optima.chi2.copy(), optima.u.copy())
    for _ in range(ROUNDS):
        if done.all():
            break
        trial = np.where(done, inner, trial)
        start = inner_u + tangent * (trial - inner)[..., None]
        start[:, np.arange(sides), column] = optima.u[:, column] + sign * trial
        refit = optima.refit(held, start)
        best = refit.lowest()
        lower = best.chi2 < lowest.chi2
        lowest = Lowest(np.where(lower, best.chi2, lowest.chi2), np.where(lower[:, None], best.u, lowest.u))
        # where the model gives no finite residuals is outside
        climb = np.where(np.isnan(refit.chi2), np.inf, refit.chi2 - optima.chi2[:, None])
        root = np.sqrt(np.maximum(climb, 0.0))
        inside = ~done & (root < target)
        outside = ~done & ~inside
        moved = (inside | (outside & np.isfinite(root)))[..., None] & (trial > 0.0)[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            path = np.where(moved, (refit.u - base) / trial[..., None], path)
        on_bound = (refit.u <= optima.low + margin) | (refit.u >= optima.high - margin)
        fresh = on_bound & ~held & ~optima.at_bound[:, None]
        blocked = np.where(done[..., None], blocked, fresh)
        width = outer - inner
        inner_u = np.where(inside[..., None], refit.u, inner_u)
        inner, inner_root = np.where(inside, trial, inner), np.where(inside, root, inner_root)
        outer, outer_root = np.where(outside, trial, outer), np.where(outside, root, outer_root)

        at_bound = at_bound | (inside & (trial >= room))
        bracketed = np.isfinite(outer)
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = inner + (outer - inner) * (target - inner_root) / (outer_root - inner_root)
            usable = bracketed & np.isfinite(outer_root)
            off = np.abs(root - target) * (outer - inner) / (outer_root - inner_root)
            # a secant that leaves most of the bracket standing is followed by a bisection
            slow = np.isfinite(width) & (outer - inner > 0.5 * width)
            halved = np.where(usable & ~slow, secant, 0.5 * (inner + outer))
            further = np.minimum(np.maximum(1.05 * inner * target / inner_root, 1.2 * inner), 4.0 * inner)
            tolerance = PRECISION * outer
            near = usable & (np.abs(root - target) <= NEAR * target)
        close = (near & (off <= tolerance)) | (bracketed & (outer - inner <= tolerance))
        found = ~done & (close | at_bound)
        reached = np.where(at_bound, room, np.where(usable, secant, np.where(bracketed, inner, trial)))
        end = np.where(done, end, reached)
        done = done | found
        trial = np.where(bracketed, halved, np.minimum(np.where(np.isnan(further), room, further), room))

        # a point of any lane within the threshold and further out shows that this side's end lies beyond it
        away = sign[:, None] * (refit.u - base[:, :1]).swapaxes(1, 2)[:, column]
        away = np.where((root < target)[:, None, :], away, -np.inf)
        lane = away.argmax(axis=2)
        far = np.take_along_axis(away, lane[..., None], axis=2)[..., 0]
        passed = far > (1.0 + 4.0 * PRECISION) * np.where(done, end, inner)
        there = np.take_along_axis(refit.u, lane[..., None], axis=1)
        inner_u = np.where(passed[..., None], there, inner_u)
        with np.errstate(divide="ignore", invalid="ignore"):
            path = np.where(passed[..., None], (there - base) / far[..., None], path)
            inner = np.where(passed, far, inner)
            inner_root = np.where(passed, np.take_along_axis(root, lane, axis=1), inner_root)
            ahead = np.clip(inner * target / inner_root, 1.1 * inner, 2.0 * inner)
        beyond = passed & (outer <= inner)
        outer, outer_root = np.where(beyond, np.inf, outer), np.where(beyond, np.inf, outer_root)
        trial = np.where(
            passed, np.where(np.isfinite(outer), 0.5 * (inner + outer), np.minimum(ahead, room)), trial
        )
        at_bound = np.where(passed, far >= room - margin[column], at_bound)
        end = np.where(passed & at_bound, room, end)
        done = np.where(passed, at_bound, done)
    value = np.where(at_bound, bound, optima.u[:, column] + sign * end)
    return Ends(value, at_bound, done, path * sign[:, None], blocked, lowest)


def _linearised(information: np.ndarray, prior: np.ndarray, at_bound: np.ndarray) -> tuple[np.ndarray, ...]:
    """Tangents, shape (P, P), and standard errors, shape (P,), of the unknowns, each profiled by itself."""
    size = len(prior)
    tangent, error = np.zeros((size, size)), np.empty(size)
    for i in range(size):
        inside = np.flatnonzero(~at_bound | (np.arange(size) == i))
        cov = covariance(information[np.ix_(inside, inside)], prior[inside])
        j = int(np.searchsorted(inside, i))
        tangent[i, inside] = cov[:, j] / cov[j, j]
        error[i] = math.sqrt(cov[j, j])
    return tangent, error


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
        lower = _retry(optima, found, held, tried, source[tried], BETTER * rise)
        if turn % 2 and not (lower or lowered_before):
            break
        lowered_before = lower
    return found


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
        return _retry(optima, found, held, tried, source, BETTER * rise)

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


def _retry(
    optima: Optima, found: Refit, held: np.ndarray, tried: np.ndarray, source: np.ndarray, worth: float
) -> bool:
    """Refit some lanes of the first data set from the ends of others, keep what is lower; whether anything was."""
    if not len(tried):
        return False
    start = np.where(held[tried], found.u[0, tried], found.u[0, source])
    again = optima.refit(held[tried], start[None])
    before = np.where(np.isnan(found.chi2[0, tried]), np.inf, found.chi2[0, tried])
    lower = again.chi2[0] < before - worth
    for name in ("u", "chi2", "settled"):
        getattr(found, name)[0, tried[lower]] = getattr(again, name)[0, lower]
    return bool(lower.any())


def _clipped(space: Space, unknowns: np.ndarray) -> np.ndarray:
    """Parameters (..., P), the rounding of the way through the unknowns not leading out of the bounds."""
    return np.clip(space.to_parameters(unknowns), space.lower, space.upper)


def _better_optimum(optima: Optima, lowest: Lowest, rise: float) -> tuple[dict[str, float] | None, float]:
    """The free parameters and χ² of a better optimum, reached from the lowest χ² met, if there is one."""
    if not lowest.chi2[0] < optima.chi2[0] - BETTER * rise:
        return None, math.nan
    held = np.zeros((1, len(optima.low)), dtype=bool)
    refit = optima.refit(held, lowest.u[:, None])
    values = _clipped(optima.space, refit.u[0, 0])
    return dict(zip(optima.space.names, map(float, values), strict=True)), float(refit.chi2[0, 0])


def _better_notes(optima: Optima, better: dict[str, float] | None, chi2: float) -> list[str]:
    if better is None:
        return []
    where = ", ".join(f"{name}={value:.6g}" for name, value in better.items())
    return [
        f"Profiling found a better optimum (χ² {chi2:.6g}, the fit's is {optima.chi2[0]:.6g}) at {where}: fit again "
        "from there; what is shown refers to the fit's."
    ]


def _unsettled_note(refit: Refit) -> list[str]:
    count = int((~refit.settled).sum())
    if not count:
        return []
    return [f"{count} of {refit.settled.size} points did not converge; χ² may be too high there."]


def _check_points(points: int) -> None:
    if points < 3:
        raise FitError(f"points={points}: at least 3 are needed")
