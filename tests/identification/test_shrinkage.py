"""Shrunk covariances, against scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.identification.shrinkage import ledoit_wolf


@pytest.mark.parametrize("count", [2, 3, 10, 200])
def test_as_scikit_learn_has_it(count):
    covariance = pytest.importorskip("sklearn.covariance", reason="the oracle is scikit-learn")
    random = np.random.default_rng(count)
    samples = random.standard_normal((count, 6)) @ np.diag([1.0, 2.0, 0.5, 1.0, 1.5, 0.1]) + 3.0
    found, share = ledoit_wolf(samples)
    oracle = covariance.LedoitWolf().fit(samples)
    assert share == pytest.approx(oracle.shrinkage_, abs=1e-12)
    assert found == pytest.approx(oracle.covariance_, abs=1e-12)


def test_many_samples_are_hardly_shrunk():
    random = np.random.default_rng(1)
    true = np.array([[2.0, 0.9], [0.9, 1.0]])
    found, share = ledoit_wolf(random.standard_normal((100_000, 2)) @ np.linalg.cholesky(true).T)
    assert share < 1e-3
    assert found == pytest.approx(true, abs=0.03)
