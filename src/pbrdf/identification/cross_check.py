"""How honest a calibration is, told by its own measurements: each is judged with a calibration of the others.

A measurement that took part in its own calibration would flatter it. The labelled measurements are dealt out to folds,
each material's evenly, and those of a fold are judged with what the other folds show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.identification.conformal import Reliability, calibrate, probabilities, reliability, told

__all__ = ["Judged", "cross_checked"]

FOLDS = 10


@dataclass(frozen=True)
class Judged:
    """Labelled measurements and what identification said of them; B measurements, C materials.

    Attributes
    ----------
    names
        Of the materials.
    truth
        Number of the material of each measurement, shape (B,).
    probability, p_value
        Shape (B, C) each.
    """

    names: tuple[str, ...]
    truth: np.ndarray
    probability: np.ndarray
    p_value: np.ndarray

    @property
    def reliability(self) -> Reliability:
        """How often the most probable material is the true one, by its probability."""
        return reliability(self.probability, self.truth)

    @property
    def accuracy(self) -> float:
        """Part of the measurements whose most probable material is the true one."""
        return float((self.probability.argmax(axis=1) == self.truth).mean())

    def coverage(self, confidence: float) -> np.ndarray:
        """Part of the sets that hold the true material, by material, shape (C,); NaN where it has no measurement."""
        inside = self.p_value[np.arange(len(self.truth)), self.truth] > 1.0 - confidence
        count = np.bincount(self.truth, minlength=len(self.names))
        with np.errstate(invalid="ignore"):
            return np.bincount(self.truth, weights=inside, minlength=len(self.names)) / count

    def confusion(self, confidence: float) -> np.ndarray:
        """How often a material (row) was told as which (column; the last is none of these), shape (C, C + 1).

        What is told is the most probable material of the set.
        """
        matrix = np.zeros((len(self.names), len(self.names) + 1), dtype=int)
        np.add.at(matrix, (self.truth, told(self.probability, self.p_value > 1.0 - confidence)), 1)
        return matrix


def cross_checked(
    names: Sequence[str],
    log_evidence: np.ndarray,
    scores: np.ndarray,
    truth: np.ndarray,
    folds: int = FOLDS,
) -> Judged:
    """Judge labelled measurements, each with the calibration of those of other folds.

    Parameters
    ----------
    names, log_evidence, scores, truth
        As of :func:`pbrdf.identification.conformal.calibrate`.
    folds
        How many; no more than there are measurements.
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
    return Judged(tuple(names), truth, probability, p_value)
