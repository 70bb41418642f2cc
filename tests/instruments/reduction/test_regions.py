"""Which pixels belong to a region."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

from pbrdf.errors import DataError
from pbrdf.instruments.reduction.regions import (
    Ellipse,
    LabelRegion,
    Polygon,
    Rectangle,
    require_inside,
    rows_of,
)

ROWS, COLUMNS = 40, 50


def whole(region):
    return region.mask(0, ROWS, COLUMNS)


def test_a_rectangle_is_a_slice():
    expected = np.zeros((ROWS, COLUMNS), bool)
    expected[30:39, 10:20] = True
    np.testing.assert_array_equal(whole(Rectangle(10, 20, 30, 39)), expected)


def test_a_pixel_belongs_where_its_centre_is():
    # edges in the middle of pixels: 10.4 takes pixel 10 in, 19.6 takes pixel 19 in, 10.6 and 19.4 do not
    assert np.flatnonzero(whole(Rectangle(10.4, 19.6, 0, 40))[0]).tolist() == list(range(10, 20))
    assert np.flatnonzero(whole(Rectangle(10.6, 19.4, 0, 40))[0]).tolist() == list(range(11, 19))


def test_an_ellipse_has_its_area_and_place():
    mask = whole(Ellipse(25.0, 18.0, 20.0, 12.0))
    assert mask.sum() == pytest.approx(math.pi * 20.0 * 12.0, rel=0.02)
    rows, columns = np.nonzero(mask)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (5, 44, 6, 29)
    np.testing.assert_array_equal(mask, mask[:, ::-1])


@given(st.lists(st.tuples(st.integers(0, 166), st.integers(0, 133)), min_size=3, max_size=7, unique=True))
def test_a_polygon_is_what_matplotlib_says(points):
    """Even-odd filling, compared with matplotlib's for polygons that do not cross themselves: sorted about a centre."""
    points = [(0.3 * x, 0.3 * y) for x, y in points]
    centre = np.mean(points, axis=0)
    order = sorted(points, key=lambda p: math.atan2(p[1] - centre[1], p[0] - centre[0]))
    y, x = np.mgrid[0:ROWS, 0:COLUMNS] + 0.5
    places = np.stack([x.ravel(), y.ravel()], axis=-1)
    outline = Outline([*order, order[0]], closed=True)
    # a centre within a millionth of a pixel of an edge may go either way
    sure = outline.contains_points(places, radius=1e-6) == outline.contains_points(places, radius=-1e-6)
    expected = outline.contains_points(places)
    np.testing.assert_array_equal(whole(Polygon(tuple(order))).ravel()[sure], expected[sure])


def test_a_polygon_that_crosses_itself_has_a_hole():
    # a pentagram: its inner pentagon is surrounded twice
    angles = np.deg2rad(90.0 + 144.0 * np.arange(5))
    star = Polygon(tuple(zip(25 + 18 * np.cos(angles), 20 + 18 * np.sin(angles), strict=True)))
    assert not whole(star)[20, 25]
    assert whole(star)[34, 25]


@pytest.mark.parametrize(
    "region",
    [
        Rectangle(3, 44, 5, 31),
        Ellipse(20, 20, 11, 17),
        Polygon(((2, 3), (48, 9), (20, 38))),
        LabelRegion(np.pad(np.ones((9, 9), int), ((20, 11), (30, 11))), 1),
    ],
)
def test_parts_of_a_mask_are_the_mask(region):
    left, right, top, bottom = region.box
    mask = whole(region)
    np.testing.assert_array_equal(
        np.concatenate([region.mask(a, b, COLUMNS) for a, b in ((0, 7), (7, 8), (8, 40))]), mask
    )
    first, last = rows_of({"it": region})
    assert (first, last) == (math.floor(top), math.ceil(bottom))
    rows, columns = np.nonzero(mask)
    assert rows.min() >= first and rows.max() < last and columns.min() >= left - 0.5 and columns.max() < right
    outline = region.outline()
    np.testing.assert_allclose(outline[0], outline[-1], rtol=1e-12)
    require_inside({"it": region}, ROWS, COLUMNS)


def test_regions_that_make_no_sense_are_named():
    with pytest.raises(DataError, match=r"'paint' .* reaches beyond the picture of 50 columns and 40 rows"):
        require_inside({"paint": Rectangle(10, 60, 0, 10)}, ROWS, COLUMNS)
    with pytest.raises(DataError, match="'dot' holds no pixel's centre"):
        require_inside({"dot": Ellipse(10.0, 10.0, 0.2, 0.2)}, ROWS, COLUMNS)
    with pytest.raises(DataError, match="give the smaller edge first"):
        Rectangle(10, 5, 0, 10)
    with pytest.raises(DataError, match="three corners"):
        Polygon(((0, 0), (1, 1)))
    with pytest.raises(DataError, match="more than 0"):
        Ellipse(1, 1, 0, 1)
    with pytest.raises(DataError, match="has the value 4"):
        LabelRegion(np.eye(3, dtype=int), 4)
    with pytest.raises(DataError, match="picture of labels is"):
        require_inside({"eye": LabelRegion(np.eye(3, dtype=int), 1)}, ROWS, COLUMNS)
