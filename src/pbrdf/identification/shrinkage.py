"""Covariance of specimens from few of them: the sample's own, shrunk towards a multiple of the identity.

Ledoit and Wolf, J. Multivariate Anal. 88, 365 (2004): the share of the identity that makes the expected squared error
of the matrix small, estimated from the sample itself.
"""

from __future__ import annotations

import numpy as np

__all__ = ["ledoit_wolf"]


def ledoit_wolf(samples: np.ndarray) -> tuple[np.ndarray, float]:
    """Shrunk covariance about the mean of the samples, and the share of the identity.

    Parameters
    ----------
    samples
        Shape (S, P), S ≥ 2, in units in which the components vary alike.

    Returns
    -------
    covariance, share
        Shape (P, P), positive definite unless all samples agree; and a number in [0, 1].
    """
    count, size = samples.shape
    centred = samples - samples.mean(axis=0)
    sample = centred.T @ centred / count
    scale = np.trace(sample) / size
    distance = ((sample - scale * np.eye(size)) ** 2).sum()
    # mean squared error of the sample's matrix, from the scatter of its terms
    error = ((centred**2).T @ (centred**2) / count - sample**2).sum() / count
    share = 1.0 if distance == 0.0 else float(min(error / distance, 1.0))
    return (1.0 - share) * sample + share * scale * np.eye(size), share
