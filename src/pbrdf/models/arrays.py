"""What kind of array a user gave: Dr.Jit arrays told from others without importing Dr.Jit, zeros by structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

__all__ = ["Matrix", "drjit_to_numpy", "is_drjit", "is_symbolic", "is_zero", "to_numpy", "weighted_sum"]

#: A Mueller matrix over Dr.Jit floats; elements that are zero by structure are the Python number 0.
Matrix = list[list[Any]]


def is_drjit(value: Any) -> bool:
    """Whether a value is a Dr.Jit array (without importing Dr.Jit)."""
    return type(value).__module__.startswith("drjit")


def is_symbolic(value: Any) -> bool:
    """Whether a Dr.Jit array is inside a symbolic loop or call, so that its content cannot be looked at."""
    import drjit as dr

    if dr.depth_v(value) > 1:
        return any(is_symbolic(v) for v in value)
    array = value.array if dr.is_tensor_v(value) else value
    return dr.is_jit_v(array) and array.state == dr.VarState.Symbolic


def drjit_to_numpy(value: Any) -> np.ndarray:
    """Content of a Dr.Jit array or tensor as a float64 NumPy array; a single entry gives a scalar."""
    import drjit as dr

    array = np.asarray(dr.detach(value).numpy(), dtype=float)
    return array.reshape(()) if array.size == 1 and array.ndim == 1 else array


def to_numpy(value: Any) -> np.ndarray | None:
    """Content of any array, or None for a symbolic Dr.Jit array."""
    if is_drjit(value):
        return None if is_symbolic(value) else drjit_to_numpy(value)
    return np.asarray(value, dtype=float)


def is_zero(value: Any) -> bool:
    """Whether a matrix element is the Python number 0: zero by structure."""
    return isinstance(value, float) and value == 0.0


def weighted_sum(row: Sequence[Any], weights: Sequence[float]) -> Any:
    """Σ row·weights over Dr.Jit floats; what is zero by structure is left out of the kernel."""
    total: Any = 0.0
    for value, weight in zip(row, weights, strict=True):
        if weight != 0.0 and not is_zero(value):
            total = total + (value if weight == 1.0 else value * weight)
    return total
