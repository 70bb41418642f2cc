"""The edge between user arrays (scalars, NumPy, xarray, Dr.Jit) and the models' kernels.

Angles and parameters are checked and broadcast here, sent to the Dr.Jit backend in chunks, and the results
come back as the kind of array that went in. Formulas are nowhere in this file.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from pbrdf.backend import Backend, exact_reciprocals, get_backend
from pbrdf.errors import ModelError
from pbrdf.models.arrays import Matrix, is_drjit, is_zero, to_numpy, weighted_sum
from pbrdf.models.parameters import Parameter
from pbrdf.optics.geometry import Geometry, geometry_from_angles
from pbrdf.optics.phases import less_whole_turns
from pbrdf.optics.stokes import STOKES

__all__ = [
    "CHUNK",
    "Evaluable",
    "brdf",
    "check_angles",
    "check_incident",
    "horizon_guard",
    "mueller",
    "stokes",
]

#: Directions evaluated at a time, at most: bounds the memory (16 float64 each) and keeps all threads busy.
CHUNK = 1 << 20
#: Cosines up to this count as at or below the horizon, where the BRDF is 0.
_HORIZON = 1e-12
#: Azimuths beyond this many radians are brought back to one turn, as sines of large numbers are not exact in Dr.Jit.
_MANY_TURNS = 1e3
#: π/2 in single precision, the larger of the two numbers that stand for it.
_RIGHT_ANGLE = float(np.float32(0.5 * math.pi))


class Evaluable(Protocol):
    """What is needed of a :class:`~pbrdf.models.base.Model` to evaluate it."""

    @property
    def parameters(self) -> tuple[Parameter, ...]: ...

    @property
    def values(self) -> Mapping[str, Any]: ...

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix: ...

    def lane_groups(
        self, scalars: Mapping[str, Any], floats: Mapping[str, Any], size: int, part: str
    ) -> Sequence[tuple[Evaluable, Any]]: ...


def kernel_from_angles(model: Evaluable, theta_i: Any, theta_r: Any, phi: Any, values: Any, part: str) -> Any:
    """Mueller matrix (nested lists) from angles, 0 at and below the horizon; Dr.Jit floats, unchecked."""
    import drjit as dr

    theta_i, theta_r, visible = horizon_guard(theta_i, theta_r)
    f = model.kernel(geometry_from_angles(theta_i, theta_r, phi), values, part)
    return [[0.0 if is_zero(x) else dr.select(visible, x, 0.0) for x in row] for row in f]


def horizon_guard(theta_i: Any, theta_r: Any) -> tuple[Any, Any, Any]:
    """Zenith angles with those at and below the horizon moved to 0, and which are above it."""
    import drjit as dr

    # cosθ > 1e-12 without a cosine
    limit = 0.5 * math.pi - _HORIZON
    visible = (dr.abs(theta_i) < limit) & (dr.abs(theta_r) < limit)
    return dr.select(visible, theta_i, 0.0), dr.select(visible, theta_r, 0.0), visible


def mueller(model: Evaluable, theta_i: Any, theta_r: Any, phi: Any, part: str) -> Any:
    """See :meth:`pbrdf.models.base.Model.mueller`."""

    def function(matrix: Any) -> list[Any]:
        return [x for row in matrix for x in row]

    return _evaluate(model, theta_i, theta_r, phi, part, function, (4, 4))


def brdf(model: Evaluable, theta_i: Any, theta_r: Any, phi: Any, part: str) -> Any:
    """BRDF for natural light, m00, in 1/sr: what only polarised light needs is not computed. Arrays as of `mueller`."""
    return _evaluate(model, theta_i, theta_r, phi, part, lambda matrix: [matrix[0][0]], (1,))[..., 0]


def stokes(model: Evaluable, theta_i: Any, theta_r: Any, phi: Any, incident: Any, part: str) -> Any:
    """See :meth:`pbrdf.models.base.Model.stokes`."""
    if is_drjit(incident) or _depth(incident) > 1:
        return _apply(mueller(model, theta_i, theta_r, phi, part), incident)
    S = check_incident(incident)

    def function(matrix: Any) -> list[Any]:
        return [weighted_sum(row, S) for row in matrix]

    return _evaluate(model, theta_i, theta_r, phi, part, function, (4,))


def check_incident(incident: Any) -> list[float]:
    """Check one incident Stokes vector and return it as four floats.

    Raises
    ------
    ModelError
        If it is not four finite numbers with positive intensity and a degree of polarisation ≤ 1.
    """
    try:
        S = np.asarray(incident, dtype=float)
    except (TypeError, ValueError) as error:
        raise ModelError(f"incident={incident!r} is not a Stokes vector of four numbers") from error
    if S.shape[-1:] != (4,):
        raise ModelError(
            f"incident has shape {S.shape}: a Stokes vector has four numbers in its last dimension"
        )
    polarised = np.sqrt((S[..., 1:] ** 2).sum(-1))
    bad = ~(np.isfinite(S).all(-1) & (S[..., 0] > 0.0) & (polarised <= S[..., 0] * (1.0 + 1e-9)))
    if bad.any():
        raise ModelError(
            f"incident={incident!r} is not the Stokes vector of any light: it must be finite, I > 0 and "
            "√(Q² + U² + V²) ≤ I"
        )
    found: list[float] = S.tolist()
    return found


def _depth(incident: Any) -> int:
    """Number of dimensions, 1 for what is no array at all (the check of the numbers then says so)."""
    try:
        return np.ndim(incident)
    except ValueError:  # ragged
        return 1


def _apply(matrix: Any, incident: Any) -> Any:
    """Multiply Mueller matrices with an array of incident Stokes vectors."""
    import drjit as dr

    if is_drjit(matrix):
        if dr.is_tensor_v(matrix) or not is_drjit(incident):
            raise ModelError(
                "with Dr.Jit angles, give the incident Stokes vector as four plain numbers or as an Array4f; with "
                "tensors as four plain numbers"
            )
        return matrix @ incident
    check_incident(incident)
    if type(matrix).__module__.startswith("xarray"):
        import xarray as xr

        if not isinstance(incident, xr.DataArray):
            raise ModelError(
                "with xarray angles, give arrays of incident light as a DataArray over stokes_in"
            )
        return xr.dot(matrix, incident, dim="stokes_in")
    try:
        return np.einsum("...ij,...j->...i", matrix, np.asarray(incident, dtype=float))
    except ValueError:
        raise ModelError(
            f"incident of shape {np.shape(incident)} does not broadcast against Mueller matrices of shape "
            f"{matrix.shape}"
        ) from None


def _evaluate(
    model: Evaluable,
    theta_i: Any,
    theta_r: Any,
    phi: Any,
    part: str,
    function: Callable[[Any], list[Any]],
    shape: tuple[int, ...],
) -> Any:
    angles = {"theta_i": theta_i, "theta_r": theta_r, "phi": phi}
    everything = [*angles.values(), *model.values.values()]
    if any(is_drjit(v) for v in everything):
        return _evaluate_drjit(model, angles, part, function, shape)
    if "xarray" in sys.modules:
        import xarray as xr

        if any(isinstance(v, xr.DataArray) for v in everything):
            return _evaluate_xarray(model, angles, part, function, shape)
    return _evaluate_numpy(model, angles, model.values, part, function, shape)


def check_angles(angles: dict[str, Any]) -> dict[str, np.ndarray]:
    """Check angles in radians and return them as float64 arrays.

    Raises
    ------
    ModelError
        If one is not a finite number or a zenith angle lies outside [0, π/2]; says where and whether it looks
        like degrees.
    """
    checked = {}
    for name, value in angles.items():
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise ModelError(f"{name} is not a number or an array of numbers: {value!r}") from error
        # two passes over the numbers where all is well; no comparison holds with a NaN
        lower, upper = (-_MANY_TURNS, _MANY_TURNS) if name == "phi" else (0.0, _RIGHT_ANGLE)
        if array.size and lower <= array.min() and array.max() <= upper:
            checked[name] = array
            continue
        bad = ~np.isfinite(array)
        if name != "phi":
            bad |= (array < 0.0) | (array > _RIGHT_ANGLE)
        if bad.any():
            index = tuple(int(i[0]) for i in np.nonzero(bad)) if array.ndim else ()
            where = f" at index {index}" if array.ndim else ""
            rule = "a finite number" if name == "phi" else "within [0, π/2] radians"
            worst = array[index]
            hint = "; is it in degrees?" if name != "phi" and worst > 0.5 * math.pi else ""
            raise ModelError(f"{name}={worst:g}{where} must be {rule}{hint}")
        if name == "phi" and (many := np.abs(array) > _MANY_TURNS).any():
            array = np.where(many, np.arctan2(np.sin(array), np.cos(array)), array)
        checked[name] = array
    return checked


def _evaluate_numpy(
    model: Evaluable,
    angles: dict[str, Any],
    values: Any,
    part: str,
    function: Callable[[Any], list[Any]],
    shape: tuple[int, ...],
) -> np.ndarray:
    import drjit as dr

    arrays = {**check_angles(angles), **{k: np.asarray(v, dtype=float) for k, v in values.items()}}
    try:
        grid = np.broadcast_shapes(*(a.shape for a in arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{k} {a.shape}" for k, a in arrays.items() if a.ndim)
        raise ModelError(f"angles and parameters do not broadcast against each other: {shapes}") from error
    total = math.prod(grid)
    flat = {k: a.item() if a.size == 1 else _flat(a, grid) for k, a in arrays.items()}
    backend = get_backend()
    width = math.prod(shape)
    result = np.empty((total, width))
    absent = [p.name for p in model.parameters if p.vanishing and not np.any(arrays[p.name])]
    # pieces as long as each other, so that each takes the memory of the one before
    pieces = math.ceil(total / CHUNK)
    for i in range(pieces):
        start, stop = total * i // pieces, total * (i + 1) // pieces
        piece = {k: (v if isinstance(v, float) else v[start:stop]) for k, v in flat.items()}
        inputs = {k: backend.upload(backend.Float, v) for k, v in piece.items() if not isinstance(v, float)}
        out = dr.empty(backend.Float, (stop - start) * width)
        for group, lanes in model.lane_groups(piece, piece | inputs, stop - start, part):
            _launch(group, backend, piece, inputs, lanes, stop - start, absent, part, function, out)
        if total <= CHUNK:
            result = out.numpy().reshape(-1, width)  # Dr.Jit's memory, not a copy
        else:
            result[start:stop] = out.numpy().reshape(-1, width)
        del inputs, out
    return result.reshape(*grid, *shape)


def _flat(array: np.ndarray, grid: tuple[int, ...]) -> Any:
    """What a slice of the flattened grid can be taken from, without a copy of it all."""
    if array.shape == grid and array.flags.c_contiguous:
        return array.ravel()
    return np.broadcast_to(array, grid).flat


def _launch(
    model: Evaluable,
    backend: Backend,
    scalars: dict[str, Any],
    inputs: dict[str, Any],
    lanes: Any,
    size: int,
    absent: Sequence[str],
    part: str,
    function: Callable[[Any], list[Any]],
    out: Any,
) -> None:
    """Evaluate some directions and scatter the results into ``out``."""
    import drjit as dr

    Float, UInt32 = backend.Float, backend.UInt32
    index = dr.arange(UInt32, size) if lanes is None else lanes

    def fetch(name: str) -> Any:
        # scalars are opaque, so that a new value does not mean a new kernel
        return dr.gather(Float, inputs[name], index) if name in inputs else dr.opaque(Float, scalars[name])

    values: dict[str, Any] = {p.name: fetch(p.name) for p in model.parameters}
    values |= dict.fromkeys(absent)
    f = kernel_from_angles(model, fetch("theta_i"), fetch("theta_r"), fetch("phi"), values, part)
    # one packet scatter: several scatters into the same array would each be a kernel of its own
    dr.scatter(out, backend.module.ArrayXf64([Float(x) for x in function(f)]), index)
    dr.eval(out)


def _evaluate_xarray(
    model: Evaluable,
    angles: dict[str, Any],
    part: str,
    function: Callable[[Any], list[Any]],
    shape: tuple[int, ...],
) -> Any:
    import xarray as xr

    named = {**angles, **model.values}
    for name, value in named.items():
        if not isinstance(value, xr.DataArray) and np.ndim(value) > 0:
            raise ModelError(
                f"{name} is a plain array beside xarray arrays: give it dimensions as a DataArray"
            )
    arrays = dict(zip(named, xr.broadcast(*(xr.DataArray(v) for v in named.values())), strict=True))
    template = arrays["theta_i"]
    data = _evaluate_numpy(
        model,
        {k: arrays[k].values for k in angles},
        {k: arrays[k].values if np.ndim(v) else v for k, v in model.values.items()},
        part,
        function,
        shape,
    )
    extra = ["stokes_out", "stokes_in"][: len(shape)]
    result = xr.DataArray(
        data,
        dims=[*template.dims, *extra],
        coords={**template.coords, **{axis: list(STOKES) for axis in extra}},
        name="mueller" if len(shape) == 2 else "stokes",
    )
    result.attrs.update(
        units="1/sr", long_name="BRDF Mueller matrix" if len(shape) == 2 else "Stokes radiance"
    )
    return result


def _evaluate_drjit(
    model: Evaluable,
    angles: dict[str, Any],
    part: str,
    function: Callable[[Any], list[Any]],
    shape: tuple[int, ...],
) -> Any:
    import drjit as dr

    named = {**angles, **model.values}
    given = [v for v in named.values() if is_drjit(v)]
    for name, value in named.items():
        if not is_drjit(value) and np.ndim(value) > 0:
            raise ModelError(f"{name} is not a Dr.Jit array beside others that are: convert it")
    widths = {name: dr.width(v) for name, v in named.items() if is_drjit(v) and not dr.is_tensor_v(v)}
    if len({w for w in widths.values() if w != 1}) > 1:
        raise ModelError(f"Dr.Jit arrays of different widths do not broadcast: {widths}")
    tensors = [v for v in given if dr.is_tensor_v(v)]
    Array = type(tensors[0].array) if tensors else type(given[0])
    single = dr.type_v(Array) == dr.VarType.Float32
    Float: Any = dr.replace_type_t(Array, dr.VarType.Float32 if single else dr.VarType.Float64)
    for name, value in angles.items():
        if (content := to_numpy(value)) is not None:
            check_angles({name: content})
    grid: tuple[int, ...] | None = None
    if tensors:
        grid = np.broadcast_shapes(*(tuple(v.shape) for v in tensors))

    def flatten(value: Any) -> Any:
        if is_drjit(value) and dr.is_tensor_v(value):
            assert grid is not None
            return Float((value + dr.zeros(type(value), grid)).array)
        return Float(value) if is_drjit(value) else dr.opaque(Float, float(value))

    values: dict[str, Any] = {name: flatten(value) for name, value in model.values.items()}
    for p in model.parameters:
        content = to_numpy(model.values[p.name]) if p.vanishing else None
        if content is not None and not content.any() and not dr.grad_enabled(values[p.name]):
            values[p.name] = None
    theta_i, theta_r, phi = (flatten(angles[name]) for name in ("theta_i", "theta_r", "phi"))
    phi = dr.select(dr.abs(phi) > _MANY_TURNS, less_whole_turns(phi), phi)
    with exact_reciprocals(Float):
        f = kernel_from_angles(model, theta_i, theta_r, phi, values, part)
    # an opaque mask keeps each output a variable of its own: with constant angles it could be an inner node of
    # the graph, whose derivative Dr.Jit discards
    always = dr.opaque(dr.mask_t(Float), True)
    outputs = [dr.select(always, Float(x), Float(0.0)) for x in function(f)]
    module, suffix = sys.modules[Float.__module__], "" if single else "64"
    if grid is None:
        if len(shape) == 2:
            Matrix = getattr(module, f"Matrix4f{suffix}")
            return Matrix([[outputs[4 * i + j] for j in range(4)] for i in range(4)])
        return getattr(module, f"Array4f{suffix}")(outputs)
    Tensor: Any = dr.tensor_t(Float)
    size = math.prod(grid)
    flat: Any = dr.zeros(Float, size * len(outputs))
    packets = getattr(module, f"ArrayXf{suffix}")(outputs)
    dr.scatter(flat, packets, dr.arange(dr.uint32_array_t(Float), size))
    return Tensor(flat, (*grid, *shape))
