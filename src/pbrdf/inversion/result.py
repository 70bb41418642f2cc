"""What a fit found."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.bootstrap import Bootstrap, bootstrap
from pbrdf.inversion.contour import Contour, contour
from pbrdf.inversion.erroranalysis import ErrorAnalysis, error_analysis
from pbrdf.inversion.estimates import DistinctOptimum
from pbrdf.inversion.holdout import HoldOut, Prediction
from pbrdf.inversion.identifiability import Identifiability, identifiability
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.plausibility import Finding, plausibility
from pbrdf.inversion.profile import Profile, profile
from pbrdf.inversion.strategy import Stage
from pbrdf.inversion.verdict import Verdict, verdict
from pbrdf.presentation import presenter_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["FitResult"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FitResult(Optimum):
    """What a fit found: the best optimum, and how it was found.

    ``print(result)`` shows what the command ``pbrdf fit`` prints; a notebook shows a table.

    Attributes
    ----------
    model, estimates, goodness, comparison, space, data, unknowns, information
        See :class:`~pbrdf.inversion.optimum.Optimum`.
    dataset
        The data set as it was given.
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

    dataset: xr.Dataset
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
    start_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    end_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    chi2_by_start: np.ndarray = field(default_factory=lambda: np.empty(0))
    seconds: float = math.nan

    def __repr__(self) -> str:
        first = self.space.wavelengths[:1]
        at = f" at {first[0]:g} nm, the first of {len(self.space.wavelengths)}" if first else ""
        return (
            f"<FitResult: {self.model!r}{at}, χ² {self.goodness.chi2:.4g} over {self.goodness.data} values>"
        )

    def __str__(self) -> str:
        return self.summary().rstrip()

    def _repr_html_(self) -> str:
        return str(presenter_of("fit").html(self))

    def summary(self, *, verbose: bool = False) -> str:
        """What ``pbrdf fit`` prints: parameters, goodness, errors, what to know about them.

        Parameters
        ----------
        verbose
            Also the full correlation matrix, and every check that had nothing to object.
        """
        return str(presenter_of("fit").summary(self, verbose=verbose))

    def plot(self) -> Figure:
        """The figure of ``pbrdf fit``: measured points with the model, and the differences.

        Returns
        -------
        matplotlib.figure.Figure
            Bound to no window; a notebook shows it, ``savefig`` writes it.
        """
        figure: Figure = presenter_of("fit").figure(self)
        return figure

    def save(self, folder: str | os.PathLike[str], *, figure_format: str = "png") -> list[Path]:
        """Write the folder of ``pbrdf fit``, which :func:`pbrdf.load_fit` brings back.

        Parameters
        ----------
        folder
            Made if it is missing; files of other names in it are left alone.
        figure_format
            ``"png"``, ``"pdf"`` or ``"svg"``.

        Returns
        -------
        list of Path
            The files, in the order of their importance to a reader.

        Raises
        ------
        DataError
            If the folder cannot be written.
        """
        written: list[Path] = presenter_of("fit").save(self, Path(folder), figure_format)
        return written

    def to_dataset(self) -> xr.Dataset:
        """Numbers as one data set: the comparison over ``geometry``, and over ``parameter`` what was estimated.

        Returns
        -------
        Dataset
            The variables of ``comparison``; ``value``, ``std``, ``lower``, ``upper`` (in the parameters' own units,
            angles in radians) and ``verdict`` over ``parameter``; ``correlation`` over ``parameter`` and ``other``, NaN
            where there is none. Model, options, χ² and noise are attributes.
        """
        names = list(self.estimates)
        made = self.comparison.copy()
        made = made.assign_coords(parameter=names, other=names)
        for column in ("value", "std", "lower", "upper"):
            made[column] = ("parameter", np.array([getattr(e, column) for e in self.estimates.values()]))
        made["verdict"] = ("parameter", [e.verdict for e in self.estimates.values()])
        made["unit"] = ("parameter", [e.parameter.unit for e in self.estimates.values()])
        made["correlation"] = self.correlation.reindex(parameter=names, other=names)
        made.attrs |= {
            "model": self.model.name,
            **{f"option_{name}": choice for name, choice in self.model.chosen.items()},
            "noise": self.noise,
            "chi2": self.goodness.chi2,
            "reduced_chi2": self.goodness.reduced_chi2,
        }
        return made

    # the analyses beyond the fit

    def profile(self, names: Sequence[str] | None = None, **options: Any) -> Profile:
        """Profile-likelihood intervals, see :func:`pbrdf.inversion.profile.profile`."""
        return profile(self, names, **options)

    def contour(self, a: str, b: str, **options: Any) -> Contour:
        """Joint region of two parameters, see :func:`pbrdf.inversion.contour.contour`."""
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

    def verdict(self) -> Verdict:
        """What the fit is worth, see :func:`pbrdf.inversion.verdict.verdict`."""
        return verdict(self)

    def error_analysis(self) -> ErrorAnalysis:
        """Residuals as in the paper's section 2.3, see :mod:`pbrdf.inversion.erroranalysis`."""
        return error_analysis(self)
