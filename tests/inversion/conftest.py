"""What is profiled: noisy measurements of a linear problem, and a small fit of the model."""

from __future__ import annotations

import numpy as np
import pytest
from linear_helpers import design

import pbrdf


@pytest.fixture
def measured():
    rng = np.random.default_rng(5)
    return design() @ [1.0, -2.0, 0.5] + rng.standard_normal(30)


@pytest.fixture(scope="session")
def small_fit():
    """Three free parameters, 21 geometries: weak enough to be asymmetric, small enough for SciPy."""
    dataset = pbrdf.open_experiment("pearl-white")
    tilted = np.flatnonzero((dataset["group"].values == 1) & (np.arange(63) % 2 == 0))
    fix = {"sigma": 0.038, "k": 2.6395, "b": 2.4167}
    return pbrdf.fit(dataset.isel(geometry=tilted), fix=fix, starts=16)
