"""How a map is cut into units."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrdf.errors import PbrdfError
from pbrdf.inversion.map_store.unit_grid import UnitGrid


@pytest.mark.parametrize(
    ("sizes", "shard", "chunk"),
    [
        ({"y": 10_000, "x": 10_000}, (256, 256), (64, 64)),
        ({"y": 2048, "x": 100}, (512, 128), (64, 64)),
        ({"sample": 40}, (64,), (64,)),
        ({"time": 1000, "y": 30, "x": 20}, (64, 32, 32), (4, 32, 32)),
        ({"y": 1, "x": 1}, (1, 1), (1, 1)),
        ({"time": 10, "sample": 7, "y": 4000, "x": 4000}, (1, 1, 256, 256), (1, 1, 64, 64)),
    ],
)
def test_units_are_squares_of_whole_chunks_and_cover_the_map_once(sizes, shard, chunk):
    grid = UnitGrid.of(sizes)
    assert (grid.shard, grid.chunk) == (shard, chunk)
    assert math.prod(shard) <= 2**16 and math.prod(chunk) <= 2**12
    if math.prod(sizes.values()) < 10**7:
        seen = np.zeros(tuple(sizes.values()), dtype=int)
        for number in range(grid.count):
            seen[tuple(grid.slices(number).values())] += 1
        assert (seen == 1).all()


def test_lengths_that_are_given_are_kept():
    grid = UnitGrid.of({"y": 70, "x": 50}, {"y": 16, "x": 32}, {"x": 8})
    assert (grid.shard, grid.chunk) == ((16, 32), (16, 8))
    assert grid.grid == (5, 2) and grid.count == 10
    assert grid.slices(9) == {"y": slice(64, 70), "x": slice(32, 50)}
    for shard, chunk in ((12, 12), (200, 50), (251, 251), (96, 48), (320, 64), (6, 6)):
        assert UnitGrid.of({"y": 700, "x": 500}, {"y": shard, "x": 4096 // 64}).chunk[0] == chunk


def test_workers_share_all_units_and_none_twice():
    grid = UnitGrid.of({"y": 70, "x": 50}, {"y": 16, "x": 32})
    shares = [grid.share((i, 4)) for i in range(1, 5)]
    assert sorted(number for share in shares for number in share) == list(range(10)) == list(grid.share(None))
    assert [len(grid.share((i, 30))) for i in (1, 10, 11, 30)] == [1, 1, 0, 0]


def test_what_cannot_be_cut_is_refused():
    for shard, chunk, words in (
        ({"z": 4}, None, "the map has no dimension 'z', but y, x"),
        ({"y": 0}, None, "0 pixels along y"),
        ({"y": 12}, {"y": 8}, "12 pixels along y are not whole chunks of 8"),
    ):
        with pytest.raises(PbrdfError, match=words):
            UnitGrid.of({"y": 70, "x": 50}, shard, chunk)
    for worker in ((0, 4), (5, 4), (1, 0)):
        with pytest.raises(PbrdfError, match="workers are counted from 1"):
            UnitGrid.of({"y": 70}).share(worker)
