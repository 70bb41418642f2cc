"""What runs on the workers of a Dask scheduler; imported only where there is Dask."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from distributed import WorkerPlugin, get_worker

from pbrdf.errors import DataError
from pbrdf.inversion.map_store.map_store import MapStore
from pbrdf.version import __version__

__all__ = ["Carrier", "do_unit", "machine_of"]


class Carrier(WorkerPlugin):
    """Brings a store to a worker.

    Attributes
    ----------
    store
        The store.
    machines
        How many workers there are on each machine, which share its cores.
    """

    def __init__(self, store: MapStore, machines: Mapping[str, int]) -> None:
        self.store = store
        self.machines = machines
        self._version = __version__

    def setup(self, worker: Any) -> None:
        """Take the store; raises DataError if it comes from another version of pbrdf."""
        if self._version != __version__:
            raise DataError(
                f"worker {worker.address} has pbrdf {__version__}, where the map is made by {self._version}"
            )
        self._threads = self.machines.get(machine_of(worker.address), 1)
        self._lock = threading.Lock()
        self._ready = False

    def do(self, number: int) -> None:
        """Do a unit, one at a time, unless it is done."""
        with self._lock:
            if not self._ready:
                _use_cores(self._threads)
                self._ready = True
            if not self.store.is_done(number):
                self.store.do(number)


def do_unit(number: int, carrier: str) -> int:
    """Do a unit of the store that the plugin of this name has brought; returns its number."""
    plugin: Any = get_worker().plugins[carrier]
    plugin.do(number)
    return number


def machine_of(address: str) -> str:
    """The machine of a worker ``tcp://10.0.0.7:40123``."""
    return urlsplit(address).hostname or address


def _use_cores(sharing: int) -> None:
    """Give Dr.Jit a thread for each core that this process may use, divided by the workers of the machine."""
    import drjit as dr
    from dask.system import cpu_count

    from pbrdf.backend import get_backend

    get_backend()
    dr.set_thread_count(max(cpu_count() // sharing, 1))
