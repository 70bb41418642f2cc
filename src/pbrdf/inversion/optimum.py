"""The best fit of a model to data: what the analyses beyond the fit start from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.estimates import Estimate
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space
from pbrdf.inversion.statistics import Goodness
from pbrdf.models.base import Model

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Optimum"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """A model at the best fit to its data, with the curvature of χ² there.

    Profiles, bootstrap, identifiability, error analysis and plausibility need no more than this;
    :class:`~pbrdf.inversion.result.FitResult` is one that also tells how it was found.

    Attributes
    ----------
    model
        The model at the best optimum; where parameters differ between wavelengths or groups that of the first.
    estimates
        Every parameter by name.
    goodness
        χ², R², AIC, BIC over the fitted data.
    comparison
        Measured, modelled and residual values with their angles, on the scale of a BRDF; ``held_out`` and
        ``near_specular`` mark geometries.
    space, data
        The free parameters and the fitted observations.
    unknowns, information
        The solver's unknowns at the optimum, shape (P,), and JᵀJ there, shape (P, P).
    settled
        Whether the fit has converged: it stands at a minimum of χ².
    """

    model: Model
    estimates: dict[str, Estimate]
    goodness: Goodness
    comparison: xr.Dataset
    space: Space = field(repr=False)
    data: Observations = field(repr=False)
    unknowns: np.ndarray = field(repr=False)
    information: np.ndarray = field(repr=False)
    settled: bool = True

    @property
    def models(self) -> dict[float, Model]:
        """The model of each wavelength in nm where parameters are free or held for each; empty where all share one."""
        values = [self.estimates[name].value for name in self.space.names]
        return {float(label): self.space.build(values, label) for label in self.space.wavelengths}

    @property
    def std_known(self) -> bool:
        """Whether the uncertainties came from the data set; if not, standard errors carry the residual scale."""
        return self.data.std_known
