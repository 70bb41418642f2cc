"""The light source of a goniometer."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.source import Source


def test_radiances_scatter_by_the_stability():
    radiances = Source(stability=0.01).radiances(20_000, np.random.default_rng(1))
    assert radiances.mean() == pytest.approx(1.0, abs=4 * 0.01 / np.sqrt(20_000))
    assert radiances.std() == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Source(angular_radius=-0.1), "angular radius"),
        (lambda: Source(angular_radius=1.0), "angular radius is 57.3°"),
        (lambda: Source(stability=np.nan), "stability"),
        (lambda: Source(polarisation=(0.9, 0.9, 0.0)), "together at most 1"),
    ],
)
def test_numbers_out_of_range_are_refused(make, message):
    with pytest.raises(DataError, match=message):
        make()
