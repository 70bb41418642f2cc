"""A model and observations as a least-squares problem: which unknowns there are, and the residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import FitError
from pbrdf.inversion.block_solver import BlockResiduals
from pbrdf.inversion.blocks import Blocks, Key
from pbrdf.inversion.forward import channel_values, measured_mueller
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.solver import Residuals, linearise
from pbrdf.inversion.stack import Stack
from pbrdf.models.base import Model
from pbrdf.models.parameters import Parameter

__all__ = ["Space", "Term", "derivatives", "misfits", "predict", "prior_residuals", "residuals", "signals_of"]

#: What an even parameter is at least where derivatives are taken, which at 0 would be 0/0: far below what matters.
_POINT = 1e-6


@dataclass(frozen=True)
class Term:
    """What one unknown stands for.

    Attributes
    ----------
    role
        Parameter of the model, or kind of nuisance, whose value it is.
    nuisance
        Whether it is a kind of nuisance.
    split
        ``"group"`` or ``"wavelength"`` if it counts for some geometries only; else None.
    label
        The group or wavelength that it counts for.
    prior
        Mean and standard deviation of a Gaussian prior on the value; None for none.
    """

    role: str
    split: str | None = None
    label: Any = None
    prior: tuple[float, float] | None = None
    nuisance: bool = False


@dataclass(frozen=True)
class Space:
    """The free parameters of a fit, and the way between them and the solver's unknowns.

    The unknown of a logarithmic parameter is its logarithm, that of an even one its square, else the parameter itself.

    Attributes
    ----------
    model
        Class of the model.
    options
        Options of the model.
    free
        The free parameters: the model's in its order, then nuisance terms. A parameter that is free for each
        group or wavelength stands here once for each, as ``a[550]``.
    fixed
        Values of the parameters of the model that are held, by name.
    lower, upper
        Bounds of the free parameters, in their own units, shape (P,).
    terms
        What each free parameter stands for; empty where each is a parameter of the model for all data.
    loss
        Loss of the residuals, see :data:`pbrdf.inversion.solver.LOSSES`.
    by_wavelength
        Parameters that are held at a value of each wavelength: by name, values by wavelength in nm.
    sources
        Where held values come from, if not from the user or a default: sentences by name.
    """

    model: type[Model]
    options: Mapping[str, str]
    free: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    lower: np.ndarray
    upper: np.ndarray
    terms: tuple[Term, ...] = ()
    loss: str = "linear"
    by_wavelength: Mapping[str, Mapping[float, float]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.terms:
            object.__setattr__(self, "terms", tuple(Term(p.name) for p in self.free))

    @property
    def names(self) -> list[str]:
        """Names of the free parameters."""
        return [p.name for p in self.free]

    def to_unknowns(self, values: np.ndarray) -> np.ndarray:
        """Parameters (..., P) to the solver's unknowns."""
        result = np.array(values, dtype=float)
        for i, p in enumerate(self.free):
            if p.logarithmic:
                result[..., i] = np.log(result[..., i])
            elif p.even:
                result[..., i] = result[..., i] ** 2
        return result

    def to_parameters(self, unknowns: np.ndarray) -> np.ndarray:
        """The solver's unknowns (..., P) to parameters."""
        result = np.array(unknowns, dtype=float)
        for i, p in enumerate(self.free):
            if p.logarithmic:
                result[..., i] = np.exp(result[..., i])
            elif p.even:
                result[..., i] = np.sqrt(np.maximum(result[..., i], 0.0))
        return result

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the solver's unknowns, shape (P,) each."""
        return self.to_unknowns(self.lower), self.to_unknowns(self.upper)

    def derivative(self, values: np.ndarray) -> np.ndarray:
        """d parameter / d unknown at the parameters (..., P)."""
        result = np.ones_like(values)
        for i, p in enumerate(self.free):
            if p.logarithmic:
                result[..., i] = values[..., i]
            elif p.even:
                result[..., i] = 0.5 / np.maximum(values[..., i], _POINT)
        return result

    def build(self, values: Sequence[float] | np.ndarray, label: Any = None) -> Model:
        """The model with the free parameters set to ``values``.

        Where a parameter is free for each group or wavelength, or held at a value of each, that of ``label`` counts, or
        the first.
        """
        named = {
            name: table.get(label, next(iter(table.values()))) for name, table in self.by_wavelength.items()
        }
        for term, value in zip(self.terms, values, strict=True):
            if not term.nuisance and (term.role not in named or term.label == label):
                named[term.role] = float(value)
        return self.model.from_values({**self.fixed, **named}, **self.options)

    @property
    def wavelengths(self) -> list[Any]:
        """The wavelengths that have a model of their own, by what is free or held for each; none where all share it."""
        held = next(iter(self.by_wavelength.values()), {})
        return self.labels("wavelength") or list(held)

    def labels(self, split: str) -> list[Any]:
        """The groups or wavelengths that have unknowns of their own."""
        return list(dict.fromkeys(term.label for term in self.terms if term.split == split))

    @cached_property
    def blocks(self) -> Blocks | None:
        """Which free parameters count for one group or wavelength only; None where all count for all data."""
        return Blocks.of([Key((t.nuisance, t.role), t.split, t.label) for t in self.terms])

    @cached_property
    def of_a_block(self) -> Space:
        """The free parameters that count in one block, in the order of :attr:`Blocks.counting`: as many in each."""
        if self.blocks is None:
            return self
        columns = self.blocks.counting[0]
        own = [
            replace(term, split=None, label=None) if term.split == self.blocks.split else term
            for term in (self.terms[c] for c in columns)
        ]
        return replace(
            self,
            free=tuple(self.free[c] for c in columns),
            lower=self.lower[columns],
            upper=self.upper[columns],
            terms=tuple(own),
        )


def residuals(
    space: Space,
    data: Sequence[Observations] | Stack,
    starts: int | np.ndarray = 1,
    accuracy: str | None = None,
    *,
    single: bool = False,
) -> Residuals | BlockResiduals:
    """Weighted residuals (model − measured)/std of several data sets of the same form.

    Where the errors of the channels are correlated, the residuals are W (model − measured) with WᵀW the inverse
    covariance, see :attr:`Observations.whitening`: the sum of their squares is the χ² of all channels together.

    Every lane runs over all geometries of its data set.

    Parameters
    ----------
    space
        Free and fixed parameters.
    data
        Data sets with the same channels, number of geometries and illumination; angles may differ, groups and
        wavelengths may not.
    starts
        Number of lanes for each data set, lane l belonging to data set l // starts; or the number of the data set of
        each lane, shape (B,).
    accuracy
        Accuracy of the model, if not that of the space's options.
    single
        Whether in single precision.

    Raises
    ------
    FitError
        If the data sets differ in form.
    """
    import drjit as dr

    stack = data if isinstance(data, Stack) else Stack.of(data)
    backend = get_backend()
    Float, UInt32 = backend.Float32 if single else backend.Float, backend.UInt32
    points = stack.points
    misfit = misfits(space.of_a_block, stack, accuracy, Float)
    divisor = owner = None
    if isinstance(starts, int):
        divisor = dr.opaque(UInt32, starts)
    else:
        owner = backend.upload(UInt32, starts)

    def function(u: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
        return misfit(u, lane // divisor if owner is None else dr.gather(UInt32, owner, lane), point)

    # grazing geometries take more work: side by side with their like
    order = np.argsort(np.maximum(stack.theta_i, stack.theta_r)[:, 0], kind="stable").astype(np.uint32)
    if space.blocks is None:
        rough: Any = None if single else partial(residuals, space, stack, starts, accuracy, single=True)
        return Residuals(function, points, _penalty(space), space.loss, order, rough)
    place = space.blocks.places(getattr(stack, space.blocks.split))
    blocks = len(space.blocks.labels)
    if (place == blocks).any():
        raise FitError(f"data of a {space.blocks.split} without parameters of its own cannot be fitted")
    return BlockResiduals(
        blocks=space.blocks,
        residuals=Residuals(function, points, loss=space.loss),
        order=order[np.argsort(place[order], kind="stable")],
        begin=np.searchsorted(np.sort(place), np.arange(blocks + 1)),
        penalty=prior_residuals(space),
    )


def misfits(
    space: Space, stack: Stack, accuracy: str | None, Float: Any
) -> Callable[[list[Any], Any, Any], tuple[list[Any], Any]]:
    """What one point of one data set says: ``f(u, number, point)`` over Dr.Jit floats.

    It returns the weighted residuals of the channels, W (model − measured), for the unknowns of the space, and whatever
    else was computed on the way, see :class:`~pbrdf.inversion.solver.Residuals`.
    """
    import drjit as dr

    signals = _Signals(space, stack, accuracy, Float)
    measured = stack.upload("values", Float)
    stride = dr.opaque(get_backend().UInt32, len(stack))
    factors: dict[tuple[int, int], Any] | None = None
    weights: list[Any] = []
    if stack.whitening is not None:
        factors = dict(zip(stack.whitening, stack.upload("whitening", Float), strict=True))
    else:
        weights = stack.upload("weights", Float)

    def function(u: list[Any], number: Any, point: Any) -> tuple[list[Any], Any]:
        modelled, alive = signals(u, number, point, stack.channels)
        at = point * stride + number
        if factors is not None:
            differences = [m - dr.gather(Float, y, at) for m, y in zip(modelled, measured, strict=True)]
            correlated: list[Any] = []
            for i in range(len(differences)):
                total = differences[0] * dr.gather(Float, factors[i, 0], at)
                for j in range(1, i + 1):
                    total = dr.fma(differences[j], dr.gather(Float, factors[i, j], at), total)
                correlated.append(total)
            return correlated, alive
        weighted = [
            (m - dr.gather(Float, y, at)) * dr.gather(Float, w, at)
            for m, y, w in zip(modelled, measured, weights, strict=True)
        ]
        return weighted, alive

    return function


def predict(
    space: Space, unknowns: np.ndarray, data: Observations, channels: Sequence[str]
) -> dict[str, np.ndarray]:
    """Modelled values of any channels at the geometries of a data set, nuisance terms included.

    Parameters
    ----------
    space
        Free and fixed parameters.
    unknowns
        The solver's unknowns, shape (P,).
    data
        Geometries and illumination.
    channels
        ``I``, ``Q``, ``U``, ``V``, ``dolp`` or ``m00`` … ``m33``.

    Returns
    -------
    dict
        Arrays of shape (G,) by channel.
    """
    import drjit as dr

    backend = get_backend()
    size = len(data.theta_i)
    point = dr.arange(backend.UInt32, size)
    if space.blocks is None:
        u = [dr.opaque(backend.Float, float(v)) for v in unknowns]
    else:
        counting, _ = _at_points(space, np.asarray(unknowns, dtype=float)[None], data)
        u = [backend.upload(backend.Float, column) for column in counting[0].T]
    signals = _Signals(space.of_a_block, Stack.of([data]), None, backend.Float)
    values, _ = signals(u, dr.zeros(backend.UInt32, size), point, channels)
    arrays = [backend.Float(v) + dr.zeros(backend.Float, size) for v in values]
    dr.eval(arrays)
    return {name: array.numpy() for name, array in zip(channels, arrays, strict=True)}


def derivatives(
    space: Space, unknowns: np.ndarray, data: Observations, channels: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Modelled values of channels and their exact derivatives with respect to the solver's unknowns.

    Parameters
    ----------
    space
        Free and fixed parameters.
    unknowns
        Sets of the solver's unknowns, shape (B, P).
    data
        Geometries and illumination.
    channels
        As for :func:`predict`.

    Returns
    -------
    values, jacobian
        Shapes (B, G, C) and (B, G, C, P).
    """
    import drjit as dr

    unknowns = np.asarray(unknowns, dtype=float)
    batch, size = len(unknowns), len(data.theta_i)
    backend = get_backend()
    UInt32 = backend.UInt32
    count = dr.opaque(UInt32, size)
    signals = _Signals(space.of_a_block, Stack.of([data]), None, backend.Float)
    counting, place = _at_points(space, unknowns, data)

    def function(u: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
        # a lane for each geometry of each set of unknowns
        return signals(u, UInt32(0), lane % count, channels)

    values, jacobian = linearise(function, counting.reshape(batch * size, -1), len(channels))
    shape = (batch, size, len(channels))
    jacobian = jacobian.reshape(*shape, -1)
    if space.blocks is not None:
        jacobian = space.blocks.spread(jacobian, place)
    return values.reshape(shape), jacobian


def _at_points(space: Space, unknowns: np.ndarray, data: Observations) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns that count at each geometry, (B, P) to (B, G, …), and the block of each geometry, shape (G,)."""
    size = len(data.theta_i)
    if space.blocks is None:
        return np.broadcast_to(unknowns[:, None], (len(unknowns), size, unknowns.shape[1])), np.zeros(size)
    place = space.blocks.places(getattr(data, space.blocks.split))
    return space.blocks.at(unknowns, place), place


def signals_of(space: Space, data: Sequence[Observations] | Stack, accuracy: str | None = None) -> Any:
    """``f(u, number, point, channels)``: channels modelled at a point of a data set, and what else was computed."""
    stack = data if isinstance(data, Stack) else Stack.of(data)
    return _Signals(space, stack, accuracy, get_backend().Float)


class _Signals:
    """Channels modelled at one point of one data set, over Dr.Jit floats."""

    def __init__(self, space: Space, stack: Stack, accuracy: str | None, Float: Any) -> None:
        import drjit as dr

        backend = get_backend()
        self.Float, self.UInt32 = Float, backend.UInt32
        self.space, self.incident = space, stack.illumination
        model = space.build(space.lower)  # only its kernel and options are used
        self.model = model if accuracy is None else model.with_accuracy(accuracy)
        self.fixed = {name: dr.opaque(self.Float, value) for name, value in space.fixed.items()}
        self.absent = [p.name for p in model.parameters if p.vanishing and space.fixed.get(p.name) == 0.0]
        self.held = {
            name: backend.upload(self.Float, _at_wavelengths(name, table, stack))
            for name, table in space.by_wavelength.items()
        }
        # arrays over the geometries and data sets: where these share them, one number for all
        width = stack.theta_i.shape[1]
        self.stride, self.step = dr.opaque(self.UInt32, width), dr.opaque(self.UInt32, int(width > 1))
        self.angles = [stack.upload(name, self.Float)[0] for name in ("theta_i", "theta_r", "phi")]
        nuisances = {term.role for term in space.terms if term.nuisance}
        if "angle" in nuisances and (np.abs(np.sin(stack.phi)) > 1e-6).any():
            raise FitError("nuisance angle: it needs data in the plane of incidence (phi 0° or 180°)")
        self.scale = None
        if "dark" in nuisances:
            scale = np.ones((stack.points, 1)) if stack.scale is None else stack.scale
            self.scale = backend.upload(self.Float, scale.ravel())
            self.scale_stride = dr.opaque(self.UInt32, scale.shape[1])
            self.scale_step = dr.opaque(self.UInt32, int(scale.shape[1] > 1))
        self.label_index = {
            split: backend.upload(self.UInt32, _label_index(stack, split, labels))
            for split in ("group", "wavelength")
            if (labels := space.labels(split))
        }

    def __call__(
        self, u: list[Any], number: Any, point: Any, channels: Sequence[str]
    ) -> tuple[list[Any], Any]:
        import drjit as dr

        values: dict[str, Any] = dict(self.fixed)
        values |= {name: dr.gather(self.Float, column, point) for name, column in self.held.items()}
        nuisances: dict[str, Any] = {}
        shared: dict[tuple[bool, str], list[Any]] = {}
        for term, unknown in zip(self.space.terms, u, strict=True):
            shared.setdefault((term.nuisance, term.role), []).append(unknown)
        parameters = {
            (term.nuisance, term.role): p for term, p in zip(self.space.terms, self.space.free, strict=True)
        }
        for (nuisance, role), unknowns in shared.items():
            # a group or wavelength without an unknown of its own (held out) gets the mean of the others
            mean = sum(unknowns[1:], unknowns[0]) / len(unknowns) if len(unknowns) > 1 else unknowns[0]
            target = nuisances if nuisance else values
            target[role] = _value(parameters[nuisance, role], mean)
        for term, unknown in zip(self.space.terms, u, strict=True):
            if term.split is not None:
                value = _value(parameters[term.nuisance, term.role], unknown)
                index = dr.gather(self.UInt32, self.label_index[term.split], point)
                chosen = index == self.space.labels(term.split).index(term.label)
                target = nuisances if term.nuisance else values
                target[term.role] = dr.select(chosen, value, target[term.role])
        values |= dict.fromkeys(self.absent)
        at = point * self.stride + number * self.step
        theta_i, theta_r, phi = (dr.gather(self.Float, angle, at) for angle in self.angles)
        f, alive = measured_mueller(self.model, values, nuisances, theta_i, theta_r, phi)
        dark = None
        if "dark" in nuisances:
            at = point * self.scale_stride + number * self.scale_step
            dark = nuisances["dark"] * dr.gather(self.Float, self.scale, at)
        return channel_values(f, channels, self.incident, nuisances.get("gain"), dark), (alive, f)


def _value(p: Parameter, unknown: Any) -> Any:
    """A parameter from the solver's unknown, a Dr.Jit float."""
    import drjit as dr

    if p.logarithmic:
        return dr.exp(unknown)
    return dr.sqrt(unknown + _POINT * _POINT) if p.even else unknown


def _at_wavelengths(name: str, table: Mapping[float, float], stack: Stack) -> np.ndarray:
    """The value of each geometry, of a parameter that is held at one of each wavelength."""
    known = np.full(stack.points, np.nan) if stack.wavelength is None else stack.wavelength
    missing = ~np.isin(known, list(table))
    if missing.any():
        raise FitError(
            f"{name} is held at values of {len(table)} wavelengths; {known[missing][0]:g} nm is none of them"
        )
    return np.array([table[float(wavelength)] for wavelength in known])


def _label_index(stack: Stack, split: str, labels: list[Any]) -> np.ndarray:
    """Position of each geometry's label among those that have unknowns of their own, or their number."""
    index = np.full(stack.points, len(labels), dtype=np.uint32)
    for position, label in enumerate(labels):
        index[getattr(stack, split) == label] = position
    return index


def _penalty(space: Space) -> Any:
    """Residuals of the priors, or None."""
    if all(term.prior is None for term in space.terms):
        return None

    def penalty(u: list[Any]) -> list[tuple[int, Any, Any]]:

        found = []
        for i, (term, p) in enumerate(zip(space.terms, space.free, strict=True)):
            if term.prior is not None:
                mean, weight = term.prior[0], 1.0 / term.prior[1]
                value = _value(p, u[i])
                slope: Any = 1.0
                if p.logarithmic:
                    slope = value
                elif p.even:
                    slope = 0.5 / value
                found.append((i, (value - mean) * weight, slope * weight))
        return found

    return penalty


def prior_residuals(space: Space) -> Any:
    """Residuals of the priors of all unknowns and their derivatives, or None; see :class:`BlockResiduals`."""
    priors = np.array([(0.0, np.inf) if term.prior is None else term.prior for term in space.terms])
    if np.isinf(priors[:, 1]).all():
        return None

    def penalty(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = space.to_parameters(u)
        return (values - priors[:, 0]) / priors[:, 1], space.derivative(values) / priors[:, 1]

    return penalty
