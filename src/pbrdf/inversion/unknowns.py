"""Which unknowns a fit has: from what a user asks for to the free parameters, their bounds and starting values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import is_ratio
from pbrdf.errors import FitError
from pbrdf.inversion.held_values import Held, held_values, in_words
from pbrdf.inversion.nuisance import KINDS, Nuisance, check_prior
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, Term
from pbrdf.inversion.solver import LOSSES
from pbrdf.inversion.stack import Stack
from pbrdf.models import Model, find_model
from pbrdf.models.parameters import Parameter

__all__ = ["OBJECTIVES", "apply_starts", "bounds_of_each", "check_choices", "space_of", "with_terms"]

OBJECTIVES = ("stokes", "paper")


def check_choices(starts: int, loss: str, objective: str) -> None:
    """Check options of a fit that are one of a few; raises FitError."""
    if starts < 1:
        raise FitError(f"starts={starts}: at least one start is needed")
    if loss not in LOSSES:
        raise FitError(f"loss={loss!r}: choose one of {', '.join(LOSSES)}")
    if objective not in OBJECTIVES:
        raise FitError(f"objective={objective!r}: choose one of {', '.join(OBJECTIVES)}")


def space_of(
    model: type[Model] | Model | str,
    options: Mapping[str, str],
    fix: Mapping[str, Held],
    free: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
    start: Mapping[str, float],
    data: Observations,
    wavelength: np.ndarray | None = None,
) -> tuple[Space, dict[str, float]]:
    """Free and fixed parameters with their bounds, and the starting values of a given model.

    ``wavelength`` is that of each geometry, shape (G,), of those too that are held out of ``data``.
    """
    begin: dict[str, float] = {}
    chosen = dict(options)
    if isinstance(model, Model):
        if any(np.ndim(v) for v in model.values.values()):
            raise FitError("the model to start from holds arrays: give one with single numbers")
        begin = {name: float(v) for name, v in model.values.items()}
        chosen = {**model.chosen, **chosen}
        cls = type(model)
    elif isinstance(model, str):
        cls = find_model(model)
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
                raise FitError(f"{what}: the parameter {name} is fixed at {in_words(fix[name])}")
    held = held_values(cls, fix, data.wavelength if wavelength is None else wavelength, {*free, *bounds})
    free_parameters, fixed, lower, upper = [], dict(held.fixed), [], []
    for p in cls.parameters:
        if p.name in held.fixed or p.name in held.by_wavelength:
            continue
        if not (p.fitted or p.name in free or p.name in bounds):
            fixed[p.name] = begin.get(p.name, p.default)
            continue
        low, high = _bounds(cls, p, bounds.get(p.name), data, chosen)
        value = start.get(p.name)
        if value is not None and not low <= value <= high:
            raise FitError(f"start: {p.name}={value:g} lies outside its bounds {low:g} … {high:g}")
        free_parameters.append(p)
        lower.append(low)
        upper.append(high)
    if not free_parameters:
        raise FitError("every parameter is fixed: nothing is left to fit")
    space = Space(
        cls,
        chosen,
        tuple(free_parameters),
        {p.name: fixed[p.name] for p in cls.parameters if p.name in fixed},
        np.array(lower),
        np.array(upper),
        by_wavelength=held.by_wavelength,
        sources=held.sources,
    )
    for label in space.wavelengths or [None]:
        # raises ModelError for a fixed value or a bound outside the model's domain
        space.build(space.lower, label)
        space.build(space.upper, label)
    return space, begin


def _bounds(
    cls: type[Model],
    p: Parameter,
    given: tuple[float, float] | None,
    data: Observations,
    options: Mapping[str, str],
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
    if p.amplitude and _holds_intensity(
        data.channels
    ):  # ratios set it against the facets, whose scale is absolute
        return tuple(map(float, _amplitude_bounds(p, data.typical_intensity)))  # type: ignore[return-value]
    return cls.fit_bounds(p, options)


def _holds_intensity(channels: Sequence[str]) -> bool:
    return not {"I", "m00"}.isdisjoint(channels)


def _amplitude_bounds(p: Parameter, typical: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """An amplitude is on the data's own scale: π times a typical value is its order of magnitude."""
    scale = np.where(np.isfinite(typical), math.pi * np.asarray(typical), 1.0)
    return np.maximum(1e-3 * scale, p.domain[0]), np.minimum(1e3 * scale, p.domain[1])


def _nuisance_bounds(kind: str, typical: ArrayLike, scale: ArrayLike) -> tuple[Any, Any]:
    """Bounds of a nuisance term; ``scale`` is the typical factor that brought the data to the scale of a BRDF."""
    known = np.where(np.isfinite(typical), typical, 1.0)
    if kind == "dark":
        return -known / scale, known / scale
    if kind == "gain":
        return 0.01 * math.pi * known, 100.0 * math.pi * known
    return KINDS[kind].lower, KINDS[kind].upper


def bounds_of_each(
    space: Space, stack: Stack, given: Mapping[str, tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the free parameters of each of many data sets, shape (B, P): some follow from the data.

    Parameters
    ----------
    space
        Made by :func:`with_terms` from data of the same form.
    stack
        The data sets.
    given
        Bounds that the user stated, which no data change.
    """
    lower, upper = (np.tile(of, (len(stack), 1)) for of in (space.lower, space.upper))
    typical = stack.typical_intensity()
    scale = 1.0 if stack.scale is None else np.median(stack.scale, axis=0)
    with_gain = any(term.nuisance and term.role == "gain" for term in space.terms)
    follows = _holds_intensity(stack.channels) and not with_gain
    for i, (term, p) in enumerate(zip(space.terms, space.free, strict=True)):
        if term.nuisance:
            lower[:, i], upper[:, i] = _nuisance_bounds(term.role, typical, scale)
        elif p.amplitude and follows and term.role not in given:
            lower[:, i], upper[:, i] = _amplitude_bounds(p, typical)
    return lower, upper


def with_terms(
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
    if with_gain and all(map(is_ratio, data.channels)):
        raise FitError("nuisance gain: only ratios were measured, which no gain changes; leave it out")

    def add(p: Parameter, low: float, high: float, term: Term) -> None:
        name = p.name if term.split is None else f"{p.name}[{_label_text(term.label)}]"
        free.append(replace(p, name=name))
        terms.append(term)
        lower.append(low)
        upper.append(high)

    for p, low, high in zip(space.free, space.lower, space.upper, strict=True):
        prior = priors.get(p.name)
        check_prior(f"prior of {p.name}", prior)
        if p.amplitude and with_gain and p.name not in bounds:
            # the gain takes the scale of the data
            low, high = max(1e-3, p.domain[0]), min(10.0, p.domain[1])
        for label in _labels(data, split.get(p.name), p.name):
            add(p, low, high, Term(p.name, split.get(p.name), label, prior))
    for nuisance in given_terms:
        p = KINDS[nuisance.kind]
        scale = 1.0 if data.scale is None else float(np.median(data.scale))
        low, high = map(float, _nuisance_bounds(nuisance.kind, data.typical_intensity, scale))
        if any(t.nuisance and t.role == nuisance.kind for t in terms):
            raise FitError(f"nuisance {nuisance.kind} is given twice")
        if any(p.name == nuisance.kind for p in space.model.parameters):
            raise FitError(
                f"nuisance {nuisance.kind}: {space.model.name} has a parameter of the same name, which cannot be told "
                "from it: rename that"
            )
        by = "group" if nuisance.per_group else None
        for label in _labels(data, by, nuisance.kind):
            add(p, low, high, Term(nuisance.kind, by, label, nuisance.prior, nuisance=True))
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


def apply_starts(
    first: np.ndarray,
    space: Space,
    begin: Mapping[str, float],
    start: Mapping[str, float],
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
) -> None:
    """Put starting values of the user and of the nuisance terms into the drawn ones, (…, S, P), in place.

    ``bounds`` are those of each data set, shape (…, P), where they are not those of the space.
    """
    values = space.to_parameters(first)
    lower, upper = (space.lower, space.upper) if bounds is None else bounds
    for i, term in enumerate(space.terms):
        role = term.role
        if not term.nuisance:
            if role in begin:
                values[..., 0, i] = np.clip(begin[role], lower[..., i], upper[..., i])
            if role in start:
                values[..., i] = start[role]
        elif role != "gain":
            # not 0 for the source: its effect is even in the radius, the derivative would vanish
            default = 0.2 * space.upper[i] if role == "source" else KINDS[role].default
            values[..., i] = term.prior[0] if term.prior else default
    first[:] = space.to_unknowns(values)
