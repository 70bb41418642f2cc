"""What an instrument would measure: the model, seen through the nuisance terms, as channels of a data set.

Written over generic Dr.Jit floats: the same function predicts values and gives the fit its derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr
import numpy as np

from pbrdf.models.base import Model
from pbrdf.models.evaluation import horizon_guard, is_zero, weighted_sum
from pbrdf.optics.geometry import Geometry, dot, geometry_from_angles

__all__ = ["channel_values", "measured_mueller"]


def _disc_rule(radii: int, turns: int) -> tuple[list[float], list[float], list[float]]:
    """Points and weights of a uniform average over the unit disc: Gauss in r², even in angle."""
    nodes, weights = np.polynomial.legendre.leggauss(radii)
    x, y, w = [], [], []
    for k in range(radii):
        r = math.sqrt(0.5 * (1.0 + nodes[k]))
        for j in range(turns):
            turn = 2.0 * math.pi * (j + 0.5 * (k % 2)) / turns
            x.append(r * math.cos(turn))
            y.append(r * math.sin(turn))
            w.append(0.5 * float(weights[k]) / turns)
    return x, y, w


_DISC = _disc_rule(6, 12)


def measured_mueller(
    model: Model, roles: Mapping[str, Any], theta_i: Any, theta_r: Any, phi: Any
) -> tuple[list[list[Any]], Any]:
    """Mueller matrix that the instrument sees, without gain and dark offset.

    Parameters
    ----------
    model
        Whose kernel and options are used.
    roles
        Values of the model's parameters, and of ``angle`` and ``source`` (radians) where the fit has them.
    theta_i, theta_r, phi
        Nominal angles in radians.

    Returns
    -------
    matrix, alive
        Nested lists of floats, 0 at and below the horizon; and everything else that was traced, to be kept
        until derivatives have been propagated.
    """
    if "angle" in roles:
        # in the plane of incidence: θ_r with the sign of cosφ, both angles turn against each other
        signed = theta_r * dr.sign(dr.cos(phi)) - roles["angle"]
        theta_i = theta_i + roles["angle"]
        # beyond the normal the source would change sides; the turn of both azimuths is one half-turn of φ
        flip = (signed < 0.0) ^ (theta_i < 0.0)
        theta_r, theta_i = dr.abs(signed), dr.abs(theta_i)
        phi = dr.select(flip, math.pi, 0.0)
    theta_i, theta_r, visible = horizon_guard(theta_i, theta_r)
    geometry = geometry_from_angles(theta_i, theta_r, phi)
    if "source" not in roles:
        f = model.kernel(geometry, roles, "total")
        alive: Any = f
    else:
        diffuse = model.kernel(geometry, roles, "diffuse")
        specular = _averaged_specular(model, geometry, roles)
        f = [
            [a + b for a, b in zip(row, other, strict=True)]
            for row, other in zip(diffuse, specular, strict=True)
        ]
        alive = (diffuse, specular)
    return [[_masked(visible, x) for x in row] for row in f], alive


def _averaged_specular(model: Model, geometry: Geometry, roles: Mapping[str, Any]) -> list[list[Any]]:
    """Specular part averaged over a uniform round source; the frames of the central ray serve for all of it."""
    F = type(roles["source"])
    UInt = dr.uint32_array_t(F)
    columns = [F(column) for column in _DISC]
    count = len(_DISC[0])
    names = [name for name in roles if roles[name] is not None]
    template = model.kernel(geometry, roles, "specular")
    used = [(i, j) for i in range(4) for j in range(4) if not is_zero(template[i][j])]

    def body(k: Any, total: Any, geometry: Geometry, values: Any) -> tuple[Any, ...]:
        named = {**roles, **dict(zip(names, values, strict=True))}
        x, y, weight = (dr.gather(F, column, k) for column in columns)
        f = model.kernel(_turned(geometry, named["source"] * x, named["source"] * y), named, "specular")
        total = [dr.fma(weight, f[i][j], t) for (i, j), t in zip(used, total, strict=True)]
        return k + 1, total, geometry, values

    sums = dr.while_loop(
        (UInt(0), [dr.zeros(F, 1) for _ in used], geometry, [roles[name] for name in names]),
        lambda k, *_: k < count,
        body,
        label="source",
        max_iterations=-1,
    )[1]
    matrix: list[list[Any]] = [[0.0] * 4 for _ in range(4)]
    for (i, j), value in zip(used, sums, strict=True):
        matrix[i][j] = value
    return matrix


def _turned(geometry: Geometry, along_p: Any, along_s: Any) -> Geometry:
    """The geometry with the source displaced by small angles along p_i and s_i."""
    moved = tuple(
        o + along_p * p + along_s * s
        for o, p, s in zip(geometry.omega_i, geometry.p_i, geometry.s_i, strict=True)
    )
    scale = dr.rsqrt(dot(moved, moved))
    # a source that reaches below the horizon lights nothing there; its rays are kept just above
    omega_i = (moved[0] * scale, moved[1] * scale, dr.maximum(moved[2] * scale, 1e-3))
    h = tuple(a + b for a, b in zip(omega_i, geometry.omega_r, strict=True))
    inverse = dr.rsqrt(dot(h, h))
    facet = tuple(c * inverse for c in h)
    sin_i = dr.sqrt(dr.maximum(1.0 - dr.square(omega_i[2]), 1e-12))
    return geometry._replace(omega_i=omega_i, sin_i=sin_i, facet=facet, cos_beta=dot(omega_i, facet))


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
        ``I``, ``Q``, ``U``, ``V``, ``dolp`` or ``m00`` … ``m33``.
    incident
        Stokes vector of the source.
    gain, dark
        Factor of everything, and offset of the intensity (of ``m00``); None for neither.
    """

    def stokes(i: int) -> Any:
        total = weighted_sum(f[i], incident)
        total = total if gain is None else total * gain
        return total + dark if i == 0 and dark is not None else total

    values = []
    for name in channels:
        if name == "dolp":
            # the tiny offset keeps the derivative finite where Q = U = 0
            values.append(dr.sqrt(dr.square(stokes(1)) + dr.square(stokes(2)) + 1e-24) / stokes(0))
        elif name.startswith("m"):
            value = f[int(name[1])][int(name[2])]
            value = value if gain is None else value * gain
            values.append(value + dark if name == "m00" and dark is not None else value)
        else:
            values.append(stokes("IQUV".index(name)))
    return values
