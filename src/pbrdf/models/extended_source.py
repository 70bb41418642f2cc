"""A model lit by a uniform round source instead of a point: its specular lobe averaged over the disc.

The diffuse part hardly changes over a few degrees and is taken at the disc's centre. Written over generic Dr.Jit
floats, the radius included: a fit finds it with exact derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr
import numpy as np

from pbrdf.backend import get_backend
from pbrdf.models.arrays import is_zero
from pbrdf.models.base import Model
from pbrdf.models.evaluation import check_angles, check_incident, horizon_guard
from pbrdf.optics.geometry import Geometry, dot, geometry_from_angles, mirror_facet

__all__ = ["DISC", "disc_rule", "kernel_under_disc", "stokes_under_disc"]

Rule = tuple[list[float], list[float], list[float]]


def disc_rule(radii: int, turns: int) -> Rule:
    """Points x, y and weights of a uniform average over the unit disc: Gauss in r², even in angle."""
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


#: The rule of fits, where the radius is unknown.
DISC = disc_rule(6, 12)


def kernel_under_disc(
    model: Model, geometry: Geometry, values: Mapping[str, Any], radius: Any, rule: Rule = DISC
) -> tuple[list[list[Any]], Any]:
    """Mueller matrix under a uniform round source about the incident ray.

    Parameters
    ----------
    model
        Whose kernel and options are used.
    geometry, values
        As for :meth:`~pbrdf.models.base.Model.kernel`; the frames of the central ray serve for the whole disc.
    radius
        Angular radius of the source, radians, a Dr.Jit float.
    rule
        Points and weights of the average.

    Returns
    -------
    matrix, alive
        Nested lists of floats; and what else was traced, to be kept until derivatives have been propagated.
    """
    diffuse = model.kernel(geometry, values, "diffuse")
    specular = _averaged_specular(model, geometry, values, radius, rule)
    total = [
        [a + b for a, b in zip(row, other, strict=True)] for row, other in zip(diffuse, specular, strict=True)
    ]
    return total, (diffuse, specular)


def stokes_under_disc(
    model: Model,
    theta_i: np.ndarray,
    theta_r: np.ndarray,
    phi: np.ndarray,
    radius: float,
    incident: Sequence[float] | np.ndarray = (1.0, 0.0, 0.0, 0.0),
) -> np.ndarray:
    """Stokes vector of the reflected radiance for unit irradiance from a round source, 1/sr.

    Parameters
    ----------
    model
        With single numbers as parameters.
    theta_i, theta_r, phi
        Of the disc's centre, radians, shape (G,).
    radius
        Angular radius of the source, radians; 0 is a point.
    incident
        Stokes vector of the irradiance in the (p, s) frame of the central ray, shape (4,) or (G, 4).

    Returns
    -------
    ndarray
        Shape (G, 4).

    Raises
    ------
    ModelError
        As :meth:`Model.stokes <pbrdf.models.base.Model.stokes>`.
    """
    if radius == 0.0:
        return np.asarray(model.stokes(theta_i, theta_r, phi, incident=incident))
    check_incident(incident)
    checked = check_angles({"theta_i": theta_i, "theta_r": theta_r, "phi": phi})
    backend = get_backend()
    Float = backend.Float
    i, r, p = (backend.upload(Float, a) for a in checked.values())
    light = [backend.upload(Float, a) for a in np.broadcast_to(incident, (len(theta_i), 4)).T]
    values: dict[str, Any] = {name: dr.opaque(Float, float(v)) for name, v in model.values.items()}
    values |= {p.name: None for p in model.parameters if p.vanishing and model.values[p.name] == 0.0}
    i, r, visible = horizon_guard(i, r)
    rule = _fine_enough(radius, float(model.lobe_width()))
    f, _ = kernel_under_disc(model, geometry_from_angles(i, r, p), values, dr.opaque(Float, radius), rule)
    rows = [sum((a * b for a, b in zip(row, light, strict=True) if not is_zero(a)), Float(0.0)) for row in f]
    out = [dr.select(visible, row, 0.0) for row in rows]
    dr.eval(out)
    return np.stack([np.broadcast_to(row.numpy(), len(theta_i)) for row in out], axis=-1)


def _fine_enough(radius: float, width: float) -> Rule:
    """A rule whose points are closer than the lobe is wide, twice its slope width for one of the rays."""
    across = radius / (2.0 * width)
    return disc_rule(max(6, math.ceil(3.0 * across) + 4), max(12, math.ceil(8.0 * across) + 8))


def _averaged_specular(
    model: Model, geometry: Geometry, values: Mapping[str, Any], radius: Any, rule: Rule
) -> list[list[Any]]:
    F = type(radius)
    UInt = dr.uint32_array_t(F)
    columns = [F(column) for column in rule]
    # read from memory, not a literal: the number of points is no part of the kernel
    count = dr.gather(UInt, UInt([len(rule[0])]), UInt(0))
    names = [name for name in values if values[name] is not None]
    template = model.kernel(geometry, values, "specular")
    used = [(i, j) for i in range(4) for j in range(4) if not is_zero(template[i][j])]

    def body(k: Any, total: Any, vectors: Any, radius: Any, given: Any) -> tuple[Any, ...]:
        geometry = Geometry(*vectors)
        named = {**values, **dict(zip(names, given, strict=True))}
        x, y, weight = (dr.gather(F, column, k) for column in columns)
        irradiance = total[-1]
        ray, above = _turned(geometry, radius * x, radius * y)
        weight = dr.select(above, weight * ray.cos_i, 0.0)
        f = model.kernel(ray, named, "specular")
        total = [dr.fma(weight, f[i][j], t) for (i, j), t in zip(used, total[:-1], strict=True)]
        return k + 1, [*total, irradiance + weight], vectors, radius, given

    sums = dr.while_loop(
        (
            UInt(0),
            [dr.zeros(F, 1) for _ in (*used, None)],
            tuple(geometry),
            radius,
            [values[name] for name in names],
        ),
        lambda k, *_: k < count,
        body,
        label="source",
        max_iterations=-1,
    )[1]
    matrix: list[list[Any]] = [[0.0] * 4 for _ in range(4)]
    share = dr.rcp(sums[-1])
    for (i, j), value in zip(used, sums[:-1], strict=True):
        matrix[i][j] = value * share
    return matrix


def _turned(geometry: Geometry, along_p: Any, along_s: Any) -> tuple[Geometry, Any]:
    """The geometry with the source displaced by small angles along p_i and s_i, and whether it is above the horizon.

    Where it is not, the geometry is that of the undisplaced source.
    """
    moved = tuple(
        o + along_p * p + along_s * s
        for o, p, s in zip(geometry.omega_i, geometry.p_i, geometry.s_i, strict=True)
    )
    above = moved[2] > 0.0
    scale = dr.rsqrt(dot(moved, moved))
    omega_i = tuple(dr.select(above, m * scale, o) for m, o in zip(moved, geometry.omega_i, strict=True))
    (x, y, z), r = omega_i, geometry.omega_r
    facet, cos_beta = mirror_facet((x + r[0], y + r[1], z + r[2]))
    sin_i = dr.sqrt(dr.maximum(1.0 - dr.square(omega_i[2]), 1e-12))
    turned = geometry._replace(omega_i=omega_i, sin_i=sin_i, facet=facet, cos_beta=cos_beta)
    return turned, above
