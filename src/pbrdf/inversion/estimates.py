"""Parameters after a fit: values, standard errors, verdicts, and the distinct optima that the starts found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.inversion.clusters import cluster
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space
from pbrdf.inversion.solver import Solution, on_bounds
from pbrdf.inversion.statistics import Goodness, covariance, prior_spread
from pbrdf.models.parameters import Parameter

__all__ = ["DistinctOptimum", "Estimate", "distinct_optima", "estimates_at"]


@dataclass(frozen=True)
class Estimate:
    """One parameter after a fit.

    Attributes
    ----------
    parameter
        What it is.
    value
        Value at the best optimum.
    std
        Standard error; NaN where it means nothing (fixed, on a bound, undetermined).
    lower, upper
        Bounds that the fit kept; least and largest value of what was held at one of each wavelength, of which `value`
        is the first.
    verdict
        ``"determined"``, ``"undetermined"`` (the data tell no more than the bounds), ``"at lower bound"``,
        ``"at upper bound"``, ``"fixed"``, or ``"not converged"`` where the fit stands at no minimum.
    """

    parameter: Parameter
    value: float
    std: float
    lower: float
    upper: float
    verdict: str


@dataclass(frozen=True)
class DistinctOptimum:
    """A distinct optimum found from many starts.

    Attributes
    ----------
    values
        Free parameters by name.
    chi2
        Σ (residual/std)² there.
    count
        How many starts reached it.
    """

    values: dict[str, float]
    chi2: float
    count: int


def estimates_at(
    space: Space,
    values: np.ndarray,
    solution: Solution,
    best: int,
    data: Observations,
    quality: Goodness,
) -> tuple[dict[str, Estimate], tuple[list[str], np.ndarray]]:
    """Every parameter by name at the best optimum, and the correlation of the free ones that are on no bound.

    Parameters
    ----------
    space, values
        The problem, and the free parameters at the optimum, shape (P,).
    solution, best
        What the solver found, and the number of the best start.
    data, quality
        What was fitted, and how well; where the data state no uncertainties, standard errors carry the residual scale.
    """
    low, high = space.box
    u = solution.u[best]
    at_low, at_high = on_bounds(u, low, high)
    inside = np.flatnonzero(~(at_low | at_high))
    prior = prior_spread(low, high)
    information = solution.information[best][np.ix_(inside, inside)]
    cov = covariance(information, prior[inside]) if len(inside) else np.empty((0, 0))
    if not data.std_known and math.isfinite(quality.reduced_chi2):
        cov = cov * quality.reduced_chi2
    error = np.full(len(u), math.nan)
    error[inside] = np.sqrt(np.diag(cov))
    undetermined = error >= prior
    slope = space.derivative(values)
    estimates = {
        p.name: Estimate(p, value, math.nan, value, value, "fixed")
        for p in space.model.parameters
        if (value := space.fixed.get(p.name)) is not None
    }
    for p in space.model.parameters:
        if table := space.by_wavelength.get(p.name):
            held = list(table.values())
            estimates[p.name] = Estimate(p, held[0], math.nan, min(held), max(held), "fixed")
    for i, p in enumerate(space.free):
        std = float(error[i] * slope[i])
        if not solution.converged[best]:
            verdict, std = "not converged", math.nan
        elif at_low[i]:
            verdict, std = "at lower bound", math.nan
        elif at_high[i]:
            verdict, std = "at upper bound", math.nan
        elif undetermined[i]:
            verdict, std = "undetermined", math.nan
        else:
            verdict = "determined"
        estimates[p.name] = Estimate(
            p, float(values[i]), std, float(space.lower[i]), float(space.upper[i]), verdict
        )
    order = {p.name: k for k, p in enumerate(space.model.parameters)}
    estimates = dict(
        sorted(estimates.items(), key=lambda item: order.get(item[0].partition("[")[0], len(order)))
    )
    scale = np.sqrt(np.diag(cov))
    correlation = cov / np.outer(scale, scale) if len(inside) else cov
    return estimates, ([space.names[i] for i in inside], correlation)


def distinct_optima(space: Space, solution: Solution, best: int) -> list[DistinctOptimum]:
    """Ends of the starts that converged, and that of the lane ``best``; those that agree together, the best first."""
    low, high = space.box
    cost = np.where(solution.converged, solution.cost, np.inf)
    cost[best] = solution.cost[best]
    return [
        DistinctOptimum(
            dict(zip(space.names, map(float, space.to_parameters(solution.u[members[0]])), strict=True)),
            2.0 * float(cost[members[0]]),
            len(members),
        )
        for members in cluster(solution.u, cost, high - low, 1e-4, 1e-6)
    ]
