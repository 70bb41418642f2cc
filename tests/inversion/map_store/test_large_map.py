"""A map of 10⁸ pixels: planned in no time, done unit by unit in bounded memory."""

from __future__ import annotations

import sys

import pytest

pytest.importorskip("zarr")

from stand_in_fit import EndlessSource, StandInFit, work_on_a_large_map

from pbrdf.errors import DataError
from pbrdf.inversion.map_store import open_map, prepare_store

#: Bytes of a unit's input and results: 2¹⁶ pixels of 42 geometries, and some ten numbers.
UNIT = 2**16 * 8 * (42 + 12)


def test_the_template_of_a_large_map_is_a_few_small_files(tmp_path):
    store = prepare_store(
        tmp_path / "maps.zarr", StandInFit({"y": 10_000, "x": 10_000}), EndlessSource(10_000, 10_000, 42)
    )
    assert store.grid.count == 1600 and store.grid.shard == (256, 256) and store.grid.chunk == (64, 64)
    files = [file for file in store.path.rglob("*") if file.is_file()]
    assert len(files) < 20 and sum(file.stat().st_size for file in files) < 100_000
    with pytest.raises(DataError, match="1600 of 1600 units are missing"):
        open_map(store.path)
    planned = open_map(store.path, partial=True)
    assert planned["estimate"].shape == (3, 10_000, 10_000)
    assert planned["estimate"][:, 5000, 7000].isnull().all()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory as Linux tells it")
def test_a_part_of_a_large_map_is_done_in_bounded_memory(tmp_path, processes):
    queue = processes.SimpleQueue()
    process = processes.Process(target=work_on_a_large_map, args=(tmp_path / "maps.zarr", queue))
    process.start()
    count, work, _, memory = queue.get()
    process.join()
    assert process.exitcode == 0
    assert (work.done, work.left) == (4, count - 4)
    # the input, copies of it that the stand-in makes, results, and their packed form; the map itself has 10 GB
    assert memory < 8 * UNIT
    files = [file for file in (tmp_path / "maps.zarr" / "estimate" / "c").rglob("*") if file.is_file()]
    assert len(files) == 4
