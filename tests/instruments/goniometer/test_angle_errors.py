"""The errors of a goniometer's angles."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.angle_errors import AngleErrors
from pbrdf.instruments.goniometer.protocols import Protocol


def test_errors_of_camera_and_zero_stay_within_a_position():
    protocol = Protocol.in_plane(np.deg2rad([50.0, 90.0]), np.deg2rad(np.arange(20.0, 80.0, 5.0)))
    moved = AngleErrors(camera=0.01, zero=0.005).apply(protocol, np.random.default_rng(3))
    for position in (1, 2):
        rows = protocol.group == position
        assert np.ptp((moved.theta_i - protocol.theta_i)[rows]) < 1e-12
        assert np.ptp((moved.bistatic - protocol.bistatic)[rows]) < 1e-12
    assert np.ptp(moved.theta_i - protocol.theta_i) > 1e-4


def test_errors_of_the_sample_angle_differ_from_reading_to_reading():
    protocol = Protocol.in_plane(np.deg2rad([50.0]), np.deg2rad(np.linspace(30.0, 80.0, 2000)))
    moved = AngleErrors(sample=0.002).apply(protocol, np.random.default_rng(3))
    assert (protocol.theta_i - moved.theta_i).std() == pytest.approx(0.002, rel=0.06)
    np.testing.assert_allclose(moved.bistatic, protocol.bistatic, atol=1e-12)


def test_one_kind_of_error_does_not_change_the_draws_of_another():
    protocol = Protocol.in_plane()
    alone, both = (
        e.apply(protocol, np.random.default_rng(5))
        for e in (AngleErrors(sample=1e-3), AngleErrors(sample=1e-3, camera=1e-3))
    )
    np.testing.assert_allclose(alone.theta_i, both.theta_i, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: AngleErrors(sample=-1.0), r"sample is -57\.3°, it must be within 0° … 5\.7°"),
        (lambda: AngleErrors(camera=0.5), "camera is 28.6"),
    ],
)
def test_numbers_out_of_range_are_refused(make, message):
    with pytest.raises(DataError, match=message):
        make()
