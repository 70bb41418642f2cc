"""How honest a calibration is, told by its own measurements: each is judged with a calibration of the others.

A measurement that took part in its own calibration would flatter it. The labelled measurements are dealt out to folds,
each material's evenly, and those of a fold are judged with what the other folds show.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.identification.conformal import calibrate, probabilities

__all__ = ["cross_checked"]

FOLDS = 10


def cross_checked(
    names: Sequence[str],
    log_evidence: np.ndarray,
    scores: np.ndarray,
    truth: np.ndarray,
    folds: int = FOLDS,
) -> tuple[np.ndarray, np.ndarray]:
    """Judge labelled measurements, each with the calibration of those of other folds.

    Parameters
    ----------
    names, log_evidence, scores, truth
        As of :func:`pbrdf.identification.conformal.calibrate`.
    folds
        How many; no more than there are measurements.

    Returns
    -------
    probability, p_value
        Of the C materials, shape (B, C) each.
    """
    fold = np.empty(len(truth), dtype=int)
    for c in range(len(names)):
        rows = np.flatnonzero(truth == c)
        fold[rows] = np.arange(len(rows)) % folds
    probability, p_value = np.empty_like(log_evidence), np.empty_like(scores)
    for number in np.unique(fold):
        own, others = fold == number, fold != number
        calibration = calibrate(names, log_evidence[others], scores[others], truth[others])
        probability[own] = probabilities(log_evidence[own], None, calibration.temperature)
        p_value[own] = calibration.p_values(scores[own])
    return probability, p_value
