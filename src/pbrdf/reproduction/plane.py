"""Light reflected in the plane of incidence, for signed angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.models import Model

__all__ = ["in_plane", "offsets", "turned", "zero_crossings"]


def in_plane(model: Model, theta_i: ArrayLike, theta_r: ArrayLike, part: str = "total") -> np.ndarray:
    """Stokes vectors for natural light of unit irradiance, 1/sr.

    Parameters
    ----------
    model
        A model of single parameters.
    theta_i, theta_r
        Signed angles in radians, broadcast against each other: θ_r > 0 on the forward side of a source at θ_i > 0. A
        negative θ_i is a source beyond the normal.
    part
        As in :meth:`pbrdf.models.Model.stokes`.

    Returns
    -------
    ndarray
        Shape (..., 4).
    """
    theta_i, theta_r = np.broadcast_arrays(np.asarray(theta_i, dtype=float), np.asarray(theta_r, dtype=float))
    phi = np.where(np.where(theta_i < 0.0, -theta_r, theta_r) < 0.0, np.pi, 0.0)
    # the total as the sum of its parts: the specular kernel then serves all interpretations
    parts = ("specular", "diffuse") if part == "total" else (part,)
    values: np.ndarray = np.sum(
        [model.stokes(np.abs(theta_i), np.abs(theta_r), phi, part=p) for p in parts], axis=0
    )
    return values


def turned(bistatic: ArrayLike, offset: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Signed θ_i and θ_r when the sample is turned from the mirror direction, radians, shape (positions, offsets).

    The bistatic angle Ψ = θ_i + θ_r of a position stays; a positive offset is right of the peak in the paper's
    figures, where θ_r grows.
    """
    half = 0.5 * np.atleast_1d(np.asarray(bistatic, dtype=float))[:, None]
    return half - np.asarray(offset, dtype=float), half + np.asarray(offset, dtype=float)


def offsets(reach: float, step: float = 0.02) -> np.ndarray:
    """Turns of the sample from −reach to +reach, all in degrees; returned in radians."""
    count = round(reach / step)
    values: np.ndarray = np.deg2rad(np.arange(-count, count + 1) * step)
    return values


def zero_crossings(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Where `y` changes sign along `x`, both of shape (N,), by linear interpolation."""
    left = np.flatnonzero(np.signbit(y[1:]) != np.signbit(y[:-1]))
    values: np.ndarray = x[left] - y[left] * (x[left + 1] - x[left]) / (y[left + 1] - y[left])
    return values
