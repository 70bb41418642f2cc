"""Doing the units of a map on the workers of a Dask scheduler.

Each worker is a process of one thread: Dr.Jit's own threads use the cores of its machine, so one process a machine is
best. What is fitted travels once to each worker, with a plugin, and to those that come later. A unit is a task that
returns its number and nothing else. A task that fails, or whose worker dies, is tried again; a unit that is done by
then is not done again.
"""

from __future__ import annotations

import importlib.util
import secrets
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from pbrdf.errors import DataError, PbrdfError
from pbrdf.inversion.map_store.finished_map import finish
from pbrdf.inversion.map_store.map_store import MapStore
from pbrdf.inversion.map_store.work import Work

__all__ = ["run_on_scheduler"]

#: How often a unit whose task failed is tried again.
_RETRIES = 3
#: Seconds to wait for the scheduler, and for its first worker.
_PATIENCE = 60


def run_on_scheduler(
    store: MapStore, address: str, *, progress: Callable[[int, int], None] | None = None
) -> Work:
    """Do the units of a map that are missing on the workers of a Dask scheduler.

    Parameters
    ----------
    store
        What :func:`pbrdf.inversion.map_store.prepare_store` gives; all workers see its folder, and the files of its
        source, under the same names.
    address
        Of the scheduler, ``tcp://head:8786``.
    progress
        Called with the number of finished units and of all.

    Raises
    ------
    DataError
        If Dask is not installed, there is no scheduler or worker, a worker has more than one thread or another version
        of pbrdf, or a unit fails for good; what is done is kept.
    """
    if importlib.util.find_spec("distributed") is None:
        raise DataError(f"scheduler {address}: needs the package dask: pip install 'pbrdf[distributed]'")
    from distributed import as_completed

    from pbrdf.inversion.map_store.dask_worker import do_unit

    store.clear_up()
    missing = store.missing()
    found = store.grid.count - len(missing)
    if progress is not None:
        progress(found, store.grid.count)
    if missing:
        with _client(address) as client, _carried(client, store) as carrier:
            ended = as_completed(
                client.map(
                    do_unit,
                    missing,
                    carrier=carrier,
                    key=[f"{carrier}-unit-{number}" for number in missing],
                    retries=_RETRIES,
                ),
                loop=client.loop,
            )
            for number, future in enumerate(ended, start=1):
                if future.status != "finished":
                    raise _failure(store, future)
                if progress is not None:
                    progress(found + number, store.grid.count)
    return Work(len(missing), found, finish(store))


def _failure(store: MapStore, future: Any) -> DataError:
    """What to say of a unit that failed for good."""
    error = future.exception() if future.status == "error" else None
    if isinstance(error, PbrdfError):
        return DataError(str(error))
    reason = "the scheduler has lost it" if error is None else f"{type(error).__name__}: {error}"
    return DataError(
        f"{store.path}: {future.key} failed on the workers: {' '.join(reason.split())}; what is done is kept, and the "
        "same command goes on from there"
    )


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """Connect to a scheduler that has workers of one thread."""
    from distributed import Client

    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise DataError(f"scheduler {address}: cannot be reached: {' '.join(str(error).split())}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            raise DataError(f"scheduler {address}: no worker came within {_PATIENCE} s") from None
        for worker, threads in client.nthreads().items():
            if threads != 1:
                raise DataError(
                    f"worker {worker} has {threads} threads: start workers with --nthreads 1, as Dr.Jit has its own"
                )
        yield client


@contextmanager
def _carried(client: Any, store: MapStore) -> Iterator[str]:
    """Bring a store to all workers, those that come later too; yields the name of the plugin there."""
    from pbrdf.inversion.map_store.dask_worker import Carrier, machine_of

    name = f"map-{secrets.token_hex(4)}"
    client.register_plugin(Carrier(store, Counter(map(machine_of, client.nthreads()))), name=name)
    try:
        yield name
    finally:
        client.unregister_worker_plugin(name)
