"""Table of labelled measurements, with identifications made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.errors import FitError
from pbrdf.identification.confusion import NONE, confusion, table_of
from pbrdf.identification.identify import Candidate, Identification
from pbrdf.identification.library import Library, bundled_library

LIBRARY = Library(bundled_library().materials[:3])
A, B, C = LIBRARY.names


def found(probabilities, accepted):
    candidates = [
        Candidate(name, p, 0.5, 1.0, {}, name in accepted)
        for name, p in zip(LIBRARY.names, probabilities, strict=True)
    ]
    ranked = tuple(sorted(candidates, key=lambda candidate: -candidate.probability))
    return Identification(ranked, 0.95, 3, False, None, "stated", "none", None, LIBRARY)


def test_counts_coverage_and_sizes():
    labelled = [
        (A, found([0.9, 0.1, 0.0], [A])),
        (A, found([0.2, 0.7, 0.1], [A, B])),  # taken for B, though the set holds A
        (A, found([0.2, 0.7, 0.1], [])),
        (B, found([0.1, 0.8, 0.1], [B, C])),
        ("unknown", found([0.5, 0.3, 0.2], [])),
        ("unknown", found([0.1, 0.1, 0.8], [C])),
    ]
    table = confusion([one for _, one in labelled], [name for name, _ in labelled])
    assert table.truth == (A, B, "unknown")
    assert table.taken_for == (A, B, C, NONE)
    np.testing.assert_array_equal(table.counts, [[1, 1, 0, 1], [0, 1, 0, 0], [0, 0, 1, 1]])
    np.testing.assert_allclose(table.coverage, [2 / 3, 1.0, 0.5])
    np.testing.assert_allclose(table.set_size, [1.0, 2.0, 0.5])
    assert table.accuracy == pytest.approx(3 / 6)
    assert table.reliability.count.sum() == 4  # the unknown says nothing of the probabilities


def test_of_plain_arrays():
    p = np.array([[0.5, 0.01, 0.01], [0.5, 0.6, 0.01], [0.01, 0.02, 0.01], [0.2, 0.01, 0.9]])
    share = np.array([[0.9, 0.05, 0.05], [0.3, 0.7, 0.0], [0.1, 0.8, 0.1], [0.4, 0.3, 0.3]])
    table = table_of("abc", np.array([0, 1, 1, 2]), share, p > 0.05, 0.95)
    assert table.counts.tolist() == [[1, 0, 0, 0], [0, 1, 0, 1], [1, 0, 0, 0]]
    assert table.accuracy == pytest.approx(0.5)
    assert table.reliability.right == pytest.approx(0.75)  # of the probabilities, whatever the sets say
    assert table.coverage == pytest.approx([1.0, 0.5, 1.0])
    assert table.held == pytest.approx(0.75)
    assert table_of("abc", np.array([3, 0]), share[:2], p[:2] > 0.05, 0.95, ["x"]).truth == ("a", "x")


def test_only_unknown_materials():
    table = confusion([found([0.5, 0.3, 0.2], [])], ["unknown"])
    assert table.reliability is None
    assert np.isnan(table.held)
    assert table.accuracy == 1.0


def test_what_cannot_be():
    one = found([0.9, 0.1, 0.0], [A])
    with pytest.raises(FitError, match="1 identifications and 2 labels"):
        confusion([one], [A, B])
    with pytest.raises(FitError, match="0 identifications"):
        confusion([], [])
    with pytest.raises(FitError, match="differ in their library or confidence"):
        confusion([one, replace(one, confidence=0.9)], [A, A])
