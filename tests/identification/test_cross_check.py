"""Labelled measurements judged by a calibration of the others."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.identification.conformal import nominal
from pbrdf.identification.confusion import table_of
from pbrdf.identification.cross_check import cross_checked

NAMES = ("a", "b", "c")


def gaussians(count, spread=1.0, seed=1):
    """One number of each of three materials at 0, 3 and 6 with unit scatter, thought to be `spread` times it."""
    rng = np.random.default_rng(seed)
    truth = np.repeat(np.arange(3), count)
    x = 3.0 * truth + rng.standard_normal(truth.size)
    distance = ((x[:, None] - 3.0 * np.arange(3)) / spread) ** 2
    return -0.5 * distance, nominal(distance, np.ones(truth.size, dtype=int)), truth


@pytest.mark.parametrize("spread", [0.6, 1.0, 1.5])
def test_sets_hold_their_promise_whatever_was_thought_of_the_scatter(spread):
    labelled = gaussians(500, spread)
    probability, p_value = cross_checked(NAMES, *labelled)
    table = table_of(NAMES, labelled[2], probability, p_value > 0.05, 0.95)
    # 500 measurements: one standard error of a coverage of 95 % is 1 %
    assert table.coverage == pytest.approx(np.full(3, 0.95), abs=0.03)
    assert table.reliability.error < 0.03


def test_no_measurement_calibrates_itself():
    """The least likely of each material is outside of every set of the others at a confidence that one in n misses."""
    log_evidence, scores, truth = gaussians(20)
    _, p_value = cross_checked(NAMES, log_evidence, scores, truth, folds=20)
    for c in range(3):
        rows = np.flatnonzero(truth == c)
        worst = rows[scores[rows, c].argmin()]
        assert p_value[worst, c] == pytest.approx(1.0 / 20.0)


def test_a_single_measurement_has_no_others():
    log_evidence, scores, truth = (x[:1] for x in gaussians(1))
    _, p_value = cross_checked(NAMES, log_evidence, scores, truth)
    assert p_value == pytest.approx(scores)
