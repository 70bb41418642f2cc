"""Diattenuation, retardance and depolarisation of measured matrices: their errors against a thousand noisy matrices."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.instruments.reduction.mueller_properties import mueller_properties
from pbrdf.instruments.reduction.mueller_reduction import MuellerMeans
from pbrdf.optics.elements import diattenuator, retarder

PART = np.diag([1.0, 0.8, 0.7, 0.6])


def means_of(matrices, covariance):
    count = len(matrices)
    zero, counts = np.zeros(count), ({"good": 1, "saturated": 0, "dead": 0},) * count
    names = tuple(map(str, range(count)))
    return MuellerMeans(names, np.asarray(matrices, dtype=float), covariance, zero, zero, counts)


def correlated(size):
    """A covariance with correlations, as those of readings are."""
    mix = np.random.default_rng(0).normal(size=(16, 16)) / 4.0
    return size**2 * mix @ mix.T


@pytest.mark.parametrize(
    "matrix",
    [500.0 * PART @ retarder(0.3, 1.0) @ diattenuator(0.1, 0.4), 200.0 * retarder(1.5, 2.0) @ PART],
)
def test_errors_are_those_of_noisy_matrices(matrix):
    covariance = correlated(0.004 * matrix[0, 0])
    noise = np.random.default_rng(1).multivariate_normal(np.zeros(16), covariance, 2000).reshape(-1, 4, 4)
    noisy = mueller_properties(means_of(matrix + noise, np.full((2000, 16, 16), np.nan)))
    found = mueller_properties(means_of([matrix], covariance[None]))
    assert list(found) == [
        "diattenuation", "polarizance", "retardance_deg", "fast_axis_deg", "depolarization",
        "depolarization_index",
    ]  # fmt: skip
    for name, (value, std) in found.items():
        draws, unknown = noisy[name]
        assert np.isnan(unknown).all()
        half_turns = (draws - value + 90.0) % 180.0 - 90.0 if name == "fast_axis_deg" else draws - value
        # edges included: of a diattenuation that is 0 the error is the rms of what noise makes of it
        rms = np.sqrt(np.mean(np.square(half_turns)))
        assert std[0] == pytest.approx(rms, rel=0.1), name


def test_the_angle_of_the_axis_has_no_ends():
    """An axis at 90° is known as well as one at 20°, though noise makes −89.9° of it."""
    covariance = np.broadcast_to(1e-6 * np.eye(16), (2, 16, 16))
    _, std = mueller_properties(means_of(retarder(np.deg2rad([20.0, 90.0]), 1.0), covariance))[
        "fast_axis_deg"
    ]
    assert std[1] == pytest.approx(std[0], rel=0.02)


def test_an_axis_along_y_is_at_plus_90_degrees():
    """Whatever the sign of a U that is nothing."""
    unknown = np.full((2, 16, 16), np.nan)
    axes = means_of(retarder(0.5 * np.pi * np.array([1.0, -1.0]), 1.0), unknown)
    assert mueller_properties(axes)["fast_axis_deg"][0] == pytest.approx([90.0, 90.0], abs=1e-9)


def test_what_is_not_known_is_nan():
    """A polariser has no retardance; without a covariance there are values and no errors, without light nothing."""
    matrices = [diattenuator(0.2), retarder(0.2, 1.0), np.full((4, 4), np.nan)]
    covariance = np.stack([1e-6 * np.eye(16), np.full((16, 16), np.nan), np.full((16, 16), np.nan)])
    found = mueller_properties(means_of(matrices, covariance))
    for name, (value, std) in found.items():
        undetermined = name in ("retardance_deg", "fast_axis_deg", "depolarization")
        assert list(np.isnan(value)) == [undetermined, False, True], name
        assert list(np.isnan(std)) == [undetermined, True, True], name
    assert found["retardance_deg"][0][1] == pytest.approx(np.rad2deg(1.0))
    assert found["fast_axis_deg"][0][1] == pytest.approx(np.rad2deg(0.2))
