"""A material: how its specimens are distributed.

The parameters of a model of a paint differ from panel to panel, by more than one measurement is uncertain. A material
is a normal distribution of the solver's unknowns (the logarithm of a logarithmic parameter, the square of an even one,
else the parameter) over specimens. Its covariance is the sample's, shrunk (:mod:`pbrdf.identification.shrinkage`), less
the mean covariance of the specimens' own fits, which scatter on their own account, and averaged with an assumed scatter
that counts as much as two differences between specimens. The mean of few specimens is uncertain itself: a new one
scatters about it with (1 + 1/S) times that covariance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pbrdf.errors import FitError
from pbrdf.identification.shrinkage import ledoit_wolf
from pbrdf.identification.specimen_fits import SpecimenFits
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.problem import Space
from pbrdf.inversion.statistics import covariance as inverse_of
from pbrdf.inversion.statistics import prior_spread
from pbrdf.models.base import Model
from pbrdf.models.parameters import Parameter

__all__ = ["Material", "assumed_scatter", "material_from_fits", "material_from_model"]

#: Scatter between specimens where it is only assumed: of a logarithm, and as a part of a parameter's default bounds.
ASSUMED_LOGARITHM, ASSUMED_PART = 0.1, 0.02
#: The assumed scatter counts as much as so many differences between specimens.
BELIEF = 2.0
#: Factor by which the amplitude of a specimen may differ from the mean.
_AMPLITUDES = 1e3


@dataclass(frozen=True)
class Material:
    """A normal distribution of the solver's unknowns over the specimens of a material; P free parameters.

    Attributes
    ----------
    name
        Of the material.
    space
        Its model, options, free parameters with the bounds that a specimen keeps, and fixed ones.
    mean, covariance
        Of the unknowns of a specimen that was not among those measured, shapes (P,) and (P, P).
    specimens
        How many specimens stand behind it; 0 where it is only stated.
    scatter
        ``"estimated"`` from the specimens, or ``"assumed"``.
    simulated
        Whether a model produced the specimens.
    wavelength
        In nm; NaN where it is not known.
    provenance
        Sentences: which fits or files it comes from.
    fits
        How well the model describes the specimens that were fitted.
    """

    name: str
    space: Space
    mean: np.ndarray
    covariance: np.ndarray
    specimens: int = 0
    scatter: str = "assumed"
    simulated: bool = False
    wavelength: float = math.nan
    provenance: tuple[str, ...] = field(default=())
    fits: SpecimenFits = field(default=SpecimenFits())

    def __post_init__(self) -> None:
        size = len(self.space.free)
        if self.mean.shape != (size,) or self.covariance.shape != (size, size):
            raise FitError(f"material {self.name}: mean and covariance must have {size} rows")
        if not np.allclose(self.covariance, self.covariance.T, rtol=1e-6, atol=0.0):
            raise FitError(f"material {self.name}: the covariance is not symmetric")
        if not (np.linalg.eigvalsh(self.covariance) > 0.0).all():
            raise FitError(f"material {self.name}: the covariance is not positive definite")

    @cached_property
    def root(self) -> np.ndarray:
        """Lower triangle L with LLᵀ the covariance."""
        return np.linalg.cholesky(self.covariance)

    @property
    def values(self) -> dict[str, float]:
        """Parameters of the mean specimen by name, the fixed ones too."""
        free = dict(zip(self.space.names, map(float, self.space.to_parameters(self.mean)), strict=True))
        return {**self.space.fixed, **free}

    @property
    def model(self) -> Model:
        """The model of the mean specimen."""
        return self.space.build(self.space.to_parameters(self.mean))

    @property
    def kernel(self) -> tuple[Any, ...]:
        """What materials share whose light one kernel computes."""
        s = self.space
        return s.model, tuple(sorted(s.options.items())), s.free, tuple(sorted(s.fixed.items()))

    @property
    def form(self) -> tuple[Any, ...]:
        """The same, and the bounds: what materials share that one solver's kernel follows."""
        return *self.kernel, (tuple(self.space.lower), tuple(self.space.upper))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Parameters of random specimens, shape (count, P), in the order of the free parameters."""
        unknowns = self.mean + rng.standard_normal((count, len(self.mean))) @ self.root.T
        return self.space.to_parameters(np.clip(unknowns, *self.space.box))


def assumed_scatter(parameters: Sequence[Parameter], stated: Mapping[str, float] | None = None) -> np.ndarray:
    """Standard deviations of the unknowns between specimens where nothing was measured of it, shape (P,).

    Parameters
    ----------
    parameters
        Of the model.
    stated
        By name: relative for logarithmic parameters, in the parameter's own unit for the others; even parameters'
        squares.

    Raises
    ------
    FitError
        If a name is none of the parameters, or a scatter is not a positive number.
    """
    stated = dict(stated or {})
    names = [p.name for p in parameters]
    for name, value in stated.items():
        if name not in names:
            raise FitError(f"scatter: there is no free parameter {name!r}; there are {', '.join(names)}")
        if not (math.isfinite(value) and value > 0.0):
            raise FitError(f"scatter: {name}={value:g} must be above 0")
    return np.array(
        [
            stated.get(p.name, ASSUMED_LOGARITHM if p.logarithmic else ASSUMED_PART * _range(p))
            for p in parameters
        ]
    )


def _range(p: Parameter) -> float:
    return (p.upper**2 - p.lower**2) if p.even else p.upper - p.lower


def material_from_model(
    name: str,
    model: Model,
    *,
    scatter: Mapping[str, float] | None = None,
    simulated: bool = False,
    wavelength: float = math.nan,
    provenance: Sequence[str] = (),
) -> Material:
    """A material of which only one set of parameters is known, with an assumed scatter between specimens.

    Parameters
    ----------
    name
        Of the material.
    model
        With single numbers as parameters; those that a fit holds by default are fixed.
    scatter
        See :func:`assumed_scatter`.
    simulated, wavelength, provenance
        See :class:`Material`.

    Raises
    ------
    FitError
        If the model holds arrays, or the scatter is none.
    """
    if any(np.ndim(value) for value in model.values.values()):
        raise FitError(f"material {name}: the model holds arrays; give one with single numbers")
    values = {key: float(value) for key, value in model.values.items()}
    free = tuple(p for p in model.parameters if p.fitted)
    fixed = {key: value for key, value in values.items() if key not in {p.name for p in free}}
    own = np.array([values[p.name] for p in free])
    space = _space(type(model), model.chosen, free, fixed, own)
    mean = space.to_unknowns(own)
    spread = assumed_scatter(free, scatter)
    return Material(
        name, space, mean, np.diag(spread**2), 0, "assumed", simulated, wavelength, tuple(provenance)
    )


def material_from_fits(
    name: str,
    fits: Sequence[Optimum],
    *,
    scatter: Mapping[str, float] | None = None,
    simulated: bool = False,
    wavelength: float = math.nan,
    provenance: Sequence[str] = (),
    labels: Sequence[str] | None = None,
) -> Material:
    """A material from fits of its specimens, one fit a specimen.

    Parameters
    ----------
    name
        Of the material.
    fits
        Of one model with the same options and the same free and fixed parameters.
    scatter
        Scatter assumed where there is one specimen only, and the unit in which scatters are compared where there are
        more, see :func:`assumed_scatter`.
    simulated, wavelength, provenance
        See :class:`Material`.
    labels
        What to call the fits in errors and cautions; None numbers them.

    Raises
    ------
    FitError
        If the fits differ in their model, have parameters for single groups or wavelengths, or did not converge.
    """
    if not fits:
        raise FitError(f"material {name}: give the fit of at least one specimen")
    first = fits[0].space
    called = [f"fit {number}" for number in range(1, len(fits) + 1)] if labels is None else labels
    kept = [i for i, term in enumerate(first.terms) if not term.nuisance]
    free = tuple(first.free[i] for i in kept)
    for label, fit in zip(called, fits, strict=True):
        space = fit.space
        if space.by_wavelength or any(term.split is not None and not term.nuisance for term in space.terms):
            raise FitError(f"material {name}: {label} has parameters of their own for groups or wavelengths")
        if not fit.settled:
            raise FitError(f"material {name}: {label} stands at no minimum: fit again with more starts")
        own = tuple(space.free[i] for i in range(len(space.free)) if not space.terms[i].nuisance)
        same = (space.model, dict(space.options), [p.name for p in own], dict(space.fixed)) == (
            first.model,
            dict(first.options),
            [p.name for p in free],
            dict(first.fixed),
        )
        if not same:
            raise FitError(
                f"material {name}: {label} is of another model, or has other free or fixed parameters than {called[0]}"
            )
    estimates, own_spread = [], []
    for fit in fits:
        places = [i for i, term in enumerate(fit.space.terms) if not term.nuisance]
        low, high = fit.space.box
        spread = prior_spread(low, high)
        cov = inverse_of(fit.information, spread)
        if not fit.std_known and math.isfinite(fit.goodness.reduced_chi2):
            cov = cov * fit.goodness.reduced_chi2
        cov = cov[np.ix_(places, places)]
        # what the data do not tell is known to the bounds all the same
        excess = np.sqrt(np.maximum(np.diag(cov) / spread[places] ** 2, 1.0))
        own_spread.append(cov / np.outer(excess, excess))
        estimates.append(fit.unknowns[places])
    mean, cov, source = pooled(np.array(estimates), np.array(own_spread), assumed_scatter(free, scatter))
    free_only = replace(first, free=free, lower=first.lower[kept], upper=first.upper[kept], terms=())
    space = _space(first.model, first.options, free, first.fixed, free_only.to_parameters(mean))
    return Material(
        name,
        space,
        mean,
        cov,
        len(fits),
        source,
        simulated,
        wavelength,
        tuple(provenance),
        SpecimenFits.of(fits, called),
    )


def pooled(
    estimates: np.ndarray, uncertainties: np.ndarray, unit: np.ndarray
) -> tuple[np.ndarray, np.ndarray, str]:
    """Mean and covariance of a new specimen from estimates of S measured ones.

    Parameters
    ----------
    estimates, uncertainties
        Unknowns of the specimens and their covariances, shapes (S, P) and (S, P, P).
    unit
        Assumed scatter, shape (P,).

    Returns
    -------
    mean, covariance, scatter
        Shapes (P,) and (P, P), and ``"estimated"`` or ``"assumed"``.
    """
    count = len(estimates)
    mean = estimates.mean(axis=0)
    own = (uncertainties / np.outer(unit, unit)).mean(axis=0)
    if count == 1:
        # the specimen is known but for its own uncertainty, a new one scatters about it
        scaled, source = np.eye(len(unit)) + own, "assumed"
    else:
        shrunk, _ = ledoit_wolf(estimates / unit)
        found = shrunk * (count / (count - 1.0)) - own
        eigenvalues, vectors = np.linalg.eigh(0.5 * (found + found.T))
        found = (vectors * np.maximum(eigenvalues, 0.0)) @ vectors.T
        # a few specimens that happen to agree do not show that all do
        scatter = ((count - 1.0) * found + BELIEF * np.eye(len(unit))) / (count - 1.0 + BELIEF)
        scaled, source = scatter + (scatter + own) / count, "estimated"
    return mean, scaled * np.outer(unit, unit), source


def _space(
    model: type[Model],
    options: Mapping[str, str],
    free: tuple[Parameter, ...],
    fixed: Mapping[str, float],
    values: np.ndarray,
) -> Space:
    """The bounds of a fit hold specimens too, widened to hold the mean; an amplitude is on the data's own scale."""
    lower, upper = [], []
    for p, value in zip(free, values, strict=True):
        low, high = model.fit_bounds(p, options)
        if p.amplitude:
            low, high = value / _AMPLITUDES, value * _AMPLITUDES
        lower.append(max(min(low, value), p.domain[0]))
        upper.append(min(max(high, value), p.domain[1]))
    return Space(model, dict(options), free, dict(fixed), np.array(lower), np.array(upper))
