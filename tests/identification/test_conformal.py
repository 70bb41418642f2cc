"""Conformal sets and calibrated probabilities, against crepes and by their promises."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from pbrdf.identification.conformal import Calibration, calibrate, nominal, probabilities, reliability

NAMES = ("a", "b", "c")


def test_nominal_scores_are_those_of_chi2():
    distance = np.array([[0.5, 3.0], [10.0, 40.0]])
    found = nominal(distance, np.array([2, 9]))
    assert found == pytest.approx(chi2.sf(distance, [[2], [9]]))


def test_p_values_are_those_of_crepes():
    crepes = pytest.importorskip("crepes", reason="the oracle is crepes")
    random = np.random.default_rng(1)
    truth = np.repeat([0, 1, 2], [30, 50, 9])
    scores, new = random.random((len(truth), 3)), random.random((40, 3))
    calibration = calibrate(NAMES, np.zeros_like(scores), scores, truth)
    # crepes wants numbers that grow with strangeness
    classifier = crepes.ConformalClassifier()
    own = 1.0 - scores[np.arange(len(truth)), truth]
    classifier.fit(own, bins=truth)
    expected = np.column_stack(
        [
            classifier.predict_p(1.0 - new[:, [c]], bins=np.full(40, c), smoothing=False)[:, 0]
            for c in range(3)
        ]
    )
    assert calibration.p_values(new) == pytest.approx(expected)


def test_each_material_is_in_its_set_as_often_as_stated_though_the_scores_are_wrong():
    random = np.random.default_rng(2)
    count = 4000
    truth = np.repeat([0, 1, 2], count)
    # uniform scores would be right: these are far too small or too large, and differ between materials
    wrong = [lambda u: u**4, lambda u: u**0.2, lambda u: 0.5 * u]

    def scores():
        return np.column_stack([wrong[c](random.random(3 * count)) for c in range(3)])

    calibration = calibrate(NAMES, np.zeros((3 * count, 3)), scores(), truth)
    inside = calibration.p_values(scores()) > 0.05
    for c in range(3):
        assert inside[truth == c, c].mean() == pytest.approx(0.95, abs=4.0 * np.sqrt(2 * 0.05 * 0.95 / count))


def test_a_material_without_labelled_measurements_keeps_its_nominal_score():
    calibration = calibrate(NAMES, np.zeros((4, 3)), np.full((4, 3), 0.5), np.array([0, 0, 1, 1]))
    assert calibration.p_values(np.array([[0.1, 0.1, 0.1]]))[0, 2] == 0.1


def test_likelihoods_that_boast_are_cooled():
    """Likelihoods three times too sharp: the temperature finds the factor, and the probabilities hold."""
    random = np.random.default_rng(3)
    logit = 2.0 * random.standard_normal((40_000, 3))
    share = probabilities(logit)
    truth = np.array([random.choice(3, p=p) for p in share])
    calibration = calibrate(NAMES, 3.0 * logit, np.full(logit.shape, 0.5), truth)
    assert calibration.temperature == pytest.approx(3.0, rel=0.08)
    boasting = reliability(probabilities(3.0 * logit), truth).error
    cooled = reliability(probabilities(3.0 * logit, None, calibration.temperature), truth).error
    assert boasting > 0.1
    assert cooled < 0.01


def test_reliability_counts_every_measurement_once():
    random = np.random.default_rng(4)
    share = random.dirichlet(np.ones(3), 500)
    found = reliability(share, random.integers(0, 3, 500))
    assert found.count.sum() == 500
    filled = found.count > 0
    assert (found.confidence[filled] > found.edges[:-1][filled]).all()
    assert (found.confidence[filled] <= found.edges[1:][filled]).all()


def test_prior_probabilities_count():
    share = probabilities(np.array([[0.0, 0.0, 0.0]]), np.array([0.7, 0.3, 0.0]))
    assert share[0] == pytest.approx([0.7, 0.3, 0.0])


def test_measurements_that_are_all_told_rightly_do_not_sharpen_the_likelihoods():
    """They are most probable at the lowest temperature there is, and say nothing of it."""
    truth = np.repeat([0, 1], 10)
    log_evidence = np.where(truth[:, None] == [0, 1], 0.0, -40.0)
    made = calibrate(("a", "b"), log_evidence, np.full((20, 2), 0.5), truth)
    assert made.temperature == pytest.approx(1.0, abs=0.05)
    assert calibrate(("a", "b"), log_evidence[:0], log_evidence[:0], truth[:0]).temperature == pytest.approx(
        1.0, abs=0.05
    )


def test_the_least_score_of_a_set_is_where_its_p_value_passes():
    own = np.sort(np.random.default_rng(4).random(57))
    calibration = Calibration(("a", "b", "c"), (own, own[:9], np.empty(0)))
    for confidence in (0.8, 0.95, 0.99):
        least = calibration.least_scores(confidence)
        for c, low in enumerate(least):
            scores = np.full((2, 3), low)
            scores[0, c] -= 1e-9
            below, at = calibration.p_values(scores)[:, c] > 1.0 - confidence + 1e-8
            if low == 0.0:
                assert below and at  # too few to leave anything out
            elif c < 2:
                assert not below and at
            else:
                assert low == pytest.approx(1.0 - confidence)
