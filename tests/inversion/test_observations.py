"""Observations, and what memory they and a fit of many geometries take."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.observations import Observations

SIZE = 20_000


@pytest.fixture(scope="module")
def dataset():
    rng = np.random.default_rng(0)
    angles = *np.radians(75) * rng.random((2, SIZE)), 2.0 * np.pi * rng.random(SIZE)
    stokes = pbrdf.DoubleGauss(sigma=0.04, n=1.5, a=1.0, k=1.2, b=0.2, t=0.5).stokes(*angles)
    std = 0.01 * stokes[:, 0]
    columns = {c: stokes[:, i] + std * rng.standard_normal(SIZE) for i, c in enumerate("IQU")}
    return pbrdf.make_dataset(*angles, quantity="brdf", std=dict.fromkeys(columns, std), **columns)


def peak_of(function):
    """Result, and bytes that NumPy holds more at the highest."""
    tracemalloc.start()
    try:
        return function(), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_no_copies_of_the_data_set(dataset):
    """Beside values, uncertainties and scale, which stay, little more than masks."""
    found, peak = peak_of(lambda: Observations.from_dataset(dataset))
    assert peak < 1.3 * (found.values.nbytes + found.std.nbytes + found.scale.nbytes)
    assert np.shares_memory(found.theta_i, dataset["theta_i"].values)


def test_absent_values_leave_the_data_set_alone(dataset):
    changed = dataset.copy(deep=True)
    changed["Q"][3], changed["U_std"][5] = np.nan, np.nan
    before = changed.copy(deep=True)
    found = Observations.from_dataset(changed)
    assert changed.identical(before)
    assert found.count == 3 * SIZE - 2 and found.unstated == 1
    assert found.values[1, 3] == 0.0 and found.std[1, 3] == np.inf
    assert found.values[2, 5] == 0.0 and found.std[2, 5] == np.inf


@pytest.mark.slow
def test_memory_of_a_fit(dataset):
    """NumPy holds at most as much as the data set and the comparison that is returned."""
    pbrdf.fit(dataset, starts=4)
    result, peak = peak_of(lambda: pbrdf.fit(dataset, starts=4))
    comparison = sum(v.nbytes for v in result.comparison.data_vars.values())
    assert peak < sum(v.nbytes for v in dataset.variables.values()) + comparison
