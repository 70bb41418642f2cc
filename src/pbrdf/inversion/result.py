"""What a fit found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.bootstrap import Bootstrap, bootstrap
from pbrdf.inversion.erroranalysis import ErrorAnalysis, error_analysis
from pbrdf.inversion.estimates import DistinctOptimum
from pbrdf.inversion.holdout import HoldOut, Prediction
from pbrdf.inversion.identifiability import Identifiability, identifiability
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.plausibility import Finding, plausibility
from pbrdf.inversion.profile import Contour, Profile, contour, profile
from pbrdf.inversion.strategy import Stage

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FitResult"]


@dataclass(frozen=True, kw_only=True)
class FitResult(Optimum):
    """What a fit found: the best optimum, and how it was found.

    Attributes
    ----------
    model, estimates, goodness, comparison, space, data, unknowns, information
        See :class:`~pbrdf.inversion.optimum.Optimum`.
    correlation
        Correlation matrix of the free parameters that are on no bound, labelled; xarray, shape (P, P).
    optima
        Distinct optima, best first.
    starts, converged
        Number of starts, and of those that ended at a minimum.
    fitted, predicted
        Errors over the fitted and the held-out data by region: ``"all"``, ``"near-specular"``,
        ``"off-specular"``. ``predicted`` is empty if nothing was held out.
    noise
        In words, where the standard uncertainties come from.
    hold_out
        What was held out, or None.
    notes
        Sentences about anything that a reader of the numbers must know.
    stages
        The steps of the fit, in order.
    start_values, end_values
        Where every start began and ended, free parameters in the model's order, shape (S, P).
    chi2_by_start
        χ² at the end of every start, shape (S,).
    seconds
        Time the solver took.
    """

    correlation: xr.DataArray
    optima: list[DistinctOptimum]
    starts: int
    converged: int
    fitted: dict[str, Prediction]
    predicted: dict[str, Prediction]
    noise: str
    hold_out: HoldOut | None
    notes: list[str] = field(default_factory=list)
    stages: list[Stage] = field(default_factory=list)
    start_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    end_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    chi2_by_start: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    seconds: float = math.nan

    def profile(self, names: Sequence[str] | None = None, **options: Any) -> Profile:
        """Profile-likelihood intervals, see :func:`pbrdf.inversion.profile.profile`."""
        return profile(self, names, **options)

    def contour(self, a: str, b: str, **options: Any) -> Contour:
        """Joint region of two parameters, see :func:`pbrdf.inversion.profile.contour`."""
        return contour(self, a, b, **options)

    def bootstrap(self, count: int = 200, **options: Any) -> Bootstrap:
        """Parametric bootstrap, see :func:`pbrdf.inversion.bootstrap.bootstrap`."""
        return bootstrap(self, count, **options)

    def identifiability(self) -> Identifiability:
        """What the data determine, see :func:`pbrdf.inversion.identifiability.identifiability`."""
        return identifiability(self)

    def plausibility(self, dataset: xr.Dataset | None = None) -> list[Finding]:
        """Physical plausibility, see :func:`pbrdf.inversion.plausibility.plausibility`."""
        return plausibility(self, dataset)

    def error_analysis(self) -> ErrorAnalysis:
        """Residuals as in the paper's section 2.3, see :mod:`pbrdf.inversion.erroranalysis`."""
        return error_analysis(self)
