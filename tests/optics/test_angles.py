import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.optics.angles import radians_within_a_turn, rounded_azimuth, within_half_turn, within_turn


def test_angles_are_brought_within_half_a_turn():
    """The upper end belongs to the range, the lower one does not; degrees and half turns of axes likewise."""
    assert_array_equal(within_half_turn([0.0, np.pi, -np.pi, 3 * np.pi]), [0.0, np.pi, np.pi, np.pi])
    assert_array_equal(within_half_turn([-180.0, 190.0, 541.0], 180.0), [180.0, -170.0, -179.0])
    assert_array_equal(within_half_turn([90.0, -90.0, 100.0], 90.0), [90.0, 90.0, -80.0])


def test_whole_turns_of_degrees_leave_nothing():
    """360 k + x is x to the last digit; within a turn, 360° itself too, nothing changes."""
    x = np.array([0.0, 30.0, 90.25, -45.0, 360.0, -360.0, 270.0])
    assert_array_equal(radians_within_a_turn(x), np.deg2rad(x))
    assert_array_equal(radians_within_a_turn(x[:4] + np.sign(x[:4] + 0.5) * 360.0e6), np.deg2rad(x[:4]))
    assert radians_within_a_turn(3600010.0) == np.deg2rad(10.0)


@pytest.mark.parametrize("half_turn", [np.pi, np.pi / 2, 180.0, 90.0])
def test_beside_the_ends_an_angle_stays_in_its_range(half_turn):
    """The numbers next to an end: rounding led half a unit beyond it."""
    ends = np.arange(-9, 10) * half_turn
    for angles in (ends, np.nextafter(ends, np.inf), np.nextafter(ends, -np.inf), ends - 1e-17):
        found = within_half_turn(angles, half_turn)
        assert ((found > -half_turn) & (found <= half_turn)).all()
        assert_allclose(
            np.exp(1j * np.pi / half_turn * found), np.exp(1j * np.pi / half_turn * angles), atol=1e-14
        )
        inside = abs(angles) < half_turn
        assert_array_equal(found[inside], angles[inside])
    assert np.isnan(within_half_turn(np.nan, half_turn))


def test_angles_are_brought_within_a_turn():
    """The remainder of −1e-17 is the whole turn, which does not belong to the range."""
    assert_array_equal(within_turn([-1e-17, -0.0, 2 * np.pi, 1.0, -np.pi]), [0.0, 0.0, 0.0, 1.0, np.pi])
    assert_array_equal(within_turn([-1e-17, 360.0, -10.0, 730.0], 360.0), [0.0, 0.0, 350.0, 10.0])


def test_one_direction_has_one_rounded_azimuth():
    assert_array_equal(rounded_azimuth([0.0, -0.0, -1e-17, -1e-12, 2 * np.pi, -2 * np.pi]), 0.0)
    assert len(set(rounded_azimuth([np.pi, -np.pi, 3 * np.pi, np.pi - 1e-12]))) == 1
