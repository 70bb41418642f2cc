"""What measured Mueller matrices say in a few numbers with errors: diattenuation, retardance, depolarisation.

The errors follow from the covariance of the 16 elements, taken through the decomposition at the ends of its principal
axes, M ± √λ_k e_k: first order where a quantity is smooth, and still of the right size at its edge, where derivatives
are not (a diattenuation of 0, a retardance of 0 or π).
"""

from __future__ import annotations

import numpy as np

from pbrdf.instruments.reduction.mueller_reduction import MuellerMeans
from pbrdf.optics.angles import within_half_turn
from pbrdf.optics.decomposition import lu_chipman
from pbrdf.optics.mueller import depolarization_index

__all__ = ["UNKNOWN_RETARDANCE", "Properties", "mueller_properties"]

#: Standard error from which on a retardance or the angle of its axis is not known, degrees.
UNKNOWN_RETARDANCE = 10.0

#: Values and standard errors of each series, by the name of a quantity.
Properties = dict[str, tuple[np.ndarray, np.ndarray]]

#: Half the period of the one quantity that has no first and no last value, degrees.
_QUARTER_TURN = 90.0


def mueller_properties(means: MuellerMeans) -> Properties:
    """Quantities of :func:`pbrdf.lu_chipman` with their standard errors, in the instrument's axes.

    Parameters
    ----------
    means
        Mueller matrices of M series.

    Returns
    -------
    dict
        By name two arrays of the shape (M,): ``diattenuation``, ``polarizance``, ``retardance_deg``, ``fast_axis_deg``
        (the angle of its linear part from x towards y, within (−90, 90]), ``depolarization``, ``depolarization_index``.
        NaN where the matrix does not determine them, errors also where nothing says how noisy the readings are.
    """
    count = len(means.names)
    known = np.isfinite(means.covariance).all(axis=(1, 2))
    widths, axes = np.linalg.eigh(np.where(known[:, None, None], means.covariance, np.eye(16)))
    steps = np.sqrt(np.maximum(widths, 0.0))[:, :, None] * np.swapaxes(axes, 1, 2)
    steps = np.where(known[:, None, None], steps, np.nan).reshape(count, 16, 4, 4)
    middle = means.mueller[:, None]
    at = _quantities(np.concatenate([middle, middle + steps, middle - steps], axis=1))
    found: Properties = {}
    for name, values in at.items():
        change = values[:, 1:] - values[:, :1]
        if name == "fast_axis_deg":
            change = within_half_turn(change, _QUARTER_TURN)
        # the mean of the two squares is that of the half difference where the quantity is linear
        found[name] = values[:, 0], np.sqrt(0.5 * np.square(change).sum(axis=1))
    return found


def _quantities(matrices: np.ndarray) -> dict[str, np.ndarray]:
    parts = lu_chipman(matrices)
    return {
        "diattenuation": parts.diattenuation,
        "polarizance": parts.polarizance,
        "retardance_deg": np.rad2deg(parts.retardance),
        "fast_axis_deg": within_half_turn(
            0.5 * np.rad2deg(np.arctan2(parts.fast_axis[..., 1], parts.fast_axis[..., 0])), _QUARTER_TURN
        ),
        "depolarization": parts.depolarization,
        "depolarization_index": depolarization_index(matrices),
    }
