"""Pixels far from all others: the coarse grid does not know them, and no neighbour starts them."""

import numpy as np
import pytest
from map_helpers import directions, measured, varied

import pbrdf


@pytest.mark.parametrize("place", [(5, 5), (1, 6)])
def test_one_pixel_alone_is_fitted_from_many_starts(place):
    dataset = measured(varied((9, 9)), directions(3))
    dataset["mask"] = (("y", "x"), np.zeros((9, 9), dtype=bool))
    dataset["mask"][place] = True
    found = pbrdf.fit_map(dataset, fix={"n": 1.62}, starts=8)
    assert int(found["status"][place]) == 0
    assert int(found["starts"][place]) > 1
    assert (found["status"].values == 0).sum() == 1
