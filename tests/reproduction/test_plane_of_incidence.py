import numpy as np
import pytest

import pbrdf
from pbrdf.reproduction.plane import in_plane, offsets, turned, zero_crossings

PAINT = pbrdf.load_paint("matte-white-thick")


def test_positive_angles_of_view_are_forward_and_negative_ones_backward():
    found = in_plane(PAINT, 0.6, [0.4, -0.4])
    expected = PAINT.stokes(0.6, 0.4, [0.0, np.pi])
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_a_source_beyond_the_normal_is_the_mirror_image():
    """θ_i < 0 puts the source on the viewer's side: the same light as with both signs changed."""
    np.testing.assert_allclose(in_plane(PAINT, -0.3, 0.5), in_plane(PAINT, 0.3, -0.5), rtol=1e-12)
    assert in_plane(PAINT, -0.3, 0.5)[0] != pytest.approx(in_plane(PAINT, 0.3, 0.5)[0], rel=1e-3)


def test_the_parts_add_up():
    view = np.deg2rad([-60.0, 0.0, 30.0, 50.0])
    parts = in_plane(PAINT, 0.6, view, "specular") + in_plane(PAINT, 0.6, view, "diffuse")
    np.testing.assert_allclose(in_plane(PAINT, 0.6, view), parts, rtol=1e-12)


def test_a_turning_sample_keeps_the_bistatic_angle_and_theta_r_grows_to_the_right():
    positions = np.deg2rad([60.0, 80.0])
    theta_i, theta_r = turned(positions, offsets(5.0, 0.5))
    assert theta_i.shape == (2, 21)
    np.testing.assert_allclose(theta_i + theta_r, np.broadcast_to(positions[:, None], (2, 21)))
    assert (np.diff(theta_r) > 0.0).all()
    np.testing.assert_allclose(theta_i[:, 10], positions / 2.0)


def test_zeros_are_found_between_points():
    x = np.linspace(0.0, 7.0, 701)
    np.testing.assert_allclose(zero_crossings(x, np.cos(x)), [np.pi / 2, 3 * np.pi / 2], atol=1e-5)
    assert zero_crossings(x, np.ones_like(x)).size == 0
