import numpy as np
from numpy.testing import assert_array_equal

from pbrdf.optics.angles import within_half_turn


def test_angles_are_brought_within_half_a_turn():
    """The upper end belongs to the range, the lower one does not; degrees and half turns of axes likewise."""
    assert_array_equal(within_half_turn([0.0, np.pi, -np.pi, 3 * np.pi]), [0.0, np.pi, np.pi, np.pi])
    assert_array_equal(within_half_turn([-180.0, 190.0, 541.0], 180.0), [180.0, -170.0, -179.0])
    assert_array_equal(within_half_turn([90.0, -90.0, 100.0], 90.0), [90.0, 90.0, -80.0])
