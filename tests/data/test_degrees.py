from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pbrdf.data.degrees import exact_degrees


def test_whole_degrees_come_back_as_whole_degrees():
    degrees = np.arange(-360.0, 361.0)
    assert_array_equal(exact_degrees(np.deg2rad(degrees)), degrees)


@given(st.floats(-360, 360))
def test_degrees_exist_for_every_angle_that_came_from_degrees(degrees):
    radians = np.deg2rad(np.array([degrees, np.nan]))
    found = exact_degrees(radians)
    assert found is not None
    assert_array_equal(np.deg2rad(found), radians)
    assert np.signbit(found[0]) == np.signbit(degrees)


def test_an_angle_too_large_for_degrees_has_none():
    assert exact_degrees(np.array([1e308])) is None


def test_angles_between_the_images_of_two_degrees_are_reported():
    radians = 0.9 + np.arange(100) * np.spacing(0.9)
    degrees = [exact_degrees(radians[i : i + 1]) for i in range(100)]
    missed = [d is None for d in degrees]
    assert 0 < sum(missed) < 30
    # Brute force: no double nearby has this image.
    for index in np.flatnonzero(missed):
        start = np.rad2deg(radians[index])
        nearby = start + np.arange(-50, 51) * np.spacing(start)
        assert radians[index] not in np.deg2rad(nearby)
