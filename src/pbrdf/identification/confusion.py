"""Identifications of measurements whose materials are known: what was taken for what, and whether the sets hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.errors import FitError
from pbrdf.identification.conformal import Reliability, reliability, told
from pbrdf.identification.identify import Identification

__all__ = ["NONE", "Confusion", "confusion"]

#: Heading of the column of measurements whose set is empty.
NONE = "none of these"


@dataclass(frozen=True)
class Confusion:
    """R true materials, those of the library first, and the C of the library.

    Attributes
    ----------
    truth
        The true materials that were measured; those not of the library last, shape (R,).
    taken_for
        The library's materials and then ``"none of these"``.
    counts
        Measurements of each true material by the most probable material of their set, shape (R, C + 1).
    coverage
        How often the set is right, shape (R,): it holds the true material, or is empty for one of no library.
    set_size
        Mean number of materials in the set, shape (R,).
    confidence
        That the sets state.
    reliability
        Of the probabilities, by the measurements of the library's materials; None where there are none.
    """

    truth: tuple[str, ...]
    taken_for: tuple[str, ...]
    counts: np.ndarray
    coverage: np.ndarray
    set_size: np.ndarray
    confidence: float
    reliability: Reliability | None

    @property
    def accuracy(self) -> float:
        """Part of the measurements that were taken for what they are, none of these included."""
        right = sum(
            self.counts[r, self.taken_for.index(name) if name in self.taken_for else -1]
            for r, name in enumerate(self.truth)
        )
        return float(right / self.counts.sum())


def confusion(identifications: Sequence[Identification], truth: Sequence[str]) -> Confusion:
    """Table of labelled measurements.

    Parameters
    ----------
    identifications
        With one library and one confidence.
    truth
        Name of each one's material; a name that the library has not got is an unknown material.

    Raises
    ------
    FitError
        If there are none, the numbers differ, or libraries or confidences do.
    """
    if len(identifications) != len(truth) or not truth:
        raise FitError(
            f"confusion: {len(identifications)} identifications and {len(truth)} labels; give as many, one at least"
        )
    names = identifications[0].library.names
    confidence = identifications[0].confidence
    if any(one.library.names != names or one.confidence != confidence for one in identifications):
        raise FitError("confusion: the identifications differ in their library or confidence")
    taken_for = (*names, NONE)
    strangers = tuple(dict.fromkeys(name for name in truth if name not in names))
    rows = (*(name for name in names if name in truth), *strangers)
    counts = np.zeros((len(rows), len(taken_for)), dtype=int)
    right, size = np.zeros(len(rows)), np.zeros(len(rows))
    row = np.array([rows.index(name) for name in truth])
    probability = np.array([[one[name].probability for name in names] for one in identifications])
    inside = np.array([[one[name].accepted for name in names] for one in identifications])
    np.add.at(counts, (row, told(probability, inside)), 1)
    true = np.array([names.index(name) if name in names else -1 for name in truth])
    held = np.where(true < 0, ~inside.any(axis=1), inside[np.arange(len(true)), true])
    np.add.at(right, row, held)
    np.add.at(size, row, inside.sum(axis=1))
    count = counts.sum(axis=1)
    known = true >= 0
    return Confusion(
        truth=rows,
        taken_for=taken_for,
        counts=counts,
        coverage=right / count,
        set_size=size / count,
        confidence=confidence,
        reliability=reliability(probability[known], true[known]) if known.any() else None,
    )
