"""Degree, angle and ellipticity of polarisation of Stokes vectors (I, Q, U, V) with Q = I_p − I_s.

Each function takes a Stokes array of any kind and returns the same kind: NumPy arrays and sequences of
shape (..., 4), xarray arrays with a dimension ``stokes_out`` (or ``stokes``), Dr.Jit ``Array4f`` values. Where
I = 0 there is no light and a degree is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

__all__ = ["STOKES", "aolp", "docp", "dolp", "dop", "ellipticity", "stokes_places"]

#: The Stokes parameters in their order.
STOKES = ("I", "Q", "U", "V")


def stokes_places(labels: Iterable[str]) -> list[int] | None:
    """Where I, Q, U and V stand among the labels of an axis, in this order; None if these are other labels."""
    given = list(labels)
    return [given.index(name) for name in STOKES] if sorted(given) == sorted(STOKES) else None


def dolp(stokes: Any) -> Any:
    """Degree of linear polarisation, √(Q² + U²)/I."""
    intensity, q, u, _ = _components(stokes)
    return _ratio(_sqrt(q * q + u * u), intensity)


def docp(stokes: Any) -> Any:
    """Degree of circular polarisation, |V|/I."""
    intensity, _, _, v = _components(stokes)
    return _ratio(abs(v), intensity)


def ellipticity(stokes: Any) -> Any:
    """Ellipticity angle ½ atan2(V, √(Q² + U²)) in radians, within [−π/4, π/4], V > 0 (left circular) positive.

    Its tangent is the ratio of the short to the long axis of the ellipse of the polarised part: natural light added to
    a beam does not change it, nor does a turn of the frame. Without polarisation it is 0.
    """
    _, q, u, v = _components(stokes)
    linear = _sqrt(q * q + u * u)
    if _is_drjit(stokes):
        import drjit as dr

        return 0.5 * dr.atan2(v, linear)
    import numpy as np

    return 0.5 * np.arctan2(v, linear)


def dop(stokes: Any) -> Any:
    """Degree of polarisation, √(Q² + U² + V²)/I."""
    intensity, q, u, v = _components(stokes)
    return _ratio(_sqrt(q * q + u * u + v * v), intensity)


def aolp(stokes: Any) -> Any:
    """Angle of linear polarisation ½ atan2(U, Q) in radians, within (−π/2, π/2], from p towards s.

    Light along s is at π/2 whatever the sign of a U that is zero or rounds to it.
    """
    _, q, u, _ = _components(stokes)
    right = 0.5 * math.pi
    if _is_drjit(stokes):
        import drjit as dr

        angle = 0.5 * dr.atan2(u, q)
        return dr.select(angle <= -right, right, angle)
    import numpy as np

    angle = 0.5 * np.arctan2(u, q, dtype=float)
    # -π/2 alone lies at or below the open end: the other end is the same direction
    return angle + np.pi * (angle <= -right)


def _is_drjit(value: Any) -> bool:
    return type(value).__module__.startswith("drjit")


def _components(stokes: Any) -> tuple[Any, Any, Any, Any]:
    if _is_drjit(stokes):
        import drjit as dr

        if dr.is_tensor_v(stokes):
            return tuple(stokes[..., i] for i in range(4))
        return tuple(stokes[i] for i in range(4))
    dims = getattr(stokes, "dims", ())
    for name in ("stokes_out", "stokes"):
        if name in dims:
            return tuple(stokes.isel({name: i}, drop=True) for i in range(4))
    import numpy as np

    array = np.asarray(stokes, dtype=float)
    if array.shape[-1:] != (4,):
        raise ValueError(
            f"a Stokes array has four numbers in its last dimension, got the shape {array.shape}"
        )
    return array[..., 0], array[..., 1], array[..., 2], array[..., 3]


def _ratio(part: Any, intensity: Any) -> Any:
    if _is_drjit(part):
        return part / intensity
    import numpy as np

    with np.errstate(divide="ignore", invalid="ignore"):
        return part / intensity


def _sqrt(value: Any) -> Any:
    if _is_drjit(value):
        import drjit as dr

        return dr.sqrt(value)
    return value**0.5
