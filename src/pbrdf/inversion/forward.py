"""What an instrument would measure: the model, seen through the nuisance terms, as channels of a data set.

Written over generic Dr.Jit floats: the same function predicts values and gives the fit its derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr

from pbrdf.models.arrays import is_zero, weighted_sum
from pbrdf.models.base import Model
from pbrdf.models.evaluation import horizon_guard
from pbrdf.models.extended_source import kernel_under_disc
from pbrdf.optics.geometry import geometry_from_angles

__all__ = ["channel_values", "measured_mueller"]

#: What is no larger than this is no light: single precision holds its reciprocal.
_DARKEST = 1e-30


def measured_mueller(
    model: Model,
    values: Mapping[str, Any],
    nuisances: Mapping[str, Any],
    theta_i: Any,
    theta_r: Any,
    phi: Any,
) -> tuple[list[list[Any]], Any]:
    """Mueller matrix that the instrument sees, without gain and dark offset.

    Parameters
    ----------
    model
        Whose kernel and options are used.
    values
        Parameters of the model by name.
    nuisances
        Values of ``angle`` and ``source`` (radians) where the fit has them.
    theta_i, theta_r, phi
        Nominal angles in radians.

    Returns
    -------
    matrix, alive
        Nested lists of floats, 0 at and below the horizon; and everything else that was traced, to be kept
        until derivatives have been propagated.
    """
    if "angle" in nuisances:
        # in the plane of incidence: θ_r with the sign of cosφ, both angles turn against each other
        signed = theta_r * dr.sign(dr.cos(phi)) - nuisances["angle"]
        theta_i = theta_i + nuisances["angle"]
        # beyond the normal the source would change sides; the turn of both azimuths is one half-turn of φ
        flip = (signed < 0.0) ^ (theta_i < 0.0)
        theta_r, theta_i = dr.abs(signed), dr.abs(theta_i)
        phi = dr.select(flip, math.pi, 0.0)
    theta_i, theta_r, visible = horizon_guard(theta_i, theta_r)
    geometry = geometry_from_angles(theta_i, theta_r, phi)
    if "source" not in nuisances:
        f = model.kernel(geometry, values, "total")
        alive: Any = f
    else:
        f, alive = kernel_under_disc(model, geometry, values, nuisances["source"])
    return [[_masked(visible, x) for x in row] for row in f], alive


def _masked(visible: Any, value: Any) -> Any:
    return 0.0 if is_zero(value) else dr.select(visible, value, 0.0)


def channel_values(
    f: Any, channels: Sequence[str], incident: Sequence[float], gain: Any = None, dark: Any = None
) -> list[Any]:
    """The channels of a data set from a Mueller matrix.

    Parameters
    ----------
    f
        Mueller matrix over Dr.Jit floats.
    channels
        ``I``, ``Q``, ``U``, ``V``, ``dolp``, ``Q_over_I`` …, ``m00`` … ``m33`` or ``m01_over_m00`` … A ratio is 0
        where the model is dark.
    incident
        Stokes vector of the source.
    gain, dark
        Factor of everything, and offset of the intensity (of ``m00``); None for neither.
    """

    def stokes(i: int) -> Any:
        total = weighted_sum(f[i], incident)
        total = total if gain is None else total * gain
        return total + dark if i == 0 and dark is not None else total

    def element(name: str) -> Any:
        value = f[int(name[1])][int(name[2])]
        value = value if gain is None else value * gain
        return value + dark if name == "m00" and dark is not None else value

    values = []
    for name in channels:
        part, over, whole = name.partition("_over_")
        if over:
            of = element if whole == "m00" else lambda name: stokes("IQUV".index(name))
            values.append(_ratio(of(part), of(whole)))
        elif name == "dolp":
            # the tiny offset keeps the derivative finite where Q = U = 0
            values.append(dr.sqrt(dr.square(stokes(1)) + dr.square(stokes(2)) + 1e-24) / stokes(0))
        elif name.startswith("m"):
            values.append(element(name))
        else:
            values.append(stokes("IQUV".index(name)))
    return values


def _ratio(part: Any, whole: Any) -> Any:
    """part / whole with finite derivatives, 0 where the whole is 0."""
    if is_zero(part):
        return 0.0
    lit = dr.abs(whole) > _DARKEST
    return dr.select(lit, part, 0.0) / dr.select(lit, whole, 1.0)
