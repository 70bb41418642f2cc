"""What of a model a file for another program can hold: finite numbers, and no intensity below 0.

Such files have no place for what a model may give outside of physics. Mitsuba's ``measured_polarized`` turns a cell
that is not finite, and its neighbours, black, and lifts an intensity below 0 to 0 while the polarisation stays; MERL's
readers take a value below 0 for a cell without one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.errors import ModelError
from pbrdf.models import Model

__all__ = ["DARK", "Storable", "darkest", "require_finite", "storable"]

#: Where a model is darker than this share of its specular peak, its errors are counted against that.
DARK = 1e-6

_SINGLE = np.finfo(np.float32)


class Storable(NamedTuple):
    """Values that a file can hold.

    Attributes
    ----------
    values
        The model's, 1/sr; 0 in all elements where f00 is not above 0.
    below
        Where f00 was below 0, by no more than rounding; shape of the geometry.
    """

    values: NDArray[np.float64]
    below: NDArray[np.bool_]


def darkest(model: Model) -> float:
    """The least f00 of a model that counts, 1/sr: :data:`DARK` times that in the mirror direction of 30°, above 0."""
    peak = float(model.mueller(math.radians(30.0), math.radians(30.0), 0.0)[0, 0])
    least = float(_SINGLE.tiny)
    return max(DARK * peak, least) if peak > 0.0 else least


def require_finite(values: NDArray[Any], model: Model, *geometry: ArrayLike) -> None:
    """Refuse values that are not finite in single precision.

    Parameters
    ----------
    values
        Mueller matrices, shape (..., 4, 4), or intensities as (..., 1, 1).
    model
        Where they come from.
    geometry
        θ_i, θ_r and φ in radians; they broadcast to (...).

    Raises
    ------
    ModelError
        Names model, geometry and value.
    """
    _refuse(~(np.abs(values) <= _SINGLE.max), values, model, geometry, "is not a number that a file can hold")


def storable(values: NDArray[np.float64], model: Model, *geometry: ArrayLike) -> Storable:
    """Values of a model as a file can hold them.

    An f00 below 0 that :func:`darkest` hides is rounding: 0 is written in all elements, so that no polarisation is
    left without intensity.

    Parameters
    ----------
    values, model, geometry
        See :func:`require_finite`.

    Raises
    ------
    ModelError
        If a value is not finite, or a matrix has no intensity but elements that count. Names model, geometry and value.
    """
    require_finite(values, model, *geometry)
    f00 = values[..., :1, :1]
    dark = f00 < _SINGLE.tiny
    if not dark.any():
        return Storable(values, np.zeros(values.shape[:-2], dtype=bool))
    counts = np.abs(values).max((-2, -1), keepdims=True) > darkest(model)
    _refuse(
        dark & counts,
        np.broadcast_to(f00, values.shape),
        model,
        geometry,
        "is no intensity: it must be above 0",
    )
    return Storable(np.where(dark, 0.0, values), (f00 < 0.0)[..., 0, 0])


def _refuse(
    wrong: NDArray[np.bool_],
    values: NDArray[Any],
    model: Model,
    geometry: tuple[ArrayLike, ...],
    words: str,
) -> None:
    """Raise for the first matrix with a wrong element."""
    if not wrong.any():
        return
    *where, row, column = np.argwhere(np.broadcast_to(wrong, values.shape))[0].tolist()
    angles = (np.broadcast_to(np.rad2deg(a), values.shape[:-2])[tuple(where)] for a in geometry)
    named = ", ".join(
        f"{name} = {angle:.5g}°" for name, angle in zip(("θ_i", "θ_r", "φ"), angles, strict=True)
    )
    raise ModelError(
        f"{model!r}: f{row}{column} at {named} is {values[(*where, row, column)]:.4g} 1/sr, which {words}; nothing is "
        "written"
    )
