"""The picture in which a sample is looked for, and large ones averaged down."""

import math

import numpy as np
import pytest

from pbrdf.instruments.pixel_geometry import silhouette
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.cylinder import Cylinder
from pbrdf.instruments.pixel_geometry.silhouette import sample_picture
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pixel_helpers import blank, shaded

LAMPS = [Lamp(1.0, 0.0), Lamp(1.0, math.pi)]


def test_the_brightest_of_the_series_counts_and_saturated_is_bright():
    values = np.array([[[1.0, 2.0], [np.nan, 4.0]], [[3.0, 1.0], [np.nan, np.nan]]])
    flags = np.array([[[0, 0], [2, 0]], [[0, 0], [1, 2]]], np.uint8)
    dims = ("series", "y", "x")
    picture, step = sample_picture(blank(2, 2, 2).assign(I=(dims, values), flags=(dims, flags)))
    assert step == 1
    # dead in one series and saturated in the other is bright; dead in one alone is what the other says
    assert picture.tolist() == [[3.0, 2.0], [4.0, 4.0]]


@pytest.mark.parametrize("camera", [PixelCamera(), PixelCamera(focal=400.0)])
def test_large_pictures_are_averaged_down(monkeypatch, camera):
    """Blocks of 4 × 4 pixels, read some rows at a time, tell place and radius to a third of a pixel still, in pixels of
    the whole picture."""
    sized = camera.sized(180, 210)
    ball = Sphere(x=110.3, y=81.8, r=60.4, lamps=LAMPS, camera=sized, max_zenith=1.57)
    pipe = Cylinder(x=110.3, y=90.0, r=40.4, angle=0.5 * math.pi, lamps=LAMPS, camera=sized, max_zenith=1.57)
    monkeypatch.setattr(silhouette, "_MOST_PIXELS", 2500)
    monkeypatch.setattr(silhouette, "_READ", 5000)
    pictures = shaded(ball, 180, 210, fine=2)
    assert sample_picture(pictures)[1] == 4
    found = Sphere(lamps=LAMPS, camera=camera).located(pictures)
    assert (found.x, found.y, found.r) == pytest.approx((110.3, 81.8, 60.4), abs=0.33)
    bar = Cylinder(lamps=LAMPS, camera=camera).located(shaded(pipe, 180, 210, fine=2))
    assert bar.x + (bar.y - 90.0) / math.tan(bar.angle) == pytest.approx(110.3, abs=0.33)
    assert bar.r == pytest.approx(40.4, abs=0.33)
    assert bar.angle == pytest.approx(0.5 * math.pi, abs=5e-3)


def test_lazy_pictures_are_read_only_where_they_are_looked_at():
    """Of a store of chunks I and the flags are read, and nothing of Q and U."""
    pytest.importorskip("dask")
    ball = Sphere(x=60.3, y=51.8, r=40.4, lamps=LAMPS, camera=PixelCamera().sized(100, 120), max_zenith=1.57)
    pictures = shaded(ball, 100, 120, fine=2).chunk(y=50)

    def never(block):
        raise AssertionError("Q was read")

    pictures["Q"] = pictures.Q.copy(
        data=pictures.Q.data.map_blocks(never, meta=np.empty((0, 0, 0), np.float32))
    )
    assert Sphere(lamps=LAMPS).located(pictures).r == pytest.approx(40.4, abs=0.1)
