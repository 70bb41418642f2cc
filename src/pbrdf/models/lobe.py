"""How wide the specular lobe of a model is, measured on its values."""

from __future__ import annotations

import math

import numpy as np

from pbrdf.models import evaluation
from pbrdf.optics.half_difference import directions

__all__ = ["WIDEST", "measured_lobe_width"]

#: Width of a lobe that is broader than that, or of none at all.
WIDEST = 0.5
#: Tilts of the facet at which the lobe is looked at, and half the angle between the rays.
_TILTS, _DIFFERENCE = np.geomspace(1e-4, 1.0, 600), math.radians(30.0)


def measured_lobe_width(model: evaluation.Evaluable) -> float:
    """Slope standard deviation of the Gaussian whose half width at half maximum the specular lobe has at θ_d = 30°.

    That is the tangent of θ_h at which the density of the facets' slopes (f00 cosθ_i cosθ_r cos⁴θ_h of the specular
    part, but for Fresnel reflectance and shadowing) has fallen to half, divided by √(2 ln 2). For a long-tailed lobe it
    is the width of the core.

    Parameters
    ----------
    model
        Its parameters are numbers, or arrays of shape (N,).

    Returns
    -------
    float
        :data:`WIDEST` for a model without a specular part, and at most that; of arrays the widest lobe.
    """
    theta_i, theta_r, phi = (angle[:, None] for angle in directions(_TILTS, _DIFFERENCE, math.pi / 2))
    f00 = np.asarray(evaluation.stokes(model, theta_i, theta_r, phi, (1.0, 0.0, 0.0, 0.0), "specular"))[
        ..., 0
    ]
    density = f00 * np.cos(theta_i) * np.cos(theta_r) * np.cos(_TILTS)[:, None] ** 4
    return max(_half_width(column) for column in density.T)


def _half_width(density: np.ndarray) -> float:
    below = np.flatnonzero(density < 0.5 * density[0])
    if not below.size or not density[0] > 0.0:
        return WIDEST
    return min(float(np.tan(_TILTS[below[0]])) / math.sqrt(2.0 * math.log(2.0)), WIDEST)
