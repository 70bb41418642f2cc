"""Units on the workers of a Dask scheduler, of which one is killed."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings

import pytest

pytest.importorskip("zarr")
pytest.importorskip("distributed")

import distributed
from stand_in_fit import contents, picture, store_at

from pbrdf.errors import DataError
from pbrdf.inversion.map_store import open_map, run_on_scheduler, run_units, scheduler

pytestmark = [
    pytest.mark.slow,
    # what Dask leaves open where workers die is none of ours
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]


def cluster(monkeypatch, **options):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"} | options
    return distributed.LocalCluster(processes=True, silence_logs=50, **options)


def test_a_worker_of_two_is_killed_in_the_middle(tmp_path, monkeypatch):
    dataset = picture(80, 80)
    run_units(store_at(tmp_path / "undisturbed.zarr", dataset))
    store = store_at(tmp_path / "maps.zarr", dataset, delay=0.05)
    store_at(tmp_path / "undisturbed.zarr", dataset)  # the delay decides no number
    seen, killed = [], []
    with cluster(monkeypatch) as workers, distributed.Client(workers) as client:
        pids = client.run(os.getpid)
        done = threading.Event()

        def progress(finished, total):
            seen.append((finished, total))
            if finished == 6 and not killed:
                killed.append(next(iter(pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        work = run_on_scheduler(store, workers.scheduler_address, progress=progress)
        done.set()
        deadline = time.monotonic() + 30.0
        while killed[0] in client.run(os.getpid).values() and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not any(
            client.run(lambda dask_worker: [n for n in dask_worker.plugins if "map" in n]).values()
        )
    assert work.left == 0 and work.done == 25 and work.found == 0
    assert seen[0] == (0, 25) and seen[-1] == (25, 25)
    assert contents(store.path) == contents(tmp_path / "undisturbed.zarr")
    assert open_map(store.path).sizes == {"parameter": 3, "y": 80, "x": 80}
    # nothing is left to do, so no scheduler is asked
    assert run_on_scheduler(store, "tcp://nowhere:1").found == 25


def test_a_unit_that_fails_is_one_line_and_what_is_done_is_kept(tmp_path, monkeypatch):
    store = store_at(tmp_path / "maps.zarr")
    with cluster(monkeypatch) as workers:
        other = store_at(tmp_path / "maps.zarr")
        other.digest = "another"
        with pytest.raises(DataError, match="this map was begun with other settings"):
            run_on_scheduler(other, workers.scheduler_address)
        (store.path / "estimate" / "c" / "0" / "2").mkdir(parents=True)
        (store.path / "estimate" / "c" / "0" / "2" / "1").mkdir()
        with pytest.raises(DataError, match=r"maps\.zarr: unit 5 cannot be written: .*what is done is kept"):
            run_on_scheduler(store, workers.scheduler_address)
        (store.path / "estimate" / "c" / "0" / "2" / "1").rmdir()
        assert run_on_scheduler(store, workers.scheduler_address).left == 0


def test_workers_of_many_threads_and_schedulers_that_are_not_there(tmp_path, monkeypatch):
    store = store_at(tmp_path / "maps.zarr")
    with (
        cluster(monkeypatch, n_workers=1, threads_per_worker=2) as workers,
        pytest.raises(DataError, match="has 2 threads: start workers with --nthreads 1"),
    ):
        run_on_scheduler(store, workers.scheduler_address)
    monkeypatch.setattr(scheduler, "_PATIENCE", 1)
    with pytest.raises(DataError, match=r"scheduler tcp://127\.0\.0\.1:9: cannot be reached"):
        run_on_scheduler(store, "tcp://127.0.0.1:9")
    with (
        cluster(monkeypatch, n_workers=0) as workers,
        pytest.raises(DataError, match="no worker came within"),
    ):
        run_on_scheduler(store, workers.scheduler_address)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with warnings.catch_warnings(), pytest.raises(DataError, match=r"pip install 'pbrdf\[distributed\]'"):
        run_on_scheduler(store, "tcp://127.0.0.1:9")
