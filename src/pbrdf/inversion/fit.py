"""Fit a model to a data set."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import COVARIANCE, with_group
from pbrdf.data.validation import validate
from pbrdf.errors import FitError
from pbrdf.inversion.comparison import compare, near_specular_tilt
from pbrdf.inversion.estimates import distinct_optima, estimates_at
from pbrdf.inversion.held_values import Held
from pbrdf.inversion.holdout import HoldOut, Prediction, prediction_errors
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.notes import notes_on
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.observations import Observations, noise_in_words
from pbrdf.inversion.problem import Space
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.solver import Solution
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.statistics import goodness
from pbrdf.inversion.strategy import STRATEGIES, joint, stepwise
from pbrdf.inversion.unknowns import apply_starts, check_choices, space_of, with_terms
from pbrdf.models import DoubleGauss, Model

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit"]

#: Geometries among which are looked for as many different ones as there are parameters, before all are.
_FEW = 1000


def fit(
    dataset: xr.Dataset,
    model: type[Model] | Model | str = DoubleGauss,
    *,
    options: Mapping[str, str] | None = None,
    fix: Mapping[str, Held] | None = None,
    free: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    split: Mapping[str, str] | None = None,
    nuisances: Sequence[Nuisance | str] = (),
    strategy: str = "joint",
    polish: bool = True,
    diffuse_tilt: float | None = None,
    loss: str = "linear",
    starts: int = 64,
    noise: Noise | str | None = None,
    objective: str = "stokes",
    covariance: ArrayLike | None = None,
    hold_out: HoldOut | str | None = None,
    seed: int = 0,
    max_iterations: int = 100,
    progress: Callable[[int, int], None] | None = None,
) -> FitResult:
    """Fit a model by bounded, weighted least squares on what was measured, from many starts.

    Signed Stokes components are compared (I, Q, U, V, or Mueller elements, or I and DoLP where only that was
    measured), each weighted by its standard uncertainty.

    Parameters
    ----------
    dataset
        Data set of the project's schema; values that are not a BRDF are converted to its scale.
    model
        Class or name of the model, or a model whose options are used and whose parameters are one of the
        starts.
    options
        Options of the model by name, for example ``{"shadowing": "smith"}``.
    fix
        Parameters held at a value; or at a value of each wavelength in nm, ``{"n": {450: 1.52, 550: 1.51}}``. An index
        can be that of a material, ``{"n": "main/SiO2/Malitson"}``: n and k of a page of refractiveindex.info at the
        wavelengths of the data.
    free
        Parameters to fit that are held by default (``"kappa"``).
    bounds
        (lower, upper) of parameters, instead of the model's defaults.
    start
        Starting values: every start begins there in these parameters.
    priors
        Gaussian priors, (mean, standard deviation), on parameters of the model.
    split
        Parameters that are free for each ``"group"`` or each ``"wavelength"`` apart, for example
        ``{"a": "wavelength"}``; all others are shared.
    nuisances
        What the instrument adds, :class:`~pbrdf.inversion.nuisance.Nuisance` or text like ``"gain:group"``.
    strategy
        ``"joint"``, or ``"stepwise"``: the paper's, see :mod:`pbrdf.inversion.strategy`.
    polish
        Whether ``"stepwise"`` ends with a joint fit of all parameters.
    diffuse_tilt
        For ``"stepwise"``: facet tilt in radians beyond which a geometry counts as diffuse; None takes 4.5 σ.
    loss
        ``"linear"`` (least squares), ``"soft_l1"``, ``"huber"`` or ``"cauchy"`` against outliers.
    starts
        Number of starts, spread over the bounds by a Sobol sequence.
    noise
        Stated noise, an object of :mod:`pbrdf.inversion.noise` or its text like ``"0.02,0.01"``, ``"equal"`` or
        ``"instrument:linear=1%,quantum=1"``, which replaces uncertainties and covariances of the data set; None takes
        these and, where it has none, the default of :class:`NoiseModel`.
    covariance
        Full covariance of the measured Stokes components at each geometry, shape (G, C, C) in the order I, Q, U,
        V, on the data's own scale; it replaces all other statements of noise.
    objective
        ``"stokes"``: signed Stokes components (or whatever was measured); ``"paper"``: intensity and DoLP with
        equal weights, as the paper does.
    hold_out
        Data left out and then predicted, for example ``"group=3"``; see :class:`HoldOut`.
    seed
        Seed of the starts and of a held-out fraction.
    max_iterations
        Steps per start at most.
    progress
        Called with the number of finished starts and of all.

    Returns
    -------
    FitResult

    Raises
    ------
    FitError, DataError, ModelError
        If the options or the data do not allow a fit; the message says why.
    """
    validate(dataset)
    dataset = with_group(dataset)
    if isinstance(noise, str):
        noise = parse_noise(noise)
    if isinstance(hold_out, str):
        hold_out = HoldOut.parse(hold_out)
    if strategy not in STRATEGIES:
        raise FitError(f"strategy={strategy!r}: choose one of {', '.join(STRATEGIES)}")
    check_choices(starts, loss, objective)
    if covariance is None:
        observations = Observations.from_dataset(dataset, noise, objective)
    else:
        stated = [COVARIANCE, *(name for name in map(str, dataset.data_vars) if name.endswith("_std"))]
        bare = Observations.from_dataset(dataset.drop_vars(stated, errors="ignore"), None, objective)
        observations = bare.with_covariance(np.asarray(covariance))
    held = hold_out.mask(dataset, seed) if hold_out else np.zeros(observations.values.shape[1], dtype=bool)
    fitted_data = observations.subset(~held) if held.any() else observations
    space, begin = space_of(
        model, options or {}, fix or {}, free, bounds or {}, start or {}, fitted_data, observations.wavelength
    )
    space = with_terms(space, fitted_data, priors or {}, split or {}, nuisances, bounds or {}, loss)
    if fitted_data.count <= len(space.free):
        raise FitError(
            f"{fitted_data.count} measured values cannot determine {len(space.free)} parameters: measure "
            "more, hold out less, or fix parameters"
        )
    split_by = space.labels("group") != [], space.wavelengths != []
    # mostly the first few show that there are enough
    places, distinct = fitted_data.subset(slice(_FEW)).distinct(*split_by)
    if distinct < len(space.free):
        places, distinct = fitted_data.distinct(*split_by)
    if distinct < len(space.free):
        raise FitError(
            f"{fitted_data.count} values at {places} {'geometry' if places == 1 else 'different geometries'} cannot "
            f"determine {len(space.free)} parameters, as repeated readings tell no more of them than "
            f"{'one does' if places == 1 else 'one at each does'}: measure in more directions, or fix parameters"
        )
    low, high = space.box
    first = sobol_starts(low, high, starts, seed)
    first = first[np.argsort(first[:, 0])]  # neighbours alike: they then take the same branches
    apply_starts(first, space, begin, start or {})
    clock = time.perf_counter()
    diffuse = None
    if strategy == "joint":
        solution, stages = joint(space, fitted_data, first, max_iterations, progress)
    else:
        solution, stages, used = stepwise(
            space, fitted_data, first, max_iterations, progress, polish=polish, diffuse_tilt=diffuse_tilt
        )
        diffuse = np.zeros(len(held), dtype=bool)
        diffuse[np.flatnonzero(~held)[used]] = True
    seconds = time.perf_counter() - clock
    if not np.isfinite(solution.cost).any():
        raise FitError("no start gave finite residuals: check the data's values and the bounds")
    words = noise_in_words(noise, fitted_data)
    if covariance is not None:
        words = "stated: the covariance of the components"
    result = _summarise(
        dataset, observations, fitted_data, held, space, solution, first, words, hold_out, seconds
    )
    result.stages.extend(stages)
    for searched in (stage for stage in stages if stage.name == "search"):
        result.notes.append(
            f"The starts searched {searched.points} of the {stages[-1].points} geometries, drawn evenly over the "
            "directions; what they found best was refined on all, and its χ² and errors are those of all."
        )
    if diffuse is not None:
        result.comparison["used_for_diffuse"] = ("geometry", diffuse)
    return result


def _summarise(
    dataset: xr.Dataset,
    observations: Observations,
    fitted_data: Observations,
    held: np.ndarray,
    space: Space,
    solution: Solution,
    first: np.ndarray,
    noise: str,
    hold_out: HoldOut | None,
    seconds: float,
) -> FitResult:
    import xarray as xr

    best = solution.best(*space.box)
    values = space.to_parameters(solution.u[best])
    values = np.clip(values, space.lower, space.upper)
    model = space.build(values)
    comparison = compare(space, space.to_unknowns(values), observations, dataset)
    comparison["held_out"] = ("geometry", held)
    near = comparison["facet_tilt"].values < near_specular_tilt(model)
    comparison["near_specular"] = ("geometry", near)

    chi2 = 2.0 * float(solution.cost[best])
    modelled = [comparison[f"{c}_modelled"].values for c in fitted_data.channels]
    if held.any():
        modelled = [values[~held] for values in modelled]
    quality = goodness(
        chi2,
        fitted_data.values,
        modelled,
        fitted_data.std,
        fitted_data.channels,
        len(space.free),
        fitted_data.std_known,
    )
    estimates, correlation = estimates_at(space, values, solution, best, fitted_data, quality)
    optima = distinct_optima(space, solution, best)
    regions = {"all": np.ones_like(held), "near-specular": near, "off-specular": ~near}

    def by_region(chosen: np.ndarray) -> dict[str, Prediction]:
        return {
            n: prediction_errors(comparison, chosen & m) for n, m in regions.items() if (chosen & m).any()
        }

    names = xr.DataArray(
        np.asarray(correlation[1]),
        dims=("parameter", "other"),
        coords={"parameter": correlation[0], "other": correlation[0]},
        name="correlation",
    )
    result = FitResult(
        dataset=dataset,
        model=model,
        estimates=estimates,
        correlation=names,
        goodness=quality,
        optima=optima,
        starts=len(solution.u),
        converged=int(solution.converged.sum()),
        comparison=comparison,
        fitted=by_region(~held),
        predicted=by_region(held) if held.any() else {},
        noise=noise,
        hold_out=hold_out,
        space=space,
        data=fitted_data,
        unknowns=solution.u[best],
        information=solution.information[best],
        settled=bool(solution.converged[best]),
        start_values=space.to_parameters(first),
        end_values=space.to_parameters(solution.u),
        chi2_by_start=2.0 * solution.cost,
        seconds=seconds,
    )
    result.notes.extend(notes_on(result, dataset, fitted_data, solution, best))
    return result
