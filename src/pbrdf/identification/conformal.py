"""Sets of materials that hold the true one as often as they say, whatever the likelihoods get wrong.

Class-conditional ("Mondrian") conformal prediction: each material has calibration measurements whose material is known.
Its p-value for a new measurement is the rank of the measurement's score among theirs, and the set of a confidence 1 − α
holds the materials with p > α. If measurement and calibration of the true material are exchangeable, the set holds it
with a probability of at least 1 − α, for each material by itself (Vovk, Gammerman and Shafer, *Algorithmic Learning in
a Random World* (2005), section 4.5). A measurement that is like none of the materials' has an empty set.

The score is the probability of a larger distance by the χ² that the distance follows for a linear model: it may be
compared between measurements of different numbers of geometries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc

__all__ = [
    "Calibration",
    "Reliability",
    "calibrate",
    "expected_calibration_error",
    "nominal",
    "probabilities",
    "reliability",
    "told",
]

#: Temperatures among which the one is taken that makes labelled measurements most probable.
TEMPERATURES = np.exp(np.linspace(np.log(0.25), np.log(16.0), 61))
#: How far the logarithm of the temperature may be off 0 before measurements have shown it: few measurements, or such
#: that are all told rightly, would else make likelihoods as sharp as can be.
TEMPERATURE_SPREAD = np.log(2.0)
#: Classes of confidence for the reliability of probabilities.
BINS = 10


def nominal(distance: np.ndarray, degrees_of_freedom: np.ndarray) -> np.ndarray:
    """Probability that χ² exceeds the distances, shapes (B, C) and (B,) to (B, C)."""
    return np.asarray(gammaincc(0.5 * np.maximum(degrees_of_freedom, 1)[:, None], 0.5 * distance))


def probabilities(
    log_evidence: np.ndarray, prior: np.ndarray | None = None, temperature: float = 1.0
) -> np.ndarray:
    """Posterior probabilities of the materials, given that it is one of them; (B, C)."""
    logit = log_evidence / temperature
    if prior is not None:
        with np.errstate(divide="ignore"):
            logit = logit + np.log(prior)
    weight = np.exp(logit - logit.max(axis=1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def told(probability: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Number of the most probable material of each set, the number of materials where the set is empty, shape (B,).

    Parameters
    ----------
    probability, inside
        Of the materials, and whether they belong to the set; shape (B, C) each.
    """
    best = np.where(inside, probability, -1.0).argmax(axis=1)
    values: np.ndarray = np.where(inside.any(axis=1), best, inside.shape[1])
    return values


@dataclass(frozen=True)
class Calibration:
    """What labelled measurements showed.

    Attributes
    ----------
    names
        Of the materials.
    scores
        Scores of the calibration measurements of each material for their own material, ascending; empty where there
        were none: the nominal probability counts then.
    temperature
        What logarithms of likelihoods are divided by.
    measurements
        Where the calibration comes from, in words.
    """

    names: tuple[str, ...]
    scores: tuple[np.ndarray, ...]
    temperature: float = 1.0
    measurements: str = ""

    def p_values(self, scores: np.ndarray) -> np.ndarray:
        """p-values of measurements with these scores, shape (B, C)."""
        result = np.empty_like(scores)
        for c, own in enumerate(self.scores):
            if len(own):
                rank = np.searchsorted(own, scores[:, c], side="right")
                result[:, c] = (rank + 1.0) / (len(own) + 1.0)
            else:
                result[:, c] = scores[:, c]
        return result

    def least_scores(self, confidence: float) -> np.ndarray:
        """Smallest scores with which a set of this confidence still holds each material, (C,); 0: it always does."""
        least = np.full(len(self.scores), 1.0 - confidence)
        for c, own in enumerate(self.scores):
            if len(own):
                rank = math.floor(round((1.0 - confidence) * (len(own) + 1), 9))
                least[c] = own[rank - 1] if rank else 0.0
        return least


def calibrate(
    names: Sequence[str],
    log_evidence: np.ndarray,
    scores: np.ndarray,
    truth: np.ndarray,
    measurements: str = "",
) -> Calibration:
    """Calibrate with B labelled measurements.

    Parameters
    ----------
    names
        Of the C materials.
    log_evidence, scores
        Shape (B, C) each.
    truth
        Number of the material of each measurement, shape (B,).
    measurements
        In words, for a reader.
    """
    own = tuple(np.sort(scores[truth == c, c]) for c in range(len(names)))
    rows = np.arange(len(truth))
    losses = [
        -np.log(np.maximum(probabilities(log_evidence, None, t)[rows, truth], 1e-300)).sum()
        + 0.5 * (np.log(t) / TEMPERATURE_SPREAD) ** 2
        for t in TEMPERATURES
    ]
    best = float(TEMPERATURES[int(np.argmin(losses))])
    return Calibration(tuple(names), own, best, measurements)


@dataclass(frozen=True)
class Reliability:
    """How often the most probable material was the true one, by stated confidence; K classes of confidence.

    Attributes
    ----------
    edges
        Of the classes, shape (K + 1,).
    confidence, accuracy
        Means in each class, NaN where there are none, shape (K,).
    count
        Measurements in each class, shape (K,).
    """

    edges: np.ndarray
    confidence: np.ndarray
    accuracy: np.ndarray
    count: np.ndarray

    @property
    def error(self) -> float:
        """Expected calibration error: the mean difference of confidence and accuracy."""
        filled = self.count > 0
        gap = np.abs(self.confidence[filled] - self.accuracy[filled])
        return float((gap * self.count[filled]).sum() / max(int(self.count.sum()), 1))

    @property
    def right(self) -> float:
        """Part of all measurements whose most probable material is the true one."""
        filled = self.count > 0
        return float((self.accuracy[filled] * self.count[filled]).sum() / max(int(self.count.sum()), 1))


def reliability(probability: np.ndarray, truth: np.ndarray, bins: int = BINS) -> Reliability:
    """Reliability of probabilities (B, C) for the true materials (B,)."""
    confidence = probability.max(axis=1)
    right = probability.argmax(axis=1) == truth
    edges = np.linspace(0.0, 1.0, bins + 1)
    place = np.clip(np.searchsorted(edges, confidence, side="left") - 1, 0, bins - 1)
    count = np.bincount(place, minlength=bins)
    with np.errstate(invalid="ignore"):
        means = [np.bincount(place, weights=x, minlength=bins) / count for x in (confidence, right)]
    return Reliability(edges, means[0], means[1], count)


def expected_calibration_error(probability: np.ndarray, truth: np.ndarray, bins: int = BINS) -> float:
    """Expected calibration error of probabilities (B, C) (Naeini, Cooper and Hauskrecht, AAAI (2015))."""
    return reliability(probability, truth, bins).error
