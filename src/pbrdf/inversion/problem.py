"""A model and observations as a least-squares problem: which unknowns there are, and the residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
from pbrdf.models.base import Model
from pbrdf.models.parameters import Parameter

__all__ = ["Space", "Term", "derivatives", "predict", "residuals", "signals_of"]

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
        Values of all other parameters of the model by name.
    lower, upper
        Bounds of the free parameters, in their own units, shape (P,).
    terms
        What each free parameter stands for; empty where each is a parameter of the model for all data.
    loss
        Loss of the residuals, see :data:`pbrdf.inversion.solver.LOSSES`.
    """

    model: type[Model]
    options: Mapping[str, str]
    free: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    lower: np.ndarray
    upper: np.ndarray
    terms: tuple[Term, ...] = ()
    loss: str = "linear"

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

        Where a parameter is free for each group or wavelength, that of ``label`` counts, or the first.
        """
        named: dict[str, float] = {}
        for term, value in zip(self.terms, values, strict=True):
            if not term.nuisance and (term.role not in named or term.label == label):
                named[term.role] = float(value)
        return self.model.from_values({**self.fixed, **named}, **self.options)

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
    data: Sequence[Observations],
    starts: int = 1,
    accuracy: str | None = None,
    *,
    single: bool = False,
) -> Residuals | BlockResiduals:
    """Weighted residuals (model − measured)/std of several data sets of the same form.

    Where the errors of the channels are correlated, the residuals are W (model − measured) with WᵀW the inverse
    covariance, see :attr:`Observations.whitening`: the sum of their squares is the χ² of all channels together.

    Lane number l belongs to data set l // starts; every lane runs over all geometries of its data set.

    Parameters
    ----------
    space
        Free and fixed parameters.
    data
        Data sets with the same channels, number of geometries and illumination; angles may differ, groups and
        wavelengths may not.
    starts
        Number of lanes for each data set.
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

    first = data[0]
    for other in data[1:]:
        if other.channels != first.channels or other.values.shape != first.values.shape:
            raise FitError("data sets fitted together must have the same channels and number of geometries")
        if other.illumination != first.illumination:
            raise FitError("data sets fitted together must have the same illumination")
    backend = get_backend()
    Float, UInt32 = backend.Float32 if single else backend.Float, backend.UInt32
    points = first.values.shape[1]
    signals = _Signals(space.of_a_block, data, accuracy, Float)
    factors = None
    if any(o.correlation is not None for o in data):
        size = len(first.channels)
        factors = {
            (i, j): backend.upload(Float, np.concatenate([o.whitening[i, j] for o in data]))
            for i in range(size)
            for j in range(i + 1)
        }
    channels = range(len(first.channels))
    measured = [backend.upload(Float, np.concatenate([o.values[c] for o in data])) for c in channels]
    weights = [backend.upload(Float, np.concatenate([1.0 / o.std[c] for o in data])) for c in channels]
    divisor = dr.opaque(UInt32, starts)
    stride = dr.opaque(UInt32, points)

    def function(u: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
        number = lane // divisor
        modelled, alive = signals(u, number, point, first.channels)
        at = number * stride + point
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

    # grazing geometries take more work: side by side with their like
    order = np.argsort(np.maximum(first.theta_i, first.theta_r), kind="stable").astype(np.uint32)
    if space.blocks is None:
        rough: Any = None if single else partial(residuals, space, data, starts, accuracy, single=True)
        return Residuals(function, points, _penalty(space), space.loss, order, rough)
    place = space.blocks.places(getattr(first, space.blocks.split))
    blocks = len(space.blocks.labels)
    if (place == blocks).any():
        raise FitError(f"data of a {space.blocks.split} without parameters of its own cannot be fitted")
    return BlockResiduals(
        blocks=space.blocks,
        residuals=Residuals(function, points, loss=space.loss),
        order=order[np.argsort(place[order], kind="stable")],
        begin=np.searchsorted(np.sort(place), np.arange(blocks + 1)),
        penalty=_block_penalty(space),
    )


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
    signals = _Signals(space.of_a_block, [data], None, backend.Float)
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
    signals = _Signals(space.of_a_block, [data], None, backend.Float)
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


def signals_of(space: Space, data: Sequence[Observations], accuracy: str | None = None) -> Any:
    """``f(u, number, point, channels)``: channels modelled at a point of a data set, for residuals of one's own."""
    return _Signals(space, data, accuracy, get_backend().Float)


class _Signals:
    """Channels modelled at one point of one data set, over Dr.Jit floats."""

    def __init__(self, space: Space, data: Sequence[Observations], accuracy: str | None, Float: Any) -> None:
        import drjit as dr

        backend = get_backend()
        self.Float, self.UInt32 = Float, backend.UInt32
        self.space, self.incident = space, data[0].illumination
        model = space.build(space.lower)  # only its kernel and options are used
        self.model = model if accuracy is None else model.with_accuracy(accuracy)
        self.fixed = {name: dr.opaque(self.Float, value) for name, value in space.fixed.items()}
        self.absent = [p.name for p in model.parameters if p.vanishing and space.fixed.get(p.name) == 0.0]
        first = data[0]
        size = len(first.theta_i)
        names = ("theta_i", "theta_r", "phi")

        def is_first(o: Observations, name: str) -> bool:
            own, other = getattr(o, name), getattr(first, name)
            return own is other or np.array_equal(own, other)

        same = all(is_first(o, name) for o in data[1:] for name in names)
        self.stride = dr.opaque(self.UInt32, 0 if same else size)

        def upload(column: str) -> Any:
            arrays = [getattr(o, column) for o in (data[:1] if same else data)]
            return backend.upload(self.Float, np.concatenate(arrays))

        self.angles = [upload(name) for name in names]
        nuisances = {term.role for term in space.terms if term.nuisance}
        if "angle" in nuisances and any((np.abs(np.sin(o.phi)) > 1e-6).any() for o in data):
            raise FitError("nuisance angle: it needs data in the plane of incidence (phi 0° or 180°)")
        self.scale = None
        if "dark" in nuisances:
            scale = np.ones(size) if first.scale is None else first.scale
            self.scale = backend.upload(self.Float, scale)
        self.label_index = {
            split: backend.upload(self.UInt32, _label_index(first, split, labels))
            for split in ("group", "wavelength")
            if (labels := space.labels(split))
        }

    def __call__(
        self, u: list[Any], number: Any, point: Any, channels: Sequence[str]
    ) -> tuple[list[Any], Any]:
        import drjit as dr

        values: dict[str, Any] = dict(self.fixed)
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
        at = number * self.stride + point
        theta_i, theta_r, phi = (dr.gather(self.Float, a, at) for a in self.angles)
        f, alive = measured_mueller(self.model, values, nuisances, theta_i, theta_r, phi)
        dark = None
        if "dark" in nuisances:
            dark = nuisances["dark"] * dr.gather(self.Float, self.scale, point)
        return channel_values(f, channels, self.incident, nuisances.get("gain"), dark), (alive, f)


def _value(p: Parameter, unknown: Any) -> Any:
    """A parameter from the solver's unknown, a Dr.Jit float."""
    import drjit as dr

    if p.logarithmic:
        return dr.exp(unknown)
    return dr.sqrt(unknown + _POINT * _POINT) if p.even else unknown


def _label_index(data: Observations, split: str, labels: list[Any]) -> np.ndarray:
    """Position of each geometry's label among those that have unknowns of their own, or their number."""
    index = np.full(len(data.theta_i), len(labels), dtype=np.uint32)
    for position, label in enumerate(labels):
        index[getattr(data, split) == label] = position
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


def _block_penalty(space: Space) -> Any:
    """Residuals of the priors of all unknowns and their derivatives, or None; see :class:`BlockResiduals`."""
    priors = np.array([(0.0, np.inf) if term.prior is None else term.prior for term in space.terms])
    if np.isinf(priors[:, 1]).all():
        return None

    def penalty(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = space.to_parameters(u)
        return (values - priors[:, 0]) / priors[:, 1], space.derivative(values) / priors[:, 1]

    return penalty
