"""Maps at scale: a fit of every pixel written unit by unit into a Zarr store, resumed after a kill, on many machines.

:func:`prepare_store` makes the store, or finds the one that was begun with the same settings and input;
:func:`run_units` and :func:`run_on_scheduler` do what is missing in it; :func:`open_map` reads it when it is complete.
"""

from pbrdf.inversion.map_store.finished_map import open_map
from pbrdf.inversion.map_store.map_source import DatasetSource, MapSource, file_identity
from pbrdf.inversion.map_store.map_store import MapStore, PixelFit, is_map, prepare_store
from pbrdf.inversion.map_store.scheduler import run_on_scheduler
from pbrdf.inversion.map_store.work import Work, run_units

__all__ = [
    "DatasetSource",
    "MapSource",
    "MapStore",
    "PixelFit",
    "Work",
    "file_identity",
    "is_map",
    "open_map",
    "prepare_store",
    "run_on_scheduler",
    "run_units",
]
