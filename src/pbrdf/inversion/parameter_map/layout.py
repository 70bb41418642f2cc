"""The form of a map of parameters: its variables, what the numbers of status and flags mean, and an empty one.

What stands at a pixel that nobody has come to yet can be no result: NaN, a count of -1, a flag and a status that say
so.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FLAGS", "PENDING", "UNFITTED", "PixelStatus", "empty_map", "template"]

#: Status of a pixel that nobody has come to yet, and what it and the flag of its parameters are called.
PENDING, UNFITTED = -1, "not_yet_fitted"


class PixelStatus(enum.IntEnum):
    """What became of a pixel."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    TOO_FEW_VALUES = 2
    FAILED = 3
    NOT_MEASURED = 4
    MASKED = 5


#: Bits of the flags of a parameter at a pixel.
FLAGS = {"at_lower_bound": 1, "at_upper_bound": 2, "undetermined": 4, UNFITTED: 128}

_ATTRIBUTES: dict[str, dict[str, Any]] = {
    "estimate": {"long_name": "value at the best optimum"},
    "standard_error": {"long_name": "standard error, NaN on a bound, undetermined or not converged"},
    "correlation": {"long_name": "correlation of the estimates", "units": "1"},
    "chi2": {"long_name": "sum of the squared weighted residuals", "units": "1"},
    "degrees_of_freedom": {"long_name": "measured values less the pixel's own free parameters", "units": "1"},
    "optima": {"long_name": "distinct optima that were seen", "units": "1"},
    "starts": {"long_name": "starts that were followed", "units": "1"},
    "status": {
        "long_name": "what became of the pixel",
        "flag_values": np.array([*(s.value for s in PixelStatus), PENDING], dtype=np.int8),
        "flag_meanings": " ".join([*(s.name.lower() for s in PixelStatus), UNFITTED]),
    },
    "flags": {
        "long_name": "what limits a parameter",
        "flag_masks": np.array(list(FLAGS.values()), dtype=np.uint8),
        "flag_meanings": " ".join(FLAGS),
    },
}
#: Type, what stands at a pixel without a value, and at one that nobody has come to yet, of the variables in the order
#: in which they are written: status last.
_FILL: dict[str, tuple[type, Any, Any]] = {
    "estimate": (np.float64, np.nan, np.nan),
    "standard_error": (np.float64, np.nan, np.nan),
    "correlation": (np.float64, np.nan, np.nan),
    "chi2": (np.float64, np.nan, np.nan),
    "degrees_of_freedom": (np.int32, 0, -1),
    "optima": (np.int16, 0, -1),
    "starts": (np.int16, 0, -1),
    "flags": (np.uint8, 0, FLAGS[UNFITTED]),
    "status": (np.int8, PENDING, PENDING),
}
_FRONT = {
    "estimate": ("parameter",),
    "standard_error": ("parameter",),
    "correlation": ("parameter", "other"),
    "flags": ("parameter",),
}


def _variables(parameters: int, correlation: bool) -> dict[str, tuple[int, ...]]:
    """Names of the variables, and the sizes of their dimensions before those of the image."""
    return {
        name: (parameters,) * len(_FRONT.get(name, ()))
        for name in _FILL
        if correlation or name != "correlation"
    }


def empty_map(parameters: int, shape: Sequence[int], correlation: bool) -> dict[str, np.ndarray]:
    """Arrays of a map or a block of one in which no pixel has a value, to be filled.

    Parameters
    ----------
    parameters
        Number of free parameters.
    shape
        Of the image.
    correlation
        Whether there are correlations.
    """
    return {
        name: np.full((*front, *shape), _FILL[name][1], dtype=_FILL[name][0])
        for name, front in _variables(parameters, correlation).items()
    }


def template(
    arrays: Mapping[str, Any], dims: Sequence[str], coords: Mapping[str, Any], attrs: Mapping[str, Any]
) -> xr.Dataset:
    """A map from its arrays.

    Parameters
    ----------
    arrays
        As :func:`empty_map` names them, NumPy's or Dask's.
    dims
        Dimensions of the image.
    coords, attrs
        Of the whole.
    """
    import xarray as xr

    variables = {
        name: xr.Variable((*_FRONT.get(name, ()), *dims), values, dict(_ATTRIBUTES[name]))
        for name, values in arrays.items()
    }
    return xr.Dataset(variables, dict(coords), dict(attrs))


def broadcast_map(parameters: int, shape: Sequence[int], correlation: bool) -> dict[str, np.ndarray]:
    """Arrays of a map that nobody has come to yet, in no memory: one number stands for all."""
    return {
        name: np.broadcast_to(_FILL[name][0](_FILL[name][2]), (*front, *shape))
        for name, front in _variables(parameters, correlation).items()
    }
