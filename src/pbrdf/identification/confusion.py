"""Measurements or pixels whose materials are known: what was taken for what, and whether the sets hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.errors import FitError
from pbrdf.identification.conformal import Reliability, reliability, told
from pbrdf.identification.identify import Identification

__all__ = ["NONE", "Confusion", "confusion", "table_of"]

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
    def total(self) -> int:
        """Number of measurements."""
        return int(self.counts.sum())

    @property
    def taken_rightly(self) -> np.ndarray:
        """Measurements of each true material that were taken for what they are, none of these included, shape (R,)."""
        columns = [self.taken_for.index(name) if name in self.taken_for else -1 for name in self.truth]
        return self.counts[np.arange(len(self.truth)), columns]

    @property
    def accuracy(self) -> float:
        """Part of the measurements that were taken for what they are, none of these included."""
        return float(self.taken_rightly.sum() / self.total)

    @property
    def held(self) -> float:
        """Part of the sets that hold the true material, of the measurements of the library's; NaN without any."""
        count = np.where(self.strangers, 0, self.counts.sum(axis=1))
        return float((self.coverage * count).sum() / count.sum()) if count.any() else math.nan

    @property
    def strangers(self) -> np.ndarray:
        """Whether a true material is none of the library's, shape (R,)."""
        return np.array([name not in self.taken_for[:-1] for name in self.truth])


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
    strangers = tuple(dict.fromkeys(name for name in truth if name not in names))
    labels = [*names, *strangers]
    return table_of(
        names,
        np.array([labels.index(name) for name in truth]),
        np.array([[one[name].probability for name in names] for one in identifications]),
        np.array([[one[name].accepted for name in names] for one in identifications]),
        confidence,
        strangers,
    )


def table_of(
    names: Sequence[str],
    truth: np.ndarray,
    probability: np.ndarray,
    inside: np.ndarray,
    confidence: float,
    strangers: Sequence[str] = (),
) -> Confusion:
    """Table of B labelled measurements, or pixels, from plain arrays.

    Parameters
    ----------
    names
        Of the library's C materials.
    truth
        Numbers of the true materials among the library's and then the strangers, shape (B,).
    probability, inside
        Of the materials, and whether they belong to the set; shape (B, C) each.
    confidence
        That the sets state.
    strangers
        True materials that the library has not got.
    """
    labels, count = [*names, *strangers], len(names)
    measured = np.bincount(truth, minlength=len(labels))
    rows = np.flatnonzero(measured)
    counts = np.zeros((len(labels), count + 1), dtype=int)
    np.add.at(counts, (truth, told(probability, inside)), 1)
    known = truth < count
    own = np.minimum(truth, count - 1)
    right = np.where(known, inside[np.arange(len(truth)), own], ~inside.any(axis=1))
    held = np.bincount(truth, weights=right, minlength=len(labels))
    size = np.bincount(truth, weights=inside.sum(axis=1), minlength=len(labels))
    return Confusion(
        truth=tuple(labels[row] for row in rows),
        taken_for=(*names, NONE),
        counts=counts[rows],
        coverage=held[rows] / measured[rows],
        set_size=size[rows] / measured[rows],
        confidence=confidence,
        reliability=reliability(probability[known], truth[known]) if known.any() else None,
    )
