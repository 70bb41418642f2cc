"""Parametric bootstrap: fit data simulated from the best model and look at how the parameters scatter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.errors import FitError
from pbrdf.inversion.minimise import solve
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.problem import predict, residuals
from pbrdf.inversion.solver import Status

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Bootstrap", "bootstrap", "simulate"]


@dataclass(frozen=True)
class Bootstrap:
    """Parameters of many simulated data sets, in the parameters' own units.

    Attributes
    ----------
    samples
        Dimensions ``sample`` and ``parameter``; fits that failed are left out.
    level
        Share of the samples between the percentiles.
    percentiles
        Dimensions ``parameter`` and ``limit`` (``lower``, ``upper``).
    bias
        Mean of the samples − value of the fit, dimension ``parameter``.
    bias_error
        Its standard error from the finite number of samples, dimension ``parameter``.
    covariance
        Dimensions ``parameter`` and ``other``.
    at_bound
        Share of the samples in which the parameter stands on a bound, dimension ``parameter``.
    failed
        Number of simulated data sets whose fit did not converge.
    notes
        Sentences that a reader of the numbers must know.
    """

    samples: xr.DataArray
    level: float
    percentiles: xr.DataArray
    bias: xr.DataArray
    bias_error: xr.DataArray
    covariance: xr.DataArray
    at_bound: xr.DataArray
    failed: int
    notes: list[str] = field(default_factory=list)


def bootstrap(
    result: Optimum,
    count: int = 200,
    *,
    seed: int = 0,
    level: float = 0.95,
    progress: Callable[[int, int], None] | None = None,
) -> Bootstrap:
    """Fit simulated data sets, all in one batch, from the optimum of a fit.

    The data sets are the best model plus normal errors of the data's standard uncertainties and correlations; where
    the former are a guess, multiplied with the root of the reduced χ². They answer how much random errors of that size
    move the parameters if the model is true. Starting from the optimum, they do not show other optima.

    Parameters
    ----------
    result
        A fit.
    count
        Number of simulated data sets, at least 2.
    seed
        Seed of the errors.
    level
        Share of the samples between the percentiles, between 0 and 1.
    progress
        Called with the number of finished fits and of all.

    Returns
    -------
    Bootstrap

    Raises
    ------
    FitError
        If ``count`` or ``level`` is out of range, or fewer than two fits converge.
    """
    import xarray as xr

    if count < 2:
        raise FitError(f"count={count}: a bootstrap needs at least 2 simulated data sets")
    if not 0.0 < level < 1.0:
        raise FitError(f"level={level:g}: a share lies between 0 and 1, for example 0.95")
    space, data = result.space, result.data
    scale = 1.0 if result.std_known else math.sqrt(result.goodness.reduced_chi2)
    modelled = predict(space, result.unknowns, data, data.channels)
    truth = np.stack([modelled[name] for name in data.channels])
    sets = simulate(data, truth, count, np.random.default_rng(seed), scale)
    low, high = space.box
    start = np.tile(result.unknowns, (count, 1))
    solution = solve(residuals(space, sets, 1), start, low, high, progress=progress)

    # a stalled fit has found no lower χ² however short the step: a minimum but for rounding
    good = solution.converged | (solution.status == Status.STALLED)
    failed = int((~good).sum())
    if good.sum() < 2:
        raise FitError(f"{failed} of {count} fits of simulated data did not converge: nothing to describe")
    u = solution.u[good]
    values = np.clip(space.to_parameters(u), space.lower, space.upper)
    best = np.clip(space.to_parameters(result.unknowns), space.lower, space.upper)
    names = list(space.names)
    by_parameter = {"parameter": names}

    def array(numbers: np.ndarray) -> xr.DataArray:
        return xr.DataArray(numbers, dims="parameter", coords=by_parameter)

    tails = np.quantile(values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    margin = 1e-9 * (high - low)
    at_bound = ((u <= low + margin) | (u >= high - margin)).mean(axis=0)
    notes = []
    if failed:
        notes.append(f"{failed} of {count} fits of simulated data did not converge and are left out.")
    if any(term.prior is not None for term in space.terms):
        notes.append(
            "Priors are the same for every simulated data set: parameters that rest on one scatter less than their "
            "standard error says."
        )
    often = [f"{name} ({share:.0%})" for name, share in zip(names, at_bound, strict=True) if share >= 0.05]
    if often:
        notes.append(
            f"On a bound in many samples: {', '.join(often)}; their percentiles end there, and a covariance "
            "describes them badly."
        )
    return Bootstrap(
        samples=xr.DataArray(values, dims=("sample", "parameter"), coords=by_parameter, name="samples"),
        level=level,
        percentiles=xr.DataArray(
            tails.T, dims=("parameter", "limit"), coords={**by_parameter, "limit": ["lower", "upper"]}
        ),
        bias=array(values.mean(axis=0) - best),
        bias_error=array(values.std(axis=0, ddof=1) / math.sqrt(len(values))),
        covariance=xr.DataArray(
            np.atleast_2d(np.cov(values, rowvar=False)),
            dims=("parameter", "other"),
            coords={**by_parameter, "other": names},
        ),
        at_bound=array(at_bound),
        failed=failed,
        notes=notes,
    )


def simulate(
    data: Observations, values: np.ndarray, count: int, rng: np.random.Generator, scale: float = 1.0
) -> list[Observations]:
    """Data sets with the geometries and uncertainties of others, true values of shape (C, G), and normal errors.

    Parameters
    ----------
    data
        Geometries, channels, standard uncertainties and correlations; where nothing was measured, nothing is simulated.
    values
        True values, shape (C, G).
    count
        Number of data sets.
    rng
        Source of the errors.
    scale
        Factor on the standard uncertainties of the errors; those that the data sets state stay the same.
    """
    measured = np.isfinite(data.std)
    std = scale * np.where(measured, data.std, 0.0)
    truth = np.where(measured, values, 0.0)

    def errors() -> np.ndarray:
        drawn = rng.standard_normal(std.shape)
        return std * (drawn if data.correlation is None else np.einsum("gij,jg->ig", data.factor, drawn))

    return [replace(data, values=truth + errors()) for _ in range(count)]
