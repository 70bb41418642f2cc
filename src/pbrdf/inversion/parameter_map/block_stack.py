"""What was measured at the pixels of a block of an image, as arrays over geometries and pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.alignment import in_stokes_order
from pbrdf.data.schema import COVARIANCE, DIMENSION, STOKES_AXES, VARIABLES, std_name
from pbrdf.errors import DataError, FitError
from pbrdf.inversion.noise import Noise
from pbrdf.inversion.stack import Stack

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ANGLES", "MEASURED", "stack_of_block"]

ANGLES = ("theta_i", "theta_r", "phi")
#: Variables that say what was measured, and how exactly.
MEASURED = {*VARIABLES, *map(std_name, VARIABLES), COVARIANCE}


def stack_of_block(
    block: xr.Dataset,
    dims: Sequence[str],
    *,
    noise: Noise | None = None,
    objective: str = "stokes",
    covariance: tuple[Sequence[str], np.ndarray] | None = None,
) -> Stack | None:
    """Read a block; its pixels are the data sets of the stack, in the order of ``dims``.

    Parameters
    ----------
    block
        Variables of :mod:`pbrdf.data.schema` over ``geometry`` and ``dims`` in any order, angles over the image too or
        not. Stokes components are found by their labels.
    dims
        Dimensions of the image.
    noise, objective, covariance
        See :meth:`Stack.from_columns`.

    Returns
    -------
    Stack or None
        None where nothing was measured.

    Raises
    ------
    DataError
        If angles that all pixels share are no directions above the horizon, or Stokes components have other labels.
    FitError
        As :meth:`Stack.from_columns`.
    """
    block = in_stokes_order(block)
    shape = tuple(block.sizes[d] for d in dims)
    angles = {name: _columns(block[name].variable, dims, shape, shared=True) for name in ANGLES}
    for name in ANGLES[:2]:
        shared = angles[name]
        if shared.shape[1] == 1 and not ((shared >= 0.0) & (shared < 0.5 * np.pi)).all():
            raise DataError(
                f"{name} of a geometry that all pixels share is not in [0°, 90°): give radians, and leave the "
                "geometry out where there is no direction"
            )
    wide = max(values.shape[1] for values in angles.values())
    if wide > 1:
        angles = {n: np.broadcast_to(v, (len(v), wide)) for n, v in angles.items()}
    columns = {
        name: _columns(block[name].variable, dims, shape)
        for name in map(str, block.data_vars)
        if name in MEASURED
    }
    try:
        return Stack.from_columns(
            columns,
            angles,
            block.attrs["quantity"],
            block.attrs["illumination"],
            noise=noise,
            objective=objective,
            covariance=covariance,
            group=block["group"].values if "group" in block.coords else None,
            wavelength=block["wavelength"].values if "wavelength" in block.coords else None,
        )
    except FitError:
        if any(np.isfinite(columns[name]).any() for name in columns if name in VARIABLES):
            raise
        return None


def _columns(
    variable: xr.Variable, dims: Sequence[str], shape: tuple[int, ...], *, shared: bool = False
) -> np.ndarray:
    """Values of a variable with the geometries first and the pixels last, shape (…, G, B).

    With ``shared``, (G, 1) where all pixels share them.
    """
    here = [d for d in dims if d in variable.dims]
    front = [d for d in STOKES_AXES if d in variable.dims]
    values = np.asarray(variable.transpose(*front, DIMENSION, *here).values)
    head = values.shape[: values.ndim - len(here)]
    if shared and not here:
        return values[..., None]
    if len(here) < len(dims):
        sizes = [n if d in here else 1 for d, n in zip(dims, shape, strict=True)]
        values = np.broadcast_to(values.reshape(*head, *sizes), (*head, *shape))
    return values.reshape(*head, -1)
