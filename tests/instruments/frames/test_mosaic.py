"""Pictures of a mosaic camera, taken apart into the frames of its states and put together again."""

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.frames.mosaic import split_mosaic, weave_mosaic
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set


def test_mosaic_cells():
    """[[90, 45], [135, 0]]: the number at the lower right of each cell is that of 0°."""
    polarimeter = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]]))
    picture = np.arange(24).reshape(4, 6)
    split = split_mosaic(picture, polarimeter)
    assert split.shape == (4, 2, 3)
    np.testing.assert_array_equal(split[polarimeter.states.index("0")], [[7, 9, 11], [19, 21, 23]])
    np.testing.assert_array_equal(split[polarimeter.states.index("45")], [[1, 3, 5], [13, 15, 17]])
    stack = split_mosaic(np.stack([picture, picture + 100]), polarimeter)
    np.testing.assert_array_equal(stack, [split, split + 100])


@pytest.mark.parametrize("shape", [(4, 6), (3, 4, 6)])
def test_woven_it_is_the_picture_again(shape):
    polarimeter = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]]))
    picture = np.arange(np.prod(shape), dtype=np.uint16).reshape(shape)
    woven = weave_mosaic(split_mosaic(picture, polarimeter), polarimeter)
    assert woven.dtype == np.uint16
    np.testing.assert_array_equal(woven, picture)


def test_what_is_no_mosaic():
    other = lcvr(retardance_set("six_states"))
    with pytest.raises(DataError, match="no mosaic"):
        split_mosaic(np.ones((4, 4)), other)
    with pytest.raises(DataError, match="whole 2 × 2 cells"):
        split_mosaic(np.ones((4, 5)), division_of_focal_plane([[0.0, 1.0], [2.0, 3.0]]))
    with pytest.raises(DataError, match="no mosaic"):
        weave_mosaic(np.ones((6, 4, 4)), other)
