"""Fit a model to a data set."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import COVARIANCE
from pbrdf.data.validation import validate
from pbrdf.errors import FitError
from pbrdf.inversion.clusters import cluster
from pbrdf.inversion.holdout import HoldOut, Prediction, prediction_errors
from pbrdf.inversion.noise import Noise, NoiseModel, parse_noise
from pbrdf.inversion.nuisance import KINDS, Nuisance, check_prior
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, Term, predict
from pbrdf.inversion.solver import LOSSES, Solution, Status
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.statistics import Goodness, covariance, goodness, prior_spread
from pbrdf.inversion.strategy import STRATEGIES, Stage, facet_tilt, joint, stepwise
from pbrdf.models import MODELS, DoubleGauss, Model
from pbrdf.models.parameters import Parameter

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.bootstrap import Bootstrap
    from pbrdf.inversion.erroranalysis import ErrorAnalysis
    from pbrdf.inversion.identifiability import Identifiability
    from pbrdf.inversion.plausibility import Finding
    from pbrdf.inversion.profile import Contour, Profile

__all__ = ["Estimate", "FitResult", "Optimum", "fit"]

OBJECTIVES = ("stokes", "paper")
#: A facet tilted by less than this many σ, but at most by this angle, counts as near-specular.
NEAR_SPECULAR, NEAR_SPECULAR_LIMIT = 4.0, math.radians(15.0)


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
        Bounds that the fit kept.
    verdict
        ``"determined"``, ``"undetermined"`` (the data tell no more than the bounds), ``"at lower bound"``,
        ``"at upper bound"`` or ``"fixed"``.
    """

    parameter: Parameter
    value: float
    std: float
    lower: float
    upper: float
    verdict: str


@dataclass(frozen=True)
class Optimum:
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


@dataclass(frozen=True)
class FitResult:
    """What a fit found.

    Attributes
    ----------
    model
        The model at the best optimum.
    estimates
        Every parameter by name.
    correlation
        Correlation matrix of the free parameters that are on no bound, labelled; xarray, shape (P, P).
    goodness
        χ², R², AIC, BIC over the fitted data.
    optima
        Distinct optima, best first.
    starts, converged
        Number of starts, and of those that ended at a minimum.
    comparison
        Measured, modelled and residual values with their angles, on the scale of a BRDF; ``held_out`` and
        ``near_specular`` mark geometries.
    fitted, predicted
        Errors over the fitted and the held-out data by region: ``"all"``, ``"near-specular"``,
        ``"off-specular"``. ``predicted`` is empty if nothing was held out.
    noise
        In words, where the standard uncertainties come from.
    std_known
        Whether the uncertainties came from the data set; if not, standard errors carry the residual scale.
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
    space, data
        The free parameters and the fitted observations, for further analysis (profiles, bootstrap).
    unknowns, information
        The solver's unknowns at the best optimum, shape (P,), and JᵀJ there, shape (P, P).
    """

    model: Model
    estimates: dict[str, Estimate]
    correlation: xr.DataArray
    goodness: Goodness
    optima: list[Optimum]
    starts: int
    converged: int
    comparison: xr.Dataset
    fitted: dict[str, Prediction]
    predicted: dict[str, Prediction]
    noise: str
    std_known: bool
    hold_out: HoldOut | None
    space: Space = field(repr=False)
    data: Observations = field(repr=False)
    unknowns: np.ndarray = field(repr=False)
    information: np.ndarray = field(repr=False)
    notes: list[str] = field(default_factory=list)
    stages: list[Stage] = field(default_factory=list)
    start_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    end_values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    chi2_by_start: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    seconds: float = math.nan

    # the further analyses live in modules of their own, which import this one
    def profile(self, names: Sequence[str] | None = None, **options: Any) -> Profile:
        """Profile-likelihood intervals, see :func:`pbrdf.inversion.profile.profile`."""
        from pbrdf.inversion.profile import profile

        return profile(self, names, **options)

    def contour(self, a: str, b: str, **options: Any) -> Contour:
        """Joint region of two parameters, see :func:`pbrdf.inversion.profile.contour`."""
        from pbrdf.inversion.profile import contour

        return contour(self, a, b, **options)

    def bootstrap(self, count: int = 200, **options: Any) -> Bootstrap:
        """Parametric bootstrap, see :func:`pbrdf.inversion.bootstrap.bootstrap`."""
        from pbrdf.inversion.bootstrap import bootstrap

        return bootstrap(self, count, **options)

    def identifiability(self) -> Identifiability:
        """What the data determine, see :func:`pbrdf.inversion.identifiability.identifiability`."""
        from pbrdf.inversion.identifiability import identifiability

        return identifiability(self)

    def plausibility(self, dataset: xr.Dataset | None = None) -> list[Finding]:
        """Physical plausibility, see :func:`pbrdf.inversion.plausibility.plausibility`."""
        from pbrdf.inversion.plausibility import plausibility

        return plausibility(self, dataset)

    def error_analysis(self) -> ErrorAnalysis:
        """Residuals as in the paper's section 2.3, see :mod:`pbrdf.inversion.erroranalysis`."""
        from pbrdf.inversion.erroranalysis import error_analysis

        return error_analysis(self)


def fit(
    dataset: xr.Dataset,
    model: type[Model] | Model | str = DoubleGauss,
    *,
    options: Mapping[str, str] | None = None,
    fix: Mapping[str, float] | None = None,
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
        Parameters held at a value.
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
    if isinstance(noise, str):
        noise = parse_noise(noise)
    if isinstance(hold_out, str):
        hold_out = HoldOut.parse(hold_out)
    if starts < 1:
        raise FitError(f"starts={starts}: at least one start is needed")
    if strategy not in STRATEGIES:
        raise FitError(f"strategy={strategy!r}: choose one of {', '.join(STRATEGIES)}")
    if loss not in LOSSES:
        raise FitError(f"loss={loss!r}: choose one of {', '.join(LOSSES)}")
    if objective not in OBJECTIVES:
        raise FitError(f"objective={objective!r}: choose one of {', '.join(OBJECTIVES)}")
    if covariance is None:
        observations = Observations.from_dataset(dataset, noise, objective)
    else:
        bare = Observations.from_dataset(dataset.drop_vars(COVARIANCE, errors="ignore"), None, objective)
        observations = bare.with_covariance(np.asarray(covariance))
    held = hold_out.mask(dataset, seed) if hold_out else np.zeros(observations.values.shape[1], dtype=bool)
    fitted_data = observations.subset(~held)
    space, begin = _space(model, options or {}, fix or {}, free, bounds or {}, start or {}, fitted_data)
    space = _with_terms(space, fitted_data, priors or {}, split or {}, nuisances, bounds or {}, loss)
    if fitted_data.count <= len(space.free):
        raise FitError(
            f"{fitted_data.count} measured values cannot determine {len(space.free)} parameters: measure "
            "more, hold out less, or fix parameters"
        )
    low, high = space.box
    first = sobol_starts(low, high, starts, seed)
    first = first[np.argsort(first[:, 0])]  # neighbours alike: they then take the same branches
    _apply_starts(first, space, begin, start or {})
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
    words = _noise_in_words(noise, fitted_data)
    if covariance is not None:
        words = "stated: the covariance of the components"
    result = _summarise(
        dataset, observations, fitted_data, held, space, solution, first, words, hold_out, seconds
    )
    result.stages.extend(stages)
    if diffuse is not None:
        result.comparison["used_for_diffuse"] = ("geometry", diffuse)
    return result


def _space(
    model: type[Model] | Model | str,
    options: Mapping[str, str],
    fix: Mapping[str, float],
    free: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
    start: Mapping[str, float],
    data: Observations,
) -> tuple[Space, dict[str, float]]:
    """Free and fixed parameters with their bounds, and the starting values of a given model."""
    begin: dict[str, float] = {}
    chosen = dict(options)
    if isinstance(model, Model):
        if any(np.ndim(v) for v in model.values.values()):
            raise FitError("the model to start from holds arrays: give one with single numbers")
        begin = {name: float(v) for name, v in model.values.items()}
        chosen = {**model.chosen, **chosen}
        cls = type(model)
    elif isinstance(model, str):
        if model not in MODELS:
            raise FitError(f"unknown model {model!r}: known are {', '.join(MODELS)}")
        cls = MODELS[model]
    else:
        cls = model
    for option in chosen:
        if option not in cls.options:
            raise FitError(f"{cls.name} has no option {option!r}: known are {', '.join(cls.options)}")
    names = [p.name for p in cls.parameters]
    for what, given in (("fix", fix), ("free", free), ("bounds", bounds), ("start", start)):
        for name in given:
            if name not in names:
                raise FitError(f"{what}: {cls.name} has no parameter {name!r}; it has {', '.join(names)}")
            if what != "fix" and name in fix:
                raise FitError(f"{what}: the parameter {name} is fixed at {fix[name]:g}")
    free_parameters, fixed, lower, upper = [], {}, [], []
    for p in cls.parameters:
        if p.name in fix:
            fixed[p.name] = float(fix[p.name])
            continue
        if not (p.fitted or p.name in free or p.name in bounds):
            fixed[p.name] = begin.get(p.name, p.default)
            continue
        low, high = _bounds(p, bounds.get(p.name), data, chosen)
        value = start.get(p.name)
        if value is not None and not low <= value <= high:
            raise FitError(f"start: {p.name}={value:g} lies outside its bounds {low:g} … {high:g}")
        free_parameters.append(p)
        lower.append(low)
        upper.append(high)
    if not free_parameters:
        raise FitError("every parameter is fixed: nothing is left to fit")
    space = Space(cls, chosen, tuple(free_parameters), fixed, np.array(lower), np.array(upper))
    space.build(space.lower)  # raises ModelError for a fixed value or a bound outside the model's domain
    space.build(space.upper)
    return space, begin


def _bounds(
    p: Parameter, given: tuple[float, float] | None, data: Observations, options: Mapping[str, str]
) -> tuple[float, float]:
    if given is not None:
        low, high = (float(v) for v in given)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise FitError(
                f"bounds: {p.name} needs two finite numbers, the lower first; got {low:g} … {high:g}"
            )
        if p.logarithmic and low <= 0.0:
            raise FitError(f"bounds: {p.name} must be above 0, got {low:g}")
        return low, high
    if p.name == "a":
        # the amplitude is on the data's own scale: π times a typical value is its order of magnitude
        intensity = np.concatenate(
            [data.values[c] for c, n in enumerate(data.channels) if n in ("I", "m00")] or [np.ones(1)]
        )
        positive = intensity[intensity > 0.0]
        scale = math.pi * float(np.median(positive)) if positive.size else 1.0
        return 1e-3 * scale, 1e3 * scale
    if p.name == "k" and options.get("normalization") == "visible":
        return max(p.lower, 0.35), p.upper
    return p.lower, p.upper


def _with_terms(
    space: Space,
    data: Observations,
    priors: Mapping[str, tuple[float, float]],
    split: Mapping[str, str],
    nuisances: Sequence[Nuisance | str],
    bounds: Mapping[str, tuple[float, float]],
    loss: str,
) -> Space:
    """Add priors, parameters free for each group or wavelength, and nuisance terms."""
    for what, given in (("prior", priors), ("split", split)):
        for name in given:
            if name not in space.names:
                raise FitError(f"{what}: {name!r} is not a free parameter; free are {', '.join(space.names)}")
    free: list[Parameter] = []
    terms: list[Term] = []
    lower: list[float] = []
    upper: list[float] = []

    given_terms = [Nuisance.parse(n) if isinstance(n, str) else n for n in nuisances]
    with_gain = any(n.kind == "gain" for n in given_terms)
    intensity = [data.values[c] for c, n in enumerate(data.channels) if n in ("I", "m00")]
    positive = np.concatenate(intensity or [np.ones(1)])
    typical = float(np.median(positive[positive > 0.0])) if (positive > 0.0).any() else 1.0

    def add(p: Parameter, low: float, high: float, term: Term) -> None:
        name = p.name if term.split is None else f"{p.name}[{_label_text(term.label)}]"
        free.append(replace(p, name=name))
        terms.append(term)
        lower.append(low)
        upper.append(high)

    for p, low, high in zip(space.free, space.lower, space.upper, strict=True):
        prior = priors.get(p.name)
        check_prior(f"prior of {p.name}", prior)
        if p.name == "a" and with_gain and "a" not in bounds:
            low, high = 1e-3, 10.0  # the gain takes the scale of the data
        for label in _labels(data, split.get(p.name), p.name):
            add(p, low, high, Term(p.name, split.get(p.name), label, prior))
    for nuisance in given_terms:
        p = KINDS[nuisance.kind]
        low, high = p.lower, p.upper
        if nuisance.kind == "dark":
            raw = typical / (float(np.median(data.scale)) if data.scale is not None else 1.0)
            low, high = -raw, raw
        elif nuisance.kind == "gain":
            low, high = 0.01 * math.pi * typical, 100.0 * math.pi * typical
        if any(t.role == nuisance.kind for t in terms):
            raise FitError(f"nuisance {nuisance.kind} is given twice")
        by = "group" if nuisance.per_group else None
        for label in _labels(data, by, nuisance.kind):
            add(p, low, high, Term(nuisance.kind, by, label, nuisance.prior))
    return replace(
        space, free=tuple(free), terms=tuple(terms), lower=np.array(lower), upper=np.array(upper), loss=loss
    )


def _labels(data: Observations, split: str | None, name: str) -> list[Any]:
    if split is None:
        return [None]
    if split not in ("group", "wavelength"):
        raise FitError(f"split: {name} can be free for each 'group' or 'wavelength', not for each {split!r}")
    column = getattr(data, split)
    labels = [] if column is None else list(np.unique(column))
    if len(labels) < 2:
        raise FitError(f"split: {name} is to be free for each {split}, but the fitted data have only one")
    return labels


def _label_text(label: Any) -> str:
    return f"{label:g}" if isinstance(label, int | float | np.number) else str(label)


def _apply_starts(
    first: np.ndarray, space: Space, begin: Mapping[str, float], start: Mapping[str, float]
) -> None:
    """Put starting values of the user and of the nuisance terms into the drawn ones, in place."""
    values = space.to_parameters(first)
    for i, term in enumerate(space.terms):
        role = term.role
        if role in begin:
            values[0, i] = min(max(begin[role], space.lower[i]), space.upper[i])
        if role in start:
            values[:, i] = start[role]
        elif role in KINDS and role != "gain":
            # not 0 for the source: its effect is even in the radius, the derivative would vanish
            default = 0.2 * space.upper[i] if role == "source" else KINDS[role].default
            values[:, i] = term.prior[0] if term.prior else default
    first[:] = space.to_unknowns(values)


def near_specular_tilt(model: Model) -> float:
    """Facet tilt in radians below which a geometry counts as near-specular."""
    return min(math.atan(NEAR_SPECULAR * float(model.values["sigma"])), NEAR_SPECULAR_LIMIT)


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

    best = int(np.nanargmin(np.where(np.isfinite(solution.cost), solution.cost, np.nan)))
    values = space.to_parameters(solution.u[best])
    values = np.clip(values, space.lower, space.upper)
    model = space.build(values)
    comparison = compare(space, space.to_unknowns(values), observations, dataset)
    comparison["held_out"] = ("geometry", held)
    near = comparison["facet_tilt"].values < near_specular_tilt(model)
    comparison["near_specular"] = ("geometry", near)

    chi2 = 2.0 * float(solution.cost[best])
    modelled = np.stack([comparison[f"{c}_modelled"].values[~held] for c in fitted_data.channels])
    quality = goodness(
        chi2,
        fitted_data.values,
        modelled,
        fitted_data.std,
        fitted_data.channels,
        len(space.free),
        fitted_data.std_known,
    )
    estimates, correlation = _estimates(space, values, solution, best, fitted_data, quality)
    optima = _distinct_optima(space, solution)
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
        std_known=fitted_data.std_known,
        hold_out=hold_out,
        space=space,
        data=fitted_data,
        unknowns=solution.u[best],
        information=solution.information[best],
        start_values=space.to_parameters(first),
        end_values=space.to_parameters(solution.u),
        chi2_by_start=2.0 * solution.cost,
        seconds=seconds,
    )
    result.notes.extend(_notes(result, dataset, fitted_data, solution, best))
    return result


def compare(
    space: Space, unknowns: np.ndarray, observations: Observations, dataset: xr.Dataset
) -> xr.Dataset:
    """Measured, modelled and residual values (model − measured) of every channel on the scale of a BRDF.

    Parameters
    ----------
    space, unknowns
        The model with its nuisance terms and split parameters; ``unknowns`` has the shape (P,).
    observations, dataset
        The same data in both forms.

    Returns
    -------
    Dataset
        ``<channel>_measured``, ``_modelled``, ``_residual`` and ``_std`` over ``geometry``; intensity and DoLP are
        always among the modelled ones, and DoLP among the measured ones where it can be computed. ``facet_tilt`` is
        the tilt in radians of the facet that mirrors source into viewer.
    """
    import xarray as xr

    elements = observations.channels[0].startswith("m")
    wanted = tuple(dict.fromkeys((*observations.channels, *(("m00", "m10", "m20") if elements else "IQU"))))
    everything = predict(space, unknowns, observations, wanted)
    if elements:
        everything |= {"I": everything["m00"], "Q": everything["m10"], "U": everything["m20"]}
    with np.errstate(divide="ignore", invalid="ignore"):
        everything["dolp"] = np.hypot(everything["Q"], everything["U"]) / everything["I"]
    present = np.isfinite(observations.std)
    measured = {
        name: np.where(present[c], observations.values[c], np.nan)
        for c, name in enumerate(observations.channels)
    }
    std = dict(zip(observations.channels, observations.std, strict=True))
    if "m00" in measured:
        measured["I"], std["I"] = measured["m00"], std["m00"]
    if "dolp" not in measured:
        intensity, q, u = (
            measured.get(a, measured.get(b)) for a, b in (("I", "m00"), ("Q", "m10"), ("U", "m20"))
        )
        if intensity is not None and q is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                measured["dolp"] = np.hypot(q, 0.0 if u is None else u) / intensity
    result = xr.Dataset(
        coords={name: dataset[name] for name in dataset.coords if name not in ("stokes_out", "stokes_in")}
    )
    for name in dict.fromkeys((*observations.channels, "I", "dolp")):
        unit = "1" if name == "dolp" else "1/sr"
        columns = {"modelled": everything[name]}
        if name in measured:
            columns |= {"measured": measured[name], "residual": everything[name] - measured[name]}
        if name in std:
            columns["std"] = np.where(np.isfinite(std[name]), std[name], np.nan)
        for kind, column in columns.items():
            result[f"{name}_{kind}"] = ("geometry", column, {"units": unit})
    tilt = facet_tilt(observations.theta_i, observations.theta_r, observations.phi)
    result["facet_tilt"] = ("geometry", tilt, {"units": "rad"})
    # what the data were before they were brought to the scale of a BRDF
    result.attrs.update(
        {name: dataset.attrs[name] for name in ("quantity", "scale") if name in dataset.attrs}
    )
    return result


def _estimates(
    space: Space,
    values: np.ndarray,
    solution: Solution,
    best: int,
    data: Observations,
    quality: Goodness,
) -> tuple[dict[str, Estimate], tuple[list[str], np.ndarray]]:
    low, high = space.box
    u = solution.u[best]
    at_low = u <= low + 1e-9 * (high - low)
    at_high = u >= high - 1e-9 * (high - low)
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
    for i, p in enumerate(space.free):
        std = float(error[i] * slope[i])
        if at_low[i]:
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


def _distinct_optima(space: Space, solution: Solution) -> list[Optimum]:
    low, high = space.box
    cost = np.where(solution.converged, solution.cost, np.inf)
    return [
        Optimum(
            dict(zip(space.names, map(float, space.to_parameters(solution.u[members[0]])), strict=True)),
            2.0 * float(cost[members[0]]),
            len(members),
        )
        for members in cluster(solution.u, cost, high - low, 1e-4, 1e-6)
    ]


def _noise_in_words(noise: Noise | None, data: Observations) -> str:
    if noise is not None:
        return f"stated: {noise}"
    if data.std_known:
        kind = "standard uncertainties" if data.correlation is None else "covariances"
        return f"{kind} of the data set"
    return f"assumed, as the data set states no (or not every) uncertainty: {NoiseModel()}"


def _notes(
    result: FitResult, dataset: xr.Dataset, data: Observations, solution: Solution, best: int
) -> list[str]:
    notes = []
    if "wavelength" in dataset.coords:
        wavelengths = np.unique(dataset["wavelength"].values)
        by_wavelength = any(term.split == "wavelength" for term in result.space.terms)
        if np.isfinite(wavelengths).sum() > 1 and not by_wavelength:
            notes.append(
                f"One set of parameters was fitted to {len(wavelengths)} wavelengths at once; select one, or let a be "
                "free for each, if the colour of the coating matters."
            )
    if not solution.converged[best]:
        notes.append(
            f"The best start did not converge ({Status(solution.status[best]).name.lower()}); raise the number "
            "of iterations or of starts."
        )
    undetermined = [n for n, e in result.estimates.items() if e.verdict == "undetermined"]
    if undetermined:
        notes.append(
            f"These data do not determine {', '.join(undetermined)}: the value shown is one of many that fit as "
            "well; measure what it depends on, or fix it."
        )
    if not data.polarised:
        notes.append("No polarisation was measured: n, t and the model's DoLP rest on the intensity alone.")
    for name, e in result.estimates.items():
        if e.verdict.startswith("at "):
            bound = e.lower if "lower" in e.verdict else e.upper
            notes.append(f"{name} stands {e.verdict} ({bound:g}); its standard error is not defined there.")
    rivals = [o for o in result.optima[1:] if o.chi2 <= result.optima[0].chi2 + 4.0]
    if rivals:
        notes.append(
            f"{len(rivals)} other optimum(s) fit nearly as well (χ² within 4): the solution is not unique."
        )
    reduced = result.goodness.reduced_chi2
    if data.std_known and reduced > 2.0:
        notes.append(
            f"Reduced χ² is {reduced:.3g}: the model does not describe the data to their stated uncertainty, and "
            "the standard errors are too small by about its square root."
        )
    return notes
