"""A map whose makers are killed: gone on with, it is that of an undisturbed run, byte for byte."""

from __future__ import annotations

import random
import signal
import time

import pytest

pytest.importorskip("zarr")

import stand_in_fit
from stand_in_fit import contents, run_killed_in_a_write, run_process, store_at

from pbrdf.errors import DataError
from pbrdf.inversion.map_store import open_map, run_units


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    path = tmp_path_factory.mktemp("undisturbed") / "maps.zarr"
    run_units(store_at(path))
    return contents(path)


def numbers_are(path, expected):
    """That no unit with its mark holds another number, whatever was killed."""
    store = store_at(path)
    for number in set(range(store.grid.count)) - set(store.missing()):
        key = "/".join(map(str, store.grid.index(number)))
        for name, prefix in (("estimate", "c/0/"), ("chi2", "c/"), ("status", "c/")):
            file = f"{name}/{prefix}{key}"
            assert (path / file).read_bytes() == expected[file]


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path, processes, undisturbed):
    kills, stores = 0, 0
    moments = random.Random(13)
    while kills < 24:
        stores += 1
        path = tmp_path / f"{stores}.zarr"
        while kills < 24:
            ready = processes.Event()
            process = processes.Process(target=run_process, args=(path, 0.004, None, ready))
            process.start()
            assert ready.wait(60)
            time.sleep(moments.uniform(0.0, 0.3))
            process.kill()
            process.join()
            if process.exitcode == 0:
                break
            assert process.exitcode == -signal.SIGKILL
            kills += 1
            if path.exists():
                numbers_are(path, undisturbed)
        run_units(store_at(path))
        assert contents(path) == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize("half", [True, False])
def test_killed_in_the_middle_of_every_file_of_the_first_units(tmp_path, processes, undisturbed, half):
    """Metadata, the arrays of the first unit, its mark, and the next unit."""
    partials = 0
    for number in range(1, 31, 2 if half else 5):
        path = tmp_path / f"{number}.zarr"
        process = processes.Process(target=run_killed_in_a_write, args=(path, number, half))
        process.start()
        process.join()
        assert process.exitcode == -signal.SIGKILL
        if path.exists():
            numbers_are(path, undisturbed)
            with pytest.raises(DataError, match=r"this map is not complete: \d+ of 6 units are missing"):
                open_map(path)
            partials += len(list(path.rglob("*.partial")))
        run_units(store_at(path))
        assert contents(path) == undisturbed
        assert open_map(path).attrs["map_complete"] == 1
    assert partials


@pytest.mark.slow
def test_several_workers_on_the_same_units_at_once(tmp_path, processes, undisturbed):
    path = tmp_path / "maps.zarr"
    working = [
        processes.Process(target=run_process, args=(path, 0.001, worker))
        for worker in (None, None, (1, 2), (2, 2))
    ]
    for process in working:
        process.start()
    for process in working:
        process.join()
        assert process.exitcode == 0
    assert contents(path) == undisturbed
    assert [file.name for file in tmp_path.iterdir()] == ["maps.zarr"]


def test_files_that_a_killed_writer_left_go_after_an_hour(tmp_path, monkeypatch):
    path = tmp_path / "maps.zarr"
    store = store_at(path)
    left = path / "status" / "0.1234.partial"
    left.write_bytes(b"half")
    run_units(store)
    assert left.exists()
    assert open_map(path)["status"].shape == (40, 28)
    later = time.time() + 3700
    monkeypatch.setattr(stand_in_fit.time, "time", lambda: later)
    run_units(store)
    assert not left.exists()
