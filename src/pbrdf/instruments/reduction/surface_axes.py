"""Stokes vectors from the axes of the instrument into those of the surface."""

from __future__ import annotations

import numpy as np

from pbrdf.optics.elements import rotate_frame

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
    matrix = rotate_frame(-reference_angle)
    unknown = (np.abs(matrix) > 1e-12) @ np.isnan(stokes)[..., None]
    turned = np.einsum("gij,gj->gi", matrix, np.nan_to_num(stokes))
    spread = np.einsum("gij,gjk,glk->gil", matrix, np.nan_to_num(covariance), matrix)
    # rounding must not leave it unsymmetric
    spread = 0.5 * (spread + spread.transpose(0, 2, 1))
    missing = unknown[..., 0]
    return (
        np.where(missing, np.nan, turned),
        np.where(missing[:, :, None] | missing[:, None, :], np.nan, spread),
    )
