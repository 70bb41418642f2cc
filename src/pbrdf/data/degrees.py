"""Degrees that stand for exactly the radians of a data set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["exact_degrees"]

_DECIMALS = (0, 2, 4, 6, 9, 12)


def exact_degrees(radians: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Degrees from which :func:`numpy.deg2rad` gives back exactly these radians.

    Among the doubles that do, the one with the fewest decimals is taken, so that 30° is stored as 30.0.

    Returns
    -------
    ndarray or None
        None if some angle has none: about one double in ten lies between the images of its neighbours.
    """
    # An uncertainty may be too large a number for degrees; then there are none.
    with np.errstate(over="ignore", invalid="ignore"):
        nearest = np.rad2deg(radians)
        candidates = [np.round(nearest, decimals) for decimals in _DECIMALS]
        candidates += [nearest, np.nextafter(nearest, np.inf), np.nextafter(nearest, -np.inf)]
        degrees = np.array(nearest)
        missing = ~np.isnan(radians)
        for candidate in candidates:
            hit = missing & (np.deg2rad(candidate) == radians)
            degrees[hit] = candidate[hit]
            missing &= ~hit
    return None if np.any(missing) else degrees
