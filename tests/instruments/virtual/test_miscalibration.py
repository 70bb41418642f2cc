"""Simulated miscalibration has the stated size."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.instruments.polarimeter.polarimeter import lcvr, measured
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.virtual.miscalibration import miscalibrated

NOMINAL = lcvr(retardance_set("six_states"))


@pytest.mark.parametrize(("linear", "circular"), [(0.01, 0.05), (0.017, 0.088), (0.0, 0.03)])
def test_rms_errors_at_fully_polarised_light(linear, circular):
    """Random fully polarised light through 600 instruments, reduced as if they were nominal: rms errors of Q/I, U/I
    are the linear accuracy, of V/I the circular one; of the degree of linear polarisation, for linear light, the
    linear one. The intensity is right."""
    rng = np.random.default_rng(1)
    ratios, degree = [], []
    for _ in range(600):
        truth = miscalibrated(NOMINAL, linear, circular, rng)
        p = rng.normal(size=(3, 50))
        light = np.concatenate([np.ones((1, 50)), p / np.linalg.norm(p, axis=0)])
        found = np.linalg.pinv(NOMINAL.analyzer) @ truth.intensities(light)
        ratios.append(found - light)
        psi = rng.uniform(0, np.pi, 50)
        light = np.stack([np.ones(50), np.cos(2 * psi), np.sin(2 * psi), np.zeros(50)])
        found = np.linalg.pinv(NOMINAL.analyzer) @ truth.intensities(light)
        degree.append(np.hypot(found[1], found[2]) / found[0] - 1)
    rms = np.sqrt(np.mean(np.square(ratios), axis=(0, 2)))
    np.testing.assert_allclose(rms, [0, linear, linear, circular], rtol=0.1, atol=1e-12)
    assert np.sqrt(np.mean(np.square(degree))) == pytest.approx(linear, rel=0.1, abs=1e-4)


def test_instruments_differ_and_seeds_repeat():
    a, b, c = (miscalibrated(NOMINAL, 0.01, 0.05, np.random.default_rng(s)).analyzer for s in (1, 1, 2))
    assert (a == b).all() and (a != c).any()


def test_nothing_stated_is_nothing_changed():
    same = miscalibrated(NOMINAL, 0.0, 0.0, np.random.default_rng(0))
    np.testing.assert_array_equal(same.analyzer, NOMINAL.analyzer)
    assert same.states == NOMINAL.states and "as it really is" in same.name


def test_maps_err_alike_all_over_the_field():
    truth = miscalibrated(
        measured(np.tile(NOMINAL.analyzer, (2, 2, 1, 1))), 0.01, 0.05, np.random.default_rng(0)
    )
    np.testing.assert_array_equal(truth.analyzer, np.tile(truth.analyzer[0, 0], (2, 2, 1, 1)))
