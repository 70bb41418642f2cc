"""Where the fits of many pixels ended, and how they got there: starts, searches, ends, distinct optima."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from pbrdf.inversion import minimise
from pbrdf.inversion.block_solver import BlockResiduals
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import CONVERGED, NOTHING_TO_GAIN, Solution, Status, costs, on_bounds
from pbrdf.inversion.solver import solve as solve_whole
from pbrdf.inversion.stack import Stack
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.unknowns import apply_starts

__all__ = ["Ends", "Pixels", "grouped"]

#: Ends of a search that are the same optimum: in every unknown to this part of its range, in the cost to this part;
#: and ends of fits.
SEARCHED, ENDED = (1e-3, 1e-3), (1e-4, 1e-6)
#: Distinct ends of a search that are looked at in the model's own accuracy: of no more than so many times the best χ²,
#: and so many at most.
RIVALS, LEADERS = 10.0, 8
#: Lanes that are searched together, at most.
LANES = 1 << 16


@dataclass(frozen=True)
class Ends:
    """What the fits of B pixels came to.

    Attributes
    ----------
    u, cost, information, gradient, status
        As of :class:`~pbrdf.inversion.solver.Solution`, a lane for each pixel.
    optima
        Distinct optima seen, shape (B,).
    starts
        Starts that were followed, shape (B,).
    """

    u: np.ndarray
    cost: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    status: np.ndarray
    optima: np.ndarray
    starts: np.ndarray

    @classmethod
    def none(cls, batch: int, size: int) -> Ends:
        """Of pixels that were not fitted yet."""
        return cls(
            np.full((batch, size), np.nan),
            np.full(batch, np.inf),
            np.zeros((batch, size, size)),
            np.zeros((batch, size)),
            np.full(batch, int(Status.NOT_FINITE)),
            np.zeros(batch, dtype=int),
            np.zeros(batch, dtype=int),
        )

    @property
    def converged(self) -> np.ndarray:
        """Which pixels stand at a minimum, shape (B,)."""
        return np.isin(self.status, CONVERGED)

    @property
    def reached(self) -> np.ndarray:
        """Which pixels have an end at all, shape (B,)."""
        values: np.ndarray = np.isfinite(self.cost)
        return values

    def put(self, pixels: np.ndarray, found: Ends) -> None:
        """Take the ends of some pixels."""
        for f in fields(self):
            getattr(self, f.name)[pixels] = getattr(found, f.name)

    def __getitem__(self, chosen: np.ndarray) -> Ends:
        return Ends(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})


@dataclass(frozen=True, eq=False)
class Pixels:
    """The fits of many pixels of one form.

    Attributes
    ----------
    space
        Free and fixed parameters.
    stack
        What was measured at the pixels.
    low, high
        Bounds of the solver's unknowns at each pixel, shape (B, P); where they are equal an unknown is held.
    begin, start
        Starting values: those of a given model, which one start takes, and those that all take.
    starts, seed
        Number of starts of a search from many, and their seed.
    max_iterations
        Steps of each start, at most.
    """

    space: Space
    stack: Stack
    low: np.ndarray
    high: np.ndarray
    begin: Mapping[str, float]
    start: Mapping[str, float]
    starts: int
    seed: int
    max_iterations: int

    def from_many(
        self, pixels: np.ndarray, known: Ends | None = None, progress: Callable[[int], None] | None = None
    ) -> Ends:
        """Fit pixels from many starts: search in draft accuracy, then each distinct end in the model's own.

        Parameters
        ----------
        pixels
            Their numbers.
        known
            Ends of all pixels as they are: those of the searched ones take part.
        progress
            Called with the number of pixels that are done.
        """
        at_once = max(1, LANES // self.starts)
        parts = []
        for begin in range(0, len(pixels), at_once):
            part = pixels[begin : begin + at_once]
            parts.append(self._from_many(part, None if known is None else known[part]))
            if progress is not None:
                progress(begin + len(part))
        if not parts:
            return Ends.none(0, self.low.shape[1])
        return Ends(
            **{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Ends)}
        )

    def _from_many(self, pixels: np.ndarray, known: Ends | None) -> Ends:
        count, size = len(pixels), self.low.shape[1]
        low, high = self.low[pixels], self.high[pixels]
        first = self._first(pixels)
        owner = np.repeat(pixels, first.shape[1])
        search = self.search(owner, first.reshape(-1, size))
        u, cost = search.u.reshape(first.shape), search.cost.reshape(first.shape[:2])
        with np.errstate(invalid="ignore"):
            rival = cost <= RIVALS * np.min(np.where(np.isfinite(cost), cost, np.inf), axis=1, keepdims=True)
        leaders = grouped(u, np.where(rival, cost, np.inf), high - low, *SEARCHED, LEADERS)
        row, column = np.nonzero(leaders >= 0)
        start = u[row, leaders[row, column]]
        solution = self.end(pixels[row], start)
        if known is not None:
            # the end that was known is one more; where it is none its cost is infinite
            row = np.concatenate([row, np.arange(count)])
            solution = Solution(
                np.concatenate([solution.u, known.u]),
                np.concatenate([solution.cost, known.cost]),
                np.concatenate([solution.information, known.information]),
                np.concatenate([solution.gradient, known.gradient]),
                np.concatenate([solution.status, known.status]),
                np.zeros(len(row), dtype=int),
            )
        return _best(solution, row, low, high, first.shape[1] + (0 if known is None else known.starts))

    def _first(self, pixels: np.ndarray) -> np.ndarray:
        """Starts of pixels, spread over the bounds of each, shape (n, S, P)."""
        size = self.low.shape[1]
        part = sobol_starts(np.zeros(size), np.ones(size), self.starts, self.seed)
        part = part[np.argsort(part[:, 0])]  # neighbours alike: they then take the same branches
        low, high = self.low[pixels], self.high[pixels]
        first = low[:, None] + part * (high - low)[:, None]
        bounds = self.space.to_parameters(low), self.space.to_parameters(high)
        apply_starts(first, self.space, self.begin, self.start, bounds)
        values: np.ndarray = np.clip(first, low[:, None], high[:, None])
        return values

    def search(self, owner: np.ndarray, start: np.ndarray) -> Solution:
        """Rough ends of lanes, in draft accuracy and single precision; ``owner`` is the pixel of each."""
        problem = residuals(self.space, self.stack, owner, accuracy="draft")
        low, high = self.low[owner], self.high[owner]
        if isinstance(problem, BlockResiduals):
            return minimise.solve(
                problem, start, low, high, max_iterations=self.max_iterations, tolerance=1e-6
            )
        return solve_whole(
            problem, start, low, high, max_iterations=self.max_iterations, tolerance=1e-6, search=True
        )

    def end(self, owner: np.ndarray, start: np.ndarray) -> Solution:
        """Ends of lanes that start near them, in the model's own accuracy."""
        problem = residuals(self.space, self.stack, owner)
        low, high = self.low[owner], self.high[owner]
        if isinstance(problem, BlockResiduals):
            return minimise.solve(problem, start, low, high, max_iterations=self.max_iterations)
        return solve_whole(problem, start, low, high, max_iterations=self.max_iterations, near=True)

    def near(self, pixels: np.ndarray, start: np.ndarray) -> Ends:
        """Ends of pixels from one start each, near them."""
        solution = self.end(pixels, start)
        one = np.isfinite(solution.cost).astype(int)
        return Ends(
            solution.u,
            solution.cost,
            solution.information,
            solution.gradient,
            solution.status,
            one,
            np.ones_like(one),
        )

    def costs(self, owner: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Cost of lanes without priors, in draft accuracy and single precision; 0 where there is no quick way to it."""
        if not len(owner):
            return np.zeros(0)
        problem = residuals(self.space, self.stack, owner, accuracy="draft")
        if isinstance(problem, BlockResiduals):
            return np.zeros(len(owner))
        found = costs(problem, u)
        return np.where(np.isfinite(found), found, np.inf)


def _best(
    solution: Solution, row: np.ndarray, low: np.ndarray, high: np.ndarray, starts: np.ndarray | int
) -> Ends:
    """The best end of each of n pixels, chosen as :meth:`Solution.best` does; ``row`` is the pixel of each lane."""
    count, size = low.shape
    place = np.zeros(len(row), dtype=int)
    order = np.argsort(row, kind="stable")
    begin = np.searchsorted(row[order], np.arange(count))
    place[order] = np.arange(len(row)) - begin[row[order]]
    width = int(place.max(initial=0)) + 1

    def table(values: np.ndarray, empty: float) -> np.ndarray:
        result = np.full((count, width, *values.shape[1:]), empty, dtype=values.dtype)
        result[row, place] = values
        return result

    u, cost = table(solution.u, np.nan), table(solution.cost, np.inf)
    cost = np.where(np.isfinite(cost), cost, np.inf)
    status = table(solution.status, int(Status.NOT_FINITE))
    converged = table(solution.converged, False)
    with np.errstate(invalid="ignore"):
        on_bound = np.logical_or(*on_bounds(u, low[:, None], high[:, None]))
        as_low = cost <= cost.min(axis=1, keepdims=True) * (1.0 + NOTHING_TO_GAIN)
    rank = np.where(as_low, 0, 4 * size) + np.where(converged, 0, 2 * size) + on_bound.sum(axis=2)
    lowest = np.where(rank == rank.min(axis=1, keepdims=True), cost, np.inf)
    best = np.argmin(lowest, axis=1)
    here = np.arange(count)
    counted = np.where(converged, cost, np.inf)
    counted[here, best] = cost[here, best]
    optima = (grouped(u, counted, high - low, *ENDED, width) >= 0).sum(axis=1)
    return Ends(
        u[here, best],
        cost[here, best],
        table(solution.information, 0.0)[here, best],
        table(solution.gradient, 0.0)[here, best],
        status[here, best],
        optima,
        np.zeros(count, dtype=int) + starts,
    )


def grouped(
    u: np.ndarray, cost: np.ndarray, span: np.ndarray, distance: float, cost_difference: float, most: int
) -> np.ndarray:
    """The best of each group of ends of each of n pixels, as :func:`~pbrdf.inversion.clusters.cluster` makes them.

    Parameters
    ----------
    u, cost
        Ends, shapes (n, S, P) and (n, S); those of infinite cost are left out.
    span
        Range of each unknown, shape (n, P).
    distance, cost_difference
        Tolerances.
    most
        Groups of a pixel at most, the best ones.

    Returns
    -------
    ndarray
        Numbers of the ends, shape (n, most), best first; −1 where there are fewer groups.
    """
    left = np.where(np.isfinite(cost), cost, np.inf)
    found = np.full((len(u), most), -1)
    for number in range(most):
        best = np.argmin(left, axis=1)
        least = np.take_along_axis(left, best[:, None], axis=1)
        there = np.isfinite(least[:, 0])
        if not there.any():
            break
        found[there, number] = best[there]
        with np.errstate(invalid="ignore"):
            near = (np.abs(u - u[np.arange(len(u)), best][:, None]) <= distance * span[:, None]).all(axis=2)
            alike = near & (left - least <= cost_difference * least + 1e-9)
        left = np.where(alike, np.inf, left)
        left[there, best[there]] = np.inf
    return found
