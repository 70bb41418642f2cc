"""Specimens drawn and seen: against the model's own evaluation, one specimen after the other."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.identification.library import bundled_library
from pbrdf.identification.predictive import specimens_shown, typical_gains
from pbrdf.inversion.observations import Observations

WHITE = bundled_library()["white"]


@pytest.fixture(scope="module")
def observed():
    return Observations.from_dataset(pbrdf.open_experiment("white").isel(geometry=slice(0, 21, 4)))


def test_many_specimens_are_what_the_model_says_of_each(observed):
    drawn = WHITE.draw(3, np.random.default_rng(1))
    shown = specimens_shown(WHITE, drawn, observed, ("I", "Q", "dolp"))
    for number, values in enumerate(drawn):
        stokes = WHITE.space.build(values).stokes(observed.theta_i, observed.theta_r, observed.phi)
        assert shown["I"][number] == pytest.approx(stokes[:, 0], rel=1e-9)
        assert shown["Q"][number] == pytest.approx(stokes[:, 1], rel=1e-9, abs=1e-12)
        assert shown["dolp"][number] == pytest.approx(pbrdf.dolp(stokes), rel=1e-6, abs=1e-12)


def test_the_gain_that_made_the_data_is_found(observed):
    (values,) = WHITE.draw(1, np.random.default_rng(2))
    shown = specimens_shown(WHITE, values[None], observed, observed.channels)
    measured = np.stack([3.5 * shown[name][0] for name in observed.channels])
    made = Observations(**{**vars(observed), "values": measured})
    assert typical_gains(WHITE, values[None], made) == pytest.approx([3.5])


def test_no_geometry_no_values(observed):
    nowhere = Observations(
        *(np.empty(0),) * 3, ("I",), np.empty((1, 0)), np.empty((1, 0)), observed.illumination, True
    )
    assert specimens_shown(WHITE, WHITE.draw(2, np.random.default_rng(3)), nowhere, ["I"])["I"].shape == (
        2,
        0,
    )
