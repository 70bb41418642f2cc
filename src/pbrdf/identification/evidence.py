"""How well each material explains a measurement: likelihoods integrated over specimens and nuisances.

A specimen of a material is a draw from a normal distribution of the solver's unknowns (the logarithm of a logarithmic
parameter, else the parameter), mean μ and covariance LLᵀ. A measurement depends on it through the model and on what the
instrument adds: a gain, an offset of the sample's angle. All of them are written with independent standard normal
numbers z; the posterior of z has the density exp(−c(z)) with

    c(z) = ½ Σ (residual/std)² + ½ |z|².

Its maximum ẑ is found by the batched solver, a lane for each material of each measurement, and the integral over z is
Laplace's approximation, log p = −c(ẑ) − ½ log det H, with H = JᵀJ + 1 at ẑ (MacKay, *Information Theory, Inference, and
Learning Algorithms* (2003), ch. 27-28). It is exact where the model is linear over the posterior; constants that all
materials share are left out. 2 c(ẑ) is the squared Mahalanobis distance from the material's predictive distribution:
for a linear model it follows χ² with as many degrees of freedom as there are measured values, less one for a gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.data.schema import is_ratio
from pbrdf.errors import FitError
from pbrdf.identification.material import Material
from pbrdf.inversion.nuisance import KINDS
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, Term, derivatives, misfits, signals_of
from pbrdf.inversion.solver import Residuals, Solution, solve
from pbrdf.inversion.stack import Stack

__all__ = ["Evidence", "evidence", "linearised", "posterior"]

#: A gain that is not known is log-normal about the best one, with so many e-folds: a factor of 20 either way.
GAIN_SPREAD = 3.0
#: How far from its mean, in standard deviations, a specimen is looked for.
REACH = 8.0
#: Measurements whose likelihoods are found together, at most: more take more memory.
TOGETHER = 1 << 12
#: A specimen farther than this from its mean is looked for again, starting no farther than that.
FAR, NEAR = 5.0, 3.0


@dataclass(frozen=True)
class Evidence:
    """What the data say of each material; B measurements, C materials.

    Attributes
    ----------
    log_evidence
        Logarithm of the integrated likelihood, but for a constant of the measurement, shape (B, C).
    distance
        Squared Mahalanobis distance of the data from the predictive distribution, shape (B, C).
    degrees_of_freedom
        Of χ² that the distance follows for the true material, shape (B,).
    values
        Most likely parameters of the specimen by material, in the order of its free parameters, shape (B, P) each.
    """

    log_evidence: np.ndarray
    distance: np.ndarray
    degrees_of_freedom: np.ndarray
    values: tuple[np.ndarray, ...]


def evidence(
    materials: Sequence[Material],
    data: Sequence[Observations] | Stack,
    *,
    gain: bool = False,
    angle: float | None = None,
    accuracy: str | None = None,
    max_iterations: int = 50,
) -> Evidence:
    """Integrated likelihoods of materials.

    Parameters
    ----------
    materials
        C materials; their models may differ.
    data
        B measurements with the same channels, number of geometries and illumination; a channel may be missing in some.
    gain
        Whether all intensities have a common factor that is not known.
    angle
        Standard deviation of an offset of the sample's angle in radians; None for none.
    accuracy
        Accuracy of the models; None takes their own.
    max_iterations
        Steps of the solver at most.

    Raises
    ------
    FitError
        If the measurements differ in form, or an angle's offset is asked for out of the plane of incidence.
    """
    stack = data if isinstance(data, Stack) else Stack.of(data)
    batch, count = len(stack), len(materials)
    if batch > TOGETHER:
        asked: dict[str, Any] = {"gain": gain, "angle": angle, "accuracy": accuracy}
        return _joined(
            [
                evidence(
                    materials,
                    stack.take(np.arange(begin, min(begin + TOGETHER, batch))),
                    max_iterations=max_iterations,
                    **asked,
                )
                for begin in range(0, batch, TOGETHER)
            ]
        )
    log_evidence, distance = np.empty((batch, count)), np.empty((batch, count))
    values: list[Any] = [None] * count
    gain = gain and not all(is_ratio(channel) for channel in stack.channels)
    factors = _best_gains(materials, stack) if gain else None
    centre = None if factors is None else factors.mean(axis=1)
    for members in _alike(materials):
        group = [materials[i] for i in members]
        start = None if factors is None else factors[:, members]
        solution = _of_one_model(group, stack, start, centre, angle, accuracy, max_iterations)
        size, shape = len(group[0].mean), (batch, len(group))
        cost = solution.cost.reshape(shape)
        logdet = np.linalg.slogdet(solution.information)[1].reshape(shape)
        log_evidence[:, members] = -cost - 0.5 * logdet
        # the prior of the gain is none of the data's
        of_gain = 0.0 if factors is None else solution.u[:, size].reshape(shape) ** 2
        distance[:, members] = 2.0 * cost - of_gain
        z = solution.u[:, :size].reshape(*shape, size)
        for place, member in enumerate(members):
            own = materials[member]
            unknowns = np.clip(own.mean + z[:, place] @ own.root.T, *own.space.box)
            values[member] = own.space.to_parameters(unknowns)
    return Evidence(log_evidence, distance, stack.count - int(gain), tuple(values))


def _joined(parts: Sequence[Evidence]) -> Evidence:
    """Of measurements one after the other."""
    return Evidence(
        log_evidence=np.concatenate([part.log_evidence for part in parts]),
        distance=np.concatenate([part.distance for part in parts]),
        degrees_of_freedom=np.concatenate([part.degrees_of_freedom for part in parts]),
        values=tuple(np.concatenate(own) for own in zip(*(part.values for part in parts), strict=True)),
    )


def posterior(
    material: Material,
    data: Sequence[Observations],
    *,
    gain: bool = False,
    angle: float | None = None,
    accuracy: str | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Mode and information of z for one material, and the logarithm of the gain about which z counts it.

    Parameters as of :func:`evidence`.

    Returns
    -------
    z, information, centre
        Shapes (B, Z), (B, Z, Z) and (B,), None where the gain is known. z holds the specimen's numbers, then the
        gain's (ln g = centre + ``GAIN_SPREAD`` z) and that of the sample's angle (δ = ``angle`` z).
    """
    stack = Stack.of(data)
    factors = _best_gains([material], stack) if gain else None
    centre = None if factors is None else factors.mean(axis=1)
    solution = _of_one_model([material], stack, factors, centre, angle, accuracy, 50)
    return solution.u, solution.information, centre


def linearised(
    material: Material, z: np.ndarray, centre: float | None, angle: float | None, geometries: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Signals of one specimen at other geometries, and their derivatives with respect to z.

    Parameters
    ----------
    material
        The material.
    z, centre, angle
        Of one measurement, as :func:`posterior` has them, shape (Z,).
    geometries
        Where, with the channels and the illumination; its values are not looked at.

    Returns
    -------
    values, jacobian
        Shapes (G, C) and (G, C, Z).
    """
    size = len(material.mean)
    nuisances = _nuisances(centre is not None, angle)
    low, high = material.space.box
    unbounded = material.mean + material.root @ z[:size]
    scales = ([] if centre is None else [GAIN_SPREAD]) + ([] if angle is None else [angle])
    offsets = ([] if centre is None else [centre]) + ([] if angle is None else [0.0])
    u = np.concatenate([np.clip(unbounded, low, high), offsets + scales * z[size:]])
    along = np.zeros((len(u), len(z)))
    along[:size, :size] = material.root * ((unbounded > low) & (unbounded < high))[:, None]
    along[size:, size:] = np.diag(scales)
    space = _with_nuisances(material.space, nuisances)
    values, jacobian = derivatives(space, u[None], geometries, geometries.channels)
    return values[0], jacobian[0] @ along


def _nuisances(gain: bool, angle: float | None) -> list[str]:
    """Kinds of what the instrument adds, in the order of their places in z."""
    return (["gain"] if gain else []) + ([] if angle is None else ["angle"])


def _with_nuisances(space: Space, kinds: Sequence[str]) -> Space:
    return replace(
        space,
        free=(*space.free, *(KINDS[kind] for kind in kinds)),
        lower=np.append(space.lower, [KINDS[kind].lower for kind in kinds]),
        upper=np.append(space.upper, [KINDS[kind].upper for kind in kinds]),
        terms=(*space.terms, *(Term(kind, nuisance=True) for kind in kinds)),
    )


def _alike(materials: Sequence[Material]) -> list[list[int]]:
    """Numbers of the materials whose models are one kernel."""
    groups: dict[Any, list[int]] = {}
    for number, material in enumerate(materials):
        groups.setdefault(material.form, []).append(number)
    return list(groups.values())


def _best_gains(materials: Sequence[Material], stack: Stack) -> np.ndarray:
    """Logarithm of the gain at which the mean of each material fits the intensities best, shape (B, C)."""
    rows = [c for c, name in enumerate(stack.channels) if not is_ratio(name)]
    weights = 1.0 / stack.std[rows] ** 2
    gains = np.empty((len(stack), len(materials)))
    for c, material in enumerate(materials):
        modelled = _mean_shown(material, stack, [stack.channels[c] for c in rows])
        along = (weights * modelled * stack.values[rows]).sum(axis=(0, 1))
        gains[:, c] = np.maximum(along / (weights * modelled**2).sum(axis=(0, 1)), 1e-12)
    return np.log(gains)


def _mean_shown(material: Material, stack: Stack, channels: Sequence[str]) -> np.ndarray:
    """What the mean specimen shows, shape (C, G, 1) where all measurements share their geometries, else (C, G, B)."""
    import drjit as dr

    backend = get_backend()
    Float, UInt32 = backend.Float, backend.UInt32
    points, width = stack.theta_i.shape
    lane = dr.arange(UInt32, points * width)
    point = lane // dr.opaque(UInt32, width)
    u = [dr.opaque(Float, float(x)) for x in material.mean]
    number = lane - point * dr.opaque(UInt32, width)
    values, _ = signals_of(material.space, stack)(u, number, point, channels)
    arrays = [Float(value) + dr.zeros(Float, points * width) for value in values]
    dr.eval(arrays)
    return np.stack([array.numpy().reshape(points, width) for array in arrays])


def _of_one_model(
    materials: Sequence[Material],
    stack: Stack,
    start_gain: np.ndarray | None,
    centre_gain: np.ndarray | None,
    angle: float | None,
    accuracy: str | None,
    max_iterations: int,
) -> Solution:
    """Posterior modes, lane b C + c for material c and measurement b; unknowns z of the specimen, gain, angle."""
    import drjit as dr

    backend = get_backend()
    Float, UInt32 = backend.Float, backend.UInt32
    batch, count = len(stack), len(materials)
    space = materials[0].space
    size = len(space.free)
    nuisances = _nuisances(start_gain is not None, angle)
    space = _with_nuisances(space, nuisances)
    misfit = misfits(space, stack, accuracy, Float)
    low, high = materials[0].space.box
    means = [backend.upload(Float, np.array([m.mean[i] for m in materials])) for i in range(size)]
    roots = {
        (i, j): backend.upload(Float, np.array([m.root[i, j] for m in materials]))
        for i in range(size)
        for j in range(i + 1)
    }
    bounds = [(dr.opaque(Float, a), dr.opaque(Float, b)) for a, b in zip(low, high, strict=True)]
    centre = None
    if start_gain is not None:
        centre = backend.upload(Float, centre_gain)
    spread_angle = None if angle is None else dr.opaque(Float, angle)
    kinds = dr.opaque(UInt32, count)

    def function(z: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
        number = lane // kinds
        kind = lane - number * kinds
        u = []
        for i in range(size):
            value = dr.gather(Float, means[i], kind)
            for j in range(i + 1):
                value = dr.fma(dr.gather(Float, roots[i, j], kind), z[j], value)
            u.append(dr.clip(value, *bounds[i]))
        rest = z[size:]
        if centre is not None:
            u.append(dr.fma(GAIN_SPREAD, rest.pop(0), dr.gather(Float, centre, number)))
        if spread_angle is not None:
            u.append(spread_angle * rest.pop(0))
        return misfit(u, number, point)

    def penalty(z: list[Any]) -> list[tuple[int, Any, Any]]:
        return [(i, value, 1.0) for i, value in enumerate(z)]

    unknowns = size + len(nuisances)
    start = np.zeros((batch * count, unknowns))
    if start_gain is not None:
        assert centre_gain is not None
        start[:, size] = ((start_gain - centre_gain[:, None]) / GAIN_SPREAD).ravel()
    problem = Residuals(function, stack.points, penalty)
    limit = np.full(unknowns, REACH)
    solution = solve(problem, start, -limit, limit, max_iterations=max_iterations, tolerance=1e-6)
    far = (np.abs(solution.u[:, :size]) > FAR).any(axis=1)
    if far.any():
        solution = _from_nearby(problem, solution, start, far, limit, max_iterations)
    if not np.isfinite(solution.cost).all():
        raise FitError("the likelihood of a material is not finite: check the data's values and the library")
    return solution


def _from_nearby(
    problem: Residuals,
    found: Solution,
    start: np.ndarray,
    far: np.ndarray,
    limit: np.ndarray,
    max_iterations: int,
) -> Solution:
    """The far lanes searched again, first among likely specimens and from their best one on; the better end counts.

    A first long step past a lobe can end where nothing is left of it.
    """
    begin, reach = np.where(far[:, None], start, found.u), np.where(far, NEAR, 0.0)[:, None]
    begin = solve(
        problem, begin, begin - reach, begin + reach, max_iterations=max_iterations, tolerance=1e-6
    ).u
    low, high = np.where(far[:, None], -limit, begin), np.where(far[:, None], limit, begin)
    again = solve(problem, begin, low, high, max_iterations=max_iterations, tolerance=1e-6)
    better = far & (again.cost < found.cost)

    def chosen(name: str) -> np.ndarray:
        old, new = getattr(found, name), getattr(again, name)
        values: np.ndarray = np.where(better.reshape(-1, *[1] * (old.ndim - 1)), new, old)
        return values

    return Solution(*(chosen(f.name) for f in fields(Solution)))
