"""Fits with some unknowns held: what moves away from a best fit, from many starts in one solver call."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pbrdf.inversion.minimise import solve
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import Solution, Status, on_bounds
from pbrdf.inversion.statistics import covariance, prior_spread

__all__ = ["Lowest", "Optima", "Refit"]


class Lowest(NamedTuple):
    """The lowest χ² that was met, shape (D,), and the unknowns there, shape (D, P)."""

    chi2: np.ndarray
    u: np.ndarray

    def or_lower(self, other: Lowest) -> Lowest:
        """The lower of two for each data set; this one where they are equal."""
        lower = other.chi2 < self.chi2
        return Lowest(np.where(lower, other.chi2, self.chi2), np.where(lower[:, None], other.u, self.u))


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
        at_bound = np.logical_or(*on_bounds(u, low, high))
        linear = [
            _linearised(matrix, prior_spread(low, high), on)
            for matrix, on in zip(information, at_bound, strict=True)
        ]
        tangent, error = (np.stack(column) for column in zip(*linear, strict=True))
        return cls(space, data, low, high, u, at_bound, information, tangent, error)

    @functools.cached_property
    def chi2(self) -> np.ndarray:
        """χ² at the optimum of each data set, priors included, exactly as the solver sees it; shape (D,)."""
        return 2.0 * solve(residuals(self.space, self.data, 1), self.u, self.u, self.u).cost

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

    def retry(
        self, found: Refit, held: np.ndarray, tried: np.ndarray, source: np.ndarray, worth: float
    ) -> bool:
        """Refit some lanes of the first data set from the ends of others, keep in ``found`` what is lower.

        Parameters
        ----------
        found
            Refits so far, changed in place.
        held
            Mask of shape (S, P).
        tried, source
            Numbers of the lanes to refit, and of those from whose ends their free unknowns start.
        worth
            χ² must be lower by more than this.

        Returns
        -------
        bool
            Whether any was.
        """
        if not len(tried):
            return False
        start = np.where(held[tried], found.u[0, tried], found.u[0, source])
        again = self.refit(held[tried], start[None])
        before = np.where(np.isnan(found.chi2[0, tried]), np.inf, found.chi2[0, tried])
        lower = again.chi2[0] < before - worth
        for name in ("u", "chi2", "settled"):
            getattr(found, name)[0, tried[lower]] = getattr(again, name)[0, lower]
        return bool(lower.any())


def _linearised(information: np.ndarray, prior: np.ndarray, at_bound: np.ndarray) -> tuple[np.ndarray, ...]:
    """Tangents, shape (P, P), and standard errors, shape (P,), of the unknowns, each profiled by itself."""
    size = len(prior)
    tangent, error = np.zeros((size, size)), np.empty(size)
    # an unknown on a bound is freed for its own profile only
    for of in (np.flatnonzero(~at_bound), *np.flatnonzero(at_bound)[:, None]):
        inside = np.union1d(np.flatnonzero(~at_bound), of)
        cov = covariance(information[np.ix_(inside, inside)], prior[inside])
        for i, j in zip(of, np.searchsorted(inside, of), strict=True):
            tangent[i, inside] = cov[:, j] / cov[j, j]
            error[i] = math.sqrt(cov[j, j])
    return tangent, error
