"""Analyser vectors of a train of elements before an analyser, and how they change with each element."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["AnalyzerChain"]


class AnalyzerChain:
    """W = a E_K … E_2 E_1 of N states: a the analyser's first row, E_1 the element that the light meets first.

    Parameters
    ----------
    row
        First row of the analyser's Mueller matrix, shape (4,) or (N, 4).
    elements
        Mueller matrices E_1 … E_K, each of shape (4, 4) or (N, 4, 4).

    Attributes
    ----------
    vectors
        Analyser vectors, shape (N, 4).
    """

    def __init__(self, row: np.ndarray, elements: Sequence[np.ndarray]) -> None:
        # _before[k]: the row in front of E_{k+1}; _after[k]: the product of E_k … E_1
        self._before = [row]
        for element in reversed(elements):
            self._before.insert(0, _row_times(self._before[0], element))
        self.vectors = self._before.pop(0)
        self._after = [np.eye(4)]
        for element in elements:
            self._after.append(element @ self._after[-1])

    def element_rate(self, k: int, rate: np.ndarray) -> np.ndarray:
        """Derivative of the vectors if that of E_{k+1} is `rate`, shape (N, 4)."""
        return _row_times(_row_times(self._before[k], rate), self._after[k])

    def row_rate(self, rate: np.ndarray) -> np.ndarray:
        """Derivative of the vectors if that of the analyser's row is `rate`, shape (N, 4)."""
        return _row_times(rate, self._after[-1])


def _row_times(row: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    values: np.ndarray = (row[..., None, :] @ matrix)[..., 0, :]
    return values
