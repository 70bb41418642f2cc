import numpy as np
from numpy.testing import assert_array_equal

from pbrdf.optics.angles import radians_within_a_turn, within_half_turn


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
