"""Which unknowns a fit has: from what a user asks for to the free parameters, their bounds and starting values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.errors import FitError
from pbrdf.inversion.nuisance import KINDS, Nuisance, check_prior
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, Term
from pbrdf.models import Model, find_model
from pbrdf.models.parameters import Parameter

__all__ = ["apply_starts", "space_of", "with_terms"]


def space_of(
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
                raise FitError(f"{what}: the parameter {name} is fixed at {fix[name]:g}")
    free_parameters, fixed, lower, upper = [], {}, [], []
    for p in cls.parameters:
        if p.name in fix:
            fixed[p.name] = float(fix[p.name])
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
    space = Space(cls, chosen, tuple(free_parameters), fixed, np.array(lower), np.array(upper))
    space.build(space.lower)  # raises ModelError for a fixed value or a bound outside the model's domain
    space.build(space.upper)
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
    if p.amplitude:
        # an amplitude is on the data's own scale: π times a typical value is its order of magnitude
        measured = [data.values[c] for c, n in enumerate(data.channels) if n in ("I", "m00")]
        if not measured:  # ratios set an amplitude against the facets, whose scale is absolute
            return cls.fit_bounds(p, options)
        intensity = np.concatenate(measured)
        positive = intensity[intensity > 0.0]
        scale = math.pi * float(np.median(positive)) if positive.size else 1.0
        return max(1e-3 * scale, p.domain[0]), min(1e3 * scale, p.domain[1])
    return cls.fit_bounds(p, options)


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
        if p.amplitude and with_gain and p.name not in bounds:
            # the gain takes the scale of the data
            low, high = max(1e-3, p.domain[0]), min(10.0, p.domain[1])
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
    first: np.ndarray, space: Space, begin: Mapping[str, float], start: Mapping[str, float]
) -> None:
    """Put starting values of the user and of the nuisance terms into the drawn ones, in place."""
    values = space.to_parameters(first)
    for i, term in enumerate(space.terms):
        role = term.role
        if not term.nuisance:
            if role in begin:
                values[0, i] = min(max(begin[role], space.lower[i]), space.upper[i])
            if role in start:
                values[:, i] = start[role]
        elif role != "gain":
            # not 0 for the source: its effect is even in the radius, the derivative would vanish
            default = 0.2 * space.upper[i] if role == "source" else KINDS[role].default
            values[:, i] = term.prior[0] if term.prior else default
    first[:] = space.to_unknowns(values)
