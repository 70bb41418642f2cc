"""Stokes vectors from the axes of the instrument into those of the surface."""

from __future__ import annotations

import numpy as np

__all__ = ["to_surface_axes"]


def to_surface_axes(
    stokes: np.ndarray, covariance: np.ndarray, reference_angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Stokes vectors from the instrument's axes into the axes (p, s) of the surface.

    Parameters
    ----------
    stokes, covariance
        Shapes (G, 4) and (G, 4, 4); NaN where a component is not determined.
    reference_angle
        Radians from p to the instrument's x axis, from p towards s, shape (G,).

    Returns
    -------
    stokes, covariance
        Same shapes; NaN where a component that is not determined comes in.
    """
    # the frame turns by −reference_angle, which mixes Q and U alone: element by element for the sake of many pixels
    c, s = np.cos(2.0 * reference_angle), -np.sin(2.0 * reference_angle)
    missing = np.isnan(stokes)
    lost_q = (missing[:, 1] & (np.abs(c) > 1e-12)) | (missing[:, 2] & (np.abs(s) > 1e-12))
    lost_u = (missing[:, 1] & (np.abs(s) > 1e-12)) | (missing[:, 2] & (np.abs(c) > 1e-12))
    missing[:, 1], missing[:, 2] = lost_q, lost_u
    turned, spread = np.nan_to_num(stokes), np.nan_to_num(covariance)
    _turn(turned[:, 1], turned[:, 2], c, s)
    _turn(spread[:, 1, :], spread[:, 2, :], c[:, None], s[:, None])
    _turn(spread[:, :, 1], spread[:, :, 2], c[:, None], s[:, None])
    # rounding must not leave it unsymmetric
    spread = 0.5 * (spread + spread.transpose(0, 2, 1))
    turned[missing] = np.nan
    spread[missing[:, :, None] | missing[:, None, :]] = np.nan
    return turned, spread


def _turn(q: np.ndarray, u: np.ndarray, c: np.ndarray, s: np.ndarray) -> None:
    """Put Q and U as read in turned axes in their places; c, s of twice the angle (pbrdf.optics.elements)."""
    q[...], u[...] = c * q + s * u, c * u - s * q
