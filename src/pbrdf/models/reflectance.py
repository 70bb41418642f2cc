"""How much of the light a surface reflects: from one direction, from all of them, and models scaled to a share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import ModelError
from pbrdf.models.base import Model
from pbrdf.models.evaluation import brdf

__all__ = ["albedo", "directional_hemispherical_reflectance", "with_albedo"]

#: Nodes of the specular integral: radius, and direction; half of the radii lie within MIDDLE widths of the lobe.
RADII, DIRECTIONS, MIDDLE = 128, 96, 3.0
#: Nodes of the diffuse integral: √cosθ_r and azimuth.
ZENITHS, AZIMUTHS = 64, 32
#: Nodes of the integral over the directions of an even sky.
INCIDENCES = 24


def directional_hemispherical_reflectance(model: Model, theta_i: ArrayLike) -> np.ndarray:
    """Share of natural light from one direction that a surface reflects into the hemisphere.

    DHR(θ_i) = ∫ f00 cosθ_r dω_r. The specular part is integrated over all facet slopes, in units of the width of the
    lobe, so that it is resolved whatever its width and θ_i are and its tails are counted; the diffuse part over the
    direction of view, with nodes that crowd towards grazing, where bodies like cosθ_r^(k−1), k < 1, are singular.

    Parameters
    ----------
    model
        A model of single parameters (no maps).
    theta_i
        Zenith angles of the source in radians, within [0, π/2); any shape.

    Returns
    -------
    ndarray
        Dimensionless, of the shape of ``theta_i``. Accurate to 1e-3, and to 1e-6 where horizon and shadowing do not
        cut into the lobe (Gaussian slopes, σ ≤ 0.1 and θ_i ≤ 60°); to a few 1e-3 for unshadowed facets with σ > 0.3.

    Raises
    ------
    ModelError
        If an angle is out of range or the model's parameters are arrays.
    """
    angles = np.asarray(theta_i, dtype=float)
    if not ((angles >= 0.0) & (angles < 0.5 * math.pi)).all():
        raise ModelError(
            "theta_i must be within [0, π/2) radians for a directional-hemispherical reflectance"
        )
    if any(np.ndim(value) for value in model.values.values()):
        raise ModelError(
            "the directional-hemispherical reflectance needs a model of single parameters, no maps"
        )
    flat = angles.ravel()
    values: np.ndarray = (_specular_reflectance(model, flat) + _diffuse_reflectance(model, flat)).reshape(
        angles.shape
    )
    return values


def albedo(model: Model) -> float:
    """Share of the light of an even sky that a surface reflects: 2 ∫ DHR(θ_i) cosθ_i sinθ_i dθ_i.

    Raises
    ------
    ModelError
        If the model's parameters are arrays.
    """
    node, weight = np.polynomial.legendre.leggauss(INCIDENCES)
    # over sin²θ_i, whose differential is 2 cosθ_i sinθ_i dθ_i
    theta_i = np.arcsin(np.sqrt(0.5 * (node + 1.0)))
    return float(directional_hemispherical_reflectance(model, theta_i) @ (0.5 * weight))


def with_albedo(model: Model, share: float) -> Model:
    """The same model on the scale of a scene: its amplitudes such that :func:`albedo` is `share`.

    Parameters
    ----------
    model
        Of single parameters. What its amplitudes do not scale (a coating that reflects by Fresnel's equations alone)
        stays as it is.
    share
        Albedo wanted, above 0 and at most 1.

    Raises
    ------
    ModelError
        If the share is out of range, the model has no amplitude, or what stays as it is reflects more already.
    """
    if not 0.0 < share <= 1.0:
        raise ModelError(f"an albedo of {share:g}: give a share above 0 and at most 1")
    amplitudes = {p.name: model.values[p.name] for p in model.parameters if p.amplitude}
    whole, rest = albedo(model), albedo(model.replace(**dict.fromkeys(amplitudes, 0.0)))
    if not whole > rest:
        raise ModelError(f"{model.name} has no amplitude above 0 that could be scaled to an albedo")
    if share <= rest:
        raise ModelError(
            f"an albedo of {share:g} cannot be had: what no amplitude scales, its coating, reflects {rest:.2g} already"
        )
    factor = (share - rest) / (whole - rest)
    return model.replace(**{name: factor * value for name, value in amplitudes.items()})


def _specular_reflectance(model: Model, theta_i: np.ndarray) -> np.ndarray:
    """∫ f_mf cosθ_r dω_r over the facets m: dω_r = 4 cosβ dω_m, dω_m = cos³θ dx dy of the slopes; shape (N,)."""
    width = float(model.lobe_width())
    node, weight = np.polynomial.legendre.leggauss(RADII)
    # radius = MIDDLE u/(1 − u) reaches all slopes, half of the nodes within MIDDLE widths
    u = 0.5 * (node + 1.0)
    radius = MIDDLE * u / (1.0 - u)
    ring = 0.5 * weight * MIDDLE / (1.0 - u) ** 2 * radius
    # the half plane y > 0, counted twice: f00 is even in φ
    direction = (np.arange(DIRECTIONS) + 0.5) * math.pi / DIRECTIONS
    slope_x = width * radius[:, None] * np.cos(direction)
    slope_y = width * radius[:, None] * np.sin(direction)
    area = width**2 * ring[:, None] * (2.0 * math.pi / DIRECTIONS)
    cos_m = 1.0 / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    m = np.stack([slope_x * cos_m, slope_y * cos_m, cos_m])
    incident = np.stack([-np.sin(theta_i), np.zeros_like(theta_i), np.cos(theta_i)], -1)
    cos_beta = np.einsum("ni,ixy->nxy", incident, m)
    r = 2.0 * cos_beta[:, None] * m - incident[:, :, None, None]
    seen = (cos_beta > 0.0) & (r[:, 2] > 0.0)
    theta_r = np.where(seen, np.arctan2(np.hypot(r[:, 0], r[:, 1]), r[:, 2]), 0.0)
    phi = np.where(seen, np.arctan2(r[:, 1], r[:, 0]), 0.0)
    f = brdf(model, theta_i[:, None, None], theta_r, phi, "specular")
    values: np.ndarray = np.where(seen, f * r[:, 2] * 4.0 * cos_beta * cos_m**3 * area, 0.0).sum((1, 2))
    return values


def _diffuse_reflectance(model: Model, theta_i: np.ndarray) -> np.ndarray:
    """∫ f_vol cosθ_r dω_r with cosθ_r = s², which tames the singularity of cosθ_r^(k−1); shape (N,)."""
    node, weight = np.polynomial.legendre.leggauss(ZENITHS)
    s = 0.5 * (node + 1.0)
    cos_r = s * s
    solid_angle = (0.5 * weight * 2.0 * s)[:, None] * (2.0 * math.pi / AZIMUTHS)  # both halves of the azimuth
    phi = (np.arange(AZIMUTHS) + 0.5) * math.pi / AZIMUTHS
    directions = theta_i[:, None, None], np.arccos(cos_r)[:, None], phi
    # kernels that stand already: that of the specular part, and that of whole matrices
    f = model.mueller(*directions)[..., 0, 0] - brdf(model, *directions, "specular")
    values: np.ndarray = (f * cos_r[:, None] * solid_angle).sum((1, 2))
    return values
