"""Starting values that fill the space between the bounds."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

__all__ = ["sobol_starts"]


def sobol_starts(lower: np.ndarray, upper: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """Scrambled Sobol points in a box.

    Parameters
    ----------
    lower, upper
        Bounds, shape (P,); the solver's own coordinates, so logarithms for logarithmic parameters.
    count
        Number of points.
    seed
        Seed of the scrambling.

    Returns
    -------
    ndarray
        Shape (count, P). The points keep a distance of 5 % of the range from the bounds, where gradients of
        bounded parameters vanish.
    """
    sampler = qmc.Sobol(len(lower), scramble=True, rng=np.random.default_rng(seed))
    # whole powers of two keep the balance of the sequence; surplus points are dropped
    points = sampler.random_base2(max(0, int(np.ceil(np.log2(max(count, 1))))))[:count]
    return lower + (0.05 + 0.9 * points) * (upper - lower)
