"""Lines of sight and lamps in the camera's axes."""

import math

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera


def test_lines_of_sight_are_those_of_a_pinhole():
    """A pixel at the right edge of a field of view of 40° is seen from 20° on its left; above, from below."""
    camera = PixelCamera(field_of_view=math.radians(40.0)).sized(100, 200)
    right = camera.view(np.array(200.0), np.array(50.0))
    assert right == pytest.approx([-math.sin(math.radians(20.0)), 0.0, math.cos(math.radians(20.0))])
    above = camera.view(np.array(100.0), np.array(10.0))
    assert above[0] == 0.0 and above[1] < 0.0 < above[2]
    assert camera.place(right) == pytest.approx((200.0, 50.0))
    assert PixelCamera().sized(3, 4).view(np.array(1.0), np.array(1.0)) == pytest.approx([0.0, 0.0, 1.0])


def test_directions_and_distances_of_lamps():
    lamp = Lamp(math.radians(30.0), math.radians(90.0), 2.0)
    assert lamp.direction == pytest.approx([0.0, 0.5, math.sqrt(0.75)])
    point = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    direction, irradiance = lamp.seen_from(point)
    to_lamp = 2.0 * lamp.direction - point
    assert np.cross(direction, to_lamp) == pytest.approx(np.zeros((2, 3)), abs=1e-12)
    assert irradiance == pytest.approx([1.0, 4.0 / (to_lamp[1] @ to_lamp[1])])
    assert Lamp(0.3, 1.0).seen_from(point)[1] is None
    again = Lamp.towards(3.0 * lamp.direction)
    assert (again.polar, again.azimuth) == pytest.approx((lamp.polar, lamp.azimuth))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PixelCamera(focal=3.0, field_of_view=1.0), "give one of them"),
        (lambda: PixelCamera(focal=0.0), "more than 0"),
        (lambda: PixelCamera(field_of_view=math.pi), "between 0 and 180"),
        (lambda: Lamp(-0.1), "give 0 to 180"),
        (lambda: Lamp(0.1, 0.0, 0.0), "must be more than 0"),
        (lambda: PixelCamera().plane(np.ones(1), np.ones(1)), "size of the picture"),
    ],
)
def test_what_cannot_be(make, words):
    with pytest.raises(DataError, match=words):
        make()
