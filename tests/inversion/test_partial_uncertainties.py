"""Uncertainties that are stated of some values only."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.data import make_dataset
from pbrdf.inversion.noise import parse_noise
from pbrdf.inversion.observations import Observations


def built(std):
    values = {"I": [0.3, 0.4, 0.5], "Q": [0.1, 0.0, -0.1]}
    return make_dataset(np.deg2rad(30), np.deg2rad([10, 20, 30]), 0.0, quantity="brdf", std=std, **values)


def test_one_gap_leaves_one_value_out_and_keeps_the_others():
    data = Observations.from_dataset(built({"I": [0.01, np.nan, 0.02], "Q": 0.005}))
    assert data.std_known
    assert data.unstated == 1
    assert data.std[0].tolist() == [0.01, np.inf, 0.02]
    assert data.std[1].tolist() == [0.005] * 3
    assert data.values[0].tolist() == [0.3, 0.0, 0.5]
    assert data.count == 5


def test_a_channel_without_any_uncertainty_makes_them_a_guess():
    data = Observations.from_dataset(built({"I": 0.01}))
    assert not data.std_known
    assert data.unstated == 0
    assert data.count == 6


@pytest.mark.parametrize("noise", ["0.02,0.01", "equal"])
def test_stated_noise_serves_all_values(noise):
    data = Observations.from_dataset(built({"I": [0.01, np.nan, 0.02], "Q": 0.005}), parse_noise(noise))
    assert data.unstated == 0
    assert data.count == 6


def test_equal_weights_of_the_paper_need_no_uncertainty():
    data = Observations.from_dataset(built({"I": [0.01, np.nan, 0.02], "Q": 0.005}), objective="paper")
    assert data.unstated == 0
    assert data.count == 6
