"""A small reproduction, made once for all tests."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.reproduction.experiment.measurement import Options
from pbrdf.reproduction.run import reproduce


@pytest.fixture(scope="session")
def positions():
    """The bistatic angles of the default experiment, radians."""
    return tuple(np.deg2rad([60.0, 80.0, 100.0]))


@pytest.fixture(scope="session")
def reproduction():
    """Few starts, few pixels; everything else as by default."""
    return reproduce(Options(starts=8, patch=8))


@pytest.fixture(scope="session")
def samples(reproduction):
    """The five inverted samples."""
    return reproduction.samples
