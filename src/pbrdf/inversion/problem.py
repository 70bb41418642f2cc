"""A model and observations as a least-squares problem: which parameters are free, and the residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import FitError
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.solver import Residuals
from pbrdf.models.base import Model
from pbrdf.models.evaluation import kernel_from_angles
from pbrdf.models.parameters import Parameter

__all__ = ["Space", "residuals"]


@dataclass(frozen=True)
class Space:
    """The free parameters of a fit, and the way between them and the solver's unknowns.

    The unknown of a logarithmic parameter is its logarithm, else the parameter itself.

    Attributes
    ----------
    model
        Class of the model.
    options
        Options of the model.
    free
        The free parameters, in the model's order.
    fixed
        Values of all others by name.
    lower, upper
        Bounds of the free parameters, in their own units, shape (P,).
    """

    model: type[Model]
    options: Mapping[str, str]
    free: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    lower: np.ndarray
    upper: np.ndarray

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
        return result

    def to_parameters(self, unknowns: np.ndarray) -> np.ndarray:
        """The solver's unknowns (..., P) to parameters."""
        result = np.array(unknowns, dtype=float)
        for i, p in enumerate(self.free):
            if p.logarithmic:
                result[..., i] = np.exp(result[..., i])
        return result

    def derivative(self, values: np.ndarray) -> np.ndarray:
        """d parameter / d unknown at the parameters (..., P)."""
        result = np.ones_like(values)
        for i, p in enumerate(self.free):
            if p.logarithmic:
                result[..., i] = values[..., i]
        return result

    def build(self, values: Sequence[float] | np.ndarray) -> Model:
        """The model with the free parameters set to ``values``."""
        named = dict(zip(self.names, (float(v) for v in values), strict=True))
        return self.model.from_values({**self.fixed, **named}, **self.options)


def residuals(
    space: Space, data: Sequence[Observations], starts: int = 1, accuracy: str | None = None
) -> Residuals:
    """Weighted residuals (model − measured)/std of several data sets of the same form.

    Lane number l belongs to data set l // starts; every lane runs over all geometries of its data set.

    Parameters
    ----------
    space
        Free and fixed parameters.
    data
        Data sets with the same channels, number of geometries and illumination; angles may differ.
    starts
        Number of lanes for each data set.
    accuracy
        Accuracy of the model, if not that of the space's options.

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
    Float, UInt32 = backend.Float, backend.UInt32
    points = first.values.shape[1]
    same_angles = all(
        np.array_equal(getattr(o, name), getattr(first, name))
        for o in data[1:]
        for name in ("theta_i", "theta_r", "phi")
    )

    def upload(arrays: list[np.ndarray]) -> Any:
        return backend.upload(Float, np.concatenate(arrays))

    angle_sets = data[:1] if same_angles else data
    angles = [upload([getattr(o, name) for o in angle_sets]) for name in ("theta_i", "theta_r", "phi")]
    measured = [upload([o.values[c] for o in data]) for c in range(len(first.channels))]
    weights = [upload([o.weights[c] for o in data]) for c in range(len(first.channels))]
    fixed = {name: dr.opaque(Float, value) for name, value in space.fixed.items()}
    dielectric = space.fixed.get("kappa") == 0.0
    model = space.build(space.lower)  # only its kernel and options are used
    if accuracy is not None:
        model = model.replace(accuracy=accuracy)
    incident = first.illumination
    divisor = dr.opaque(UInt32, starts)
    stride = dr.opaque(UInt32, points)
    angle_stride = dr.opaque(UInt32, 0 if same_angles else points)

    def function(u: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
        values: dict[str, Any] = dict(fixed)
        for p, unknown in zip(space.free, u, strict=True):
            values[p.name] = dr.exp(unknown) if p.logarithmic else unknown
        if dielectric:
            values["kappa"] = None
        number = lane // divisor
        at = number * angle_stride + point
        theta_i, theta_r, phi = (dr.gather(Float, a, at) for a in angles)
        f = kernel_from_angles(model, theta_i, theta_r, phi, values, "total")
        modelled = channel_values(f, first.channels, incident)
        at = number * stride + point
        weighted = [
            (m - dr.gather(Float, y, at)) * dr.gather(Float, w, at)
            for m, y, w in zip(modelled, measured, weights, strict=True)
        ]
        return weighted, f

    return Residuals(function, points)


def channel_values(f: Any, channels: Sequence[str], incident: Sequence[float]) -> list[Any]:
    """The channels of :class:`Observations` from a Mueller matrix over Dr.Jit floats."""
    import drjit as dr

    def stokes(i: int) -> Any:
        total: Any = 0.0
        for j in range(4):
            if incident[j] != 0.0 and not (isinstance(f[i][j], float) and f[i][j] == 0.0):
                total = total + f[i][j] * incident[j]
        return total

    values = []
    for name in channels:
        if name.startswith("m"):
            values.append(f[int(name[1])][int(name[2])])
        elif name == "dolp":
            # the tiny offset keeps the derivative finite where Q = U = 0
            values.append(dr.sqrt(dr.square(stokes(1)) + dr.square(stokes(2)) + 1e-24) / stokes(0))
        else:
            values.append(stokes("IQUV".index(name)))
    return values


def search_box(space: Space) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the solver's unknowns, shape (P,) each."""
    return space.to_unknowns(space.lower), space.to_unknowns(space.upper)


def is_finite_box(lower: float, upper: float) -> bool:
    """Whether two bounds are finite and in order."""
    return math.isfinite(lower) and math.isfinite(upper) and lower < upper
