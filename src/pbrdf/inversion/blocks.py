"""Unknowns that count for part of the points only: which of a problem's unknowns are shared, which a block's own.

A parameter that is free for each group has as many unknowns as there are groups, but at any one point only one of them
counts. The points of a group are a block: the function is evaluated there, and differentiated, by the shared unknowns
and by the block's own alone, however many blocks there are.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

__all__ = ["Blocks", "Key"]


class Key(NamedTuple):
    """What an unknown stands for: ``role`` at the points where ``split`` (``"group"``, …) is ``label``, or at all."""

    role: Hashable
    split: str | None
    label: Any


@dataclass(frozen=True)
class Blocks:
    """Columns of the unknowns: S shared ones, and L of its own for each of G blocks.

    Attributes
    ----------
    split
        What the blocks are: ``"group"`` or ``"wavelength"``.
    labels
        The label of each block.
    shared
        Columns of the shared unknowns, shape (S,).
    own
        Columns of each block's own unknowns, in the same order in every block, shape (G, L).
    """

    split: str
    labels: tuple[Any, ...]
    shared: np.ndarray
    own: np.ndarray

    @classmethod
    def of(cls, keys: Sequence[Key]) -> Blocks | None:
        """The blocks of unknowns, of the split that has most of them where there are two; None where there is none.

        The unknowns of the other split are shared ones.
        """
        splits = [key.split for key in keys if key.split is not None]
        if not splits:
            return None
        split = max(dict.fromkeys(splits), key=splits.count)
        columns = {(key.role, key.label): i for i, key in enumerate(keys) if key.split == split}
        roles, labels = (list(dict.fromkeys(of)) for of in zip(*columns, strict=True))
        own = np.array([[columns[role, label] for role in roles] for label in labels])
        return cls(split, tuple(labels), np.setdiff1d(np.arange(len(keys)), own), own)

    @property
    def counting(self) -> np.ndarray:
        """Columns of the unknowns that count in each block, the shared ones first, shape (G, S + L)."""
        shared = np.broadcast_to(self.shared, (len(self.own), len(self.shared)))
        return np.concatenate([shared, self.own], axis=1)

    def places(self, column: np.ndarray) -> np.ndarray:
        """Number of the block of each label in a column, G for a label that has no block."""
        place = np.full(len(column), len(self.labels))
        for number, label in enumerate(self.labels):
            place[column == label] = number
        return place

    def at(self, u: np.ndarray, place: np.ndarray) -> np.ndarray:
        """The unknowns that count at N points of blocks ``place``: (B, P) to (B, N, S + L).

        At a point of no block (of a group that was held out) the mean of all blocks' own counts.
        """
        own = u[:, self.own]
        own = np.concatenate([own, own.mean(axis=1, keepdims=True)], axis=1)[:, place]
        shared = np.broadcast_to(u[:, None, self.shared], (*own.shape[:2], len(self.shared)))
        return np.concatenate([shared, own], axis=2)

    def spread(self, jacobian: np.ndarray, place: np.ndarray) -> np.ndarray:
        """From derivatives by what :meth:`at` gives, shape (B, N, C, S + L), those by all unknowns, (B, N, C, P)."""
        number, size = len(self.shared), len(self.shared) + self.own.size
        result = np.zeros((*jacobian.shape[:3], size))
        result[..., self.shared] = jacobian[..., :number]
        for block, columns in enumerate(self.own):
            # a point of no block sees the mean of all
            weight = np.where(place == block, 1.0, np.where(place == len(self.own), 1.0 / len(self.own), 0.0))
            result[..., columns] = jacobian[..., number:] * weight[:, None, None]
        return result
