"""Whether the Mueller matrices of a model are those of passive surfaces."""

from __future__ import annotations

import numpy as np

from pbrdf.models.base import Model
from pbrdf.optics.mueller import coherency_eigenvalues

__all__ = ["least_coherency"]


def least_coherency(model: Model) -> tuple[float, tuple[float, float, float]]:
    """Smallest eigenvalue of Cloude's coherency matrix over a grid of directions.

    Parameters
    ----------
    model
        The model.

    Returns
    -------
    tuple
        The eigenvalue in units of f00 (negative beyond rounding: no passive surface has this Mueller matrix), and
        (θ_i, θ_r, φ) in radians where it stands. The grid holds zenith angles of 0° to 80° by 10° and 89° and
        azimuths of 0° to 180° by 15°, mirror and backscatter directions among them.
    """
    zenith = np.deg2rad([*range(0, 81, 10), 89])
    angles = np.meshgrid(zenith, zenith, np.deg2rad(np.arange(0, 181, 15)), indexing="ij")
    flat = [a.ravel() for a in angles]
    f = np.asarray(model.mueller(*flat))
    f00 = f[:, :1, :1]
    least = coherency_eigenvalues(f / np.where(f00 > 0.0, f00, 1.0))[:, 0]
    worst = int(np.argmin(least))
    return float(least[worst]), (float(flat[0][worst]), float(flat[1][worst]), float(flat[2][worst]))
