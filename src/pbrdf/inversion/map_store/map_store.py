"""The store of a map: a Zarr folder, made once and without numbers, then filled unit by unit by whoever comes.

Each unit is one shard of every array. The arrays have the parameters as an axis of their own: one file a unit for the
estimates of all of them. ``status`` is written last and is the mark of a unit that is done. zarr gives a file its name
when it is complete, so a process that is killed leaves units without the mark, and files ``*.partial`` that nobody
reads. A unit depends on its own pixels alone: whoever writes it, and however often, writes the same numbers.

Who reads a store without this package finds in units that are not done what the fit's template holds, which is no
result: NaN, counts below 0, flags and a status that say so. Counts have that as CF's ``_FillValue``, so that xarray
makes NaN of it. ``map_complete`` is 0 until the last step.

The folder's attributes hold the settings that decide the numbers and the identity of the input, as JSON, and their
digest. Whoever wants to write compares the digest before every unit.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import xarray as xr

from pbrdf.data.formats.zarr_folder import create_zarr, is_zarr, list_arrays, require_zarr
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_new_folder
from pbrdf.files.plain_numbers import json_from_text
from pbrdf.files.zarr_chunks import StoredArray, array_names
from pbrdf.inversion.map_store.map_source import MapSource
from pbrdf.inversion.map_store.settings import differences, digest_of, settings_text
from pbrdf.inversion.map_store.unit_grid import UnitGrid

__all__ = [
    "COMPLETE",
    "MARK",
    "NOT_DONE",
    "MapStore",
    "PixelFit",
    "damaged",
    "is_map",
    "prepare_store",
    "stored_attributes",
]

#: Version of the layout of stores; others are refused, but for complete maps of a former one, in which units that were
#: not done held 0 for counts and flags.
_LAYOUT, _FORMER = 2, 1
#: Attributes of the folder: the layout, settings and input as JSON, their digest, and 1 when nothing is missing.
_VERSION, _SETTINGS, _DIGEST, COMPLETE = "map_layout", "map_settings", "map_digest", "map_complete"
#: The array that is written last, and its value where nothing is written yet.
MARK, NOT_DONE = "status", -1
#: Seconds after which a file that a writer has left unfinished is taken for a killed one's.
_OLD = 3600.0


class PixelFit(Protocol):
    """What a store needs of :class:`pbrdf.inversion.parameter_map.MapFit`; it can be pickled."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """What decides the numbers, as JSON can hold it."""

    @property
    def dims(self) -> tuple[str, ...]:
        """The dimensions of the map."""

    def template(self) -> xr.Dataset:
        """The result without its numbers."""

    def fit_block(self, block: xr.Dataset, progress: Callable[[int, int], None] | None = None) -> xr.Dataset:
        """The result of some pixels."""


def prepare_store(
    path: str | Path,
    fit: PixelFit,
    source: MapSource,
    *,
    shard: Mapping[str, int] | None = None,
    chunk: Mapping[str, int] | None = None,
    told: Mapping[str, str] | None = None,
) -> MapStore:
    """Make the store of a map, or find the one that was begun.

    Parameters
    ----------
    path
        The folder, on a disk that all workers share. Workers may all call this at once: the first makes the store.
    fit
        What is fitted, and how.
    source
        The pixels.
    shard, chunk
        Pixels of a unit and of a chunk along dimensions of the map, see
        :meth:`pbrdf.inversion.map_store.unit_grid.UnitGrid.of`; a store that is there keeps its own.
    told
        Attributes of a new store beside those of the fit, which decide nothing.

    Returns
    -------
    MapStore
        What :func:`pbrdf.inversion.map_store.run_units` and :func:`pbrdf.inversion.map_store.run_on_scheduler` fill.

    Raises
    ------
    DataError
        If zarr is not installed, there is something else of that name, the map that is there was begun with other
        settings or another input (says which), or the folder cannot be written.
    """
    path = Path(path)
    require_zarr(path)
    store = MapStore(path, fit, source)
    if not path.exists():
        template = fit.template()
        grid = UnitGrid.of({dim: template.sizes[dim] for dim in fit.dims}, shard, chunk)
        with atomic_new_folder(path) as folder:
            _write_template(folder, template.assign_attrs(told or {}), grid, store.settings)
    store.require_same_settings()
    return store


class MapStore:
    """A store, and what is needed to go on with it; it can be pickled.

    Attributes
    ----------
    path
        The folder.
    fit, source
        What is fitted, and the pixels.
    settings
        What decides the numbers: ``fit``, the settings of the fit, and ``input``, the identity of the source.
    digest
        Of the settings.
    """

    def __init__(self, path: Path, fit: PixelFit, source: MapSource) -> None:
        self.path = path
        self.fit = fit
        self.source = source
        self.settings = {"fit": dict(fit.settings), "input": source.identity()}
        self.digest = digest_of(self.settings)

    def __getstate__(self) -> dict[str, Any]:
        opened = ("_arrays", "grid", "_files")
        return {name: value for name, value in vars(self).items() if name not in opened}

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        """The arrays that units fill, the mark last."""
        import zarr

        try:
            group: Any = zarr.open_group(self.path, mode="r+", zarr_format=3, use_consolidated=False)
            arrays = {name: group[name] for name in array_names(self.path)}
            # a chunk that is left out because it is all fill value could not be told from one that was lost
            found = {
                name: array.with_config({"write_empty_chunks": True})
                for name, array in arrays.items()
                if array.shards is not None and {*self.fit.dims} <= {*array.metadata.dimension_names}
            }
            return {**{name: found[name] for name in sorted({*found} - {MARK})}, MARK: found[MARK]}
        except DataError:
            raise
        except Exception as error:  # the library raises anything over damaged metadata
            raise damaged(self.path, error) from error

    @cached_property
    def _files(self) -> dict[str, StoredArray]:
        return {name: StoredArray.of(self.path, name) for name in self._arrays}

    @cached_property
    def grid(self) -> UnitGrid:
        """The units."""
        mark = self._arrays[MARK]
        return UnitGrid(tuple(mark.metadata.dimension_names), mark.shape, mark.shards, mark.chunks)

    def require_same_settings(self, apart_from: str | None = None) -> None:
        """Check that the store is one of these settings and this input.

        Parameters
        ----------
        apart_from
            Name of a setting that is not known yet, ``fit.shared``.

        Raises
        ------
        DataError
            If it is not; says what differs. If it is an unfinished one of a former layout.
        """
        attributes = stored_attributes(self.path)
        if attributes.get(_DIGEST) == self.digest:
            return
        try:
            stored = json_from_text(str(attributes.get(_SETTINGS)))
        except ValueError as error:
            raise DataError(f"{self.path}: the settings of this map are not JSON: it is damaged") from error
        every = differences(stored, json.loads(settings_text(self.settings)))
        wanted = [said for said in every if apart_from is None or not said.startswith(apart_from)]
        if apart_from is not None and not wanted:
            return
        # digests say that something differs, and the others what
        found = sorted(wanted, key=lambda said: said.partition(":")[0].endswith("digest"))
        more = f"; and {len(found) - 3} more" if len(found) > 3 else ""
        raise DataError(
            f"{self.path}: this map was begun with other settings: {'; '.join(found[:3])}{more}. Choose another "
            "folder, or what that map was begun with"
        )

    def is_done(self, number: int) -> bool:
        """Whether a unit has its mark, and all its files hold what they should."""
        try:
            for name in reversed(self._files):
                self._files[name].require_chunk(self._place(name, number))
        except DataError:
            return False
        return True

    def missing(self, worker: tuple[int, int] | None = None) -> list[int]:
        """Numbers of the units that are not done, of those that are a worker's share."""
        return [number for number in self.grid.share(worker) if not self.is_done(number)]

    def do(self, number: int, progress: Callable[[int, int], None] | None = None) -> None:
        """Fit the pixels of a unit and write what was found.

        Parameters
        ----------
        number
            Of the unit.
        progress
            Called with the number of its pixels that are fitted and of all.

        Raises
        ------
        DataError
            If the store is another one by now, or cannot be written.
        """
        slices = self.grid.slices(number)
        self.write(number, self.fit.fit_block(self.source.block(slices), progress))

    def write(self, number: int, result: xr.Dataset) -> None:
        """Write the result of a unit, its mark last."""
        slices = self.grid.slices(number)
        self.require_same_settings()
        try:
            for name, array in self._arrays.items():
                dims = array.metadata.dimension_names
                values = result[name].transpose(*dims).values
                place = tuple(slices.get(dim, slice(None)) for dim in dims)
                wanted = tuple(
                    len(range(*part.indices(size))) for part, size in zip(place, array.shape, strict=True)
                )
                if values.shape != wanted or values.dtype != array.dtype:
                    raise AssertionError(
                        f"{name}: {values.dtype}{values.shape} of a block instead of {array.dtype}{wanted}"
                    )
                if name == MARK and (values == NOT_DONE).any():
                    raise AssertionError(f"{name}: {NOT_DONE} of a pixel that is done")
                self._remove_damaged(name, number)
                array[place] = values
        except OSError as error:
            raise DataError(
                f"{self.path}: unit {number} cannot be written: {error.strerror or error}; what is done is kept, and "
                "the same command goes on from there"
            ) from error

    def _place(self, name: str, number: int) -> tuple[int, ...]:
        """Place of a unit's file among those of an array."""
        at = dict(zip(self.grid.dims, self.grid.index(number), strict=True))
        return tuple(at.get(dim, 0) for dim in self._arrays[name].metadata.dimension_names)

    def _remove_damaged(self, name: str, number: int) -> None:
        """Remove a file of a unit that zarr could not read: it looks into a shard that is there."""
        index = self._place(name, number)
        try:
            self._files[name].require_chunk(index)
        except DataError:
            self._files[name].file(index).unlink(missing_ok=True)

    def clear_up(self) -> None:
        """Remove the unfinished files that killed writers have left; those of an hour may be at work."""
        for name in self._arrays:
            for file in (self.path / name).rglob("*.partial"):
                with suppress(OSError):
                    if time.time() - file.stat().st_mtime > _OLD:
                        file.unlink()


def stored_attributes(path: Path) -> dict[str, Any]:
    """Attributes of the store of a map.

    Raises
    ------
    DataError
        If there is none, or it is one of another version; complete ones of a former version are read.
    """
    if not path.exists():
        raise DataError(f"{path}: there is no such map")
    if not path.is_dir() or not is_zarr(path):
        raise DataError(f"{path}: there is something else of that name, which is left alone; choose another")
    try:
        content = json_from_text((path / "zarr.json").read_bytes())
        attributes: dict[str, Any] = content["attributes"]
        version = attributes[_VERSION]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path}: this Zarr folder is no map of pbrdf, or it is damaged") from error
    if version != _LAYOUT and not (version == _FORMER and attributes.get(COMPLETE)):
        more = (
            ": counts and flags of 0 in it may be pixels that nobody has come to. Choose another folder, or complete "
            "it with that version"
            if version == _FORMER
            else f"; {_LAYOUT} is known"
        )
        raise DataError(f"{path}: this map has the layout {version}, of another version of pbrdf{more}")
    return attributes


def is_map(path: Path) -> bool:
    """Whether a folder is the store of a map, complete or not."""
    try:
        return _VERSION in json_from_text((path / "zarr.json").read_bytes())["attributes"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def damaged(path: Path, error: Exception) -> DataError:
    """What to say of a store whose arrays cannot be opened."""
    return DataError(f"{path}: this map is damaged: {' '.join(str(error).split()) or type(error).__name__}")


def _write_template(folder: Path, template: xr.Dataset, grid: UnitGrid, settings: dict[str, Any]) -> None:
    """Write all but the numbers of the pixels."""
    import zarr

    names = [name for name, variable in template.data_vars.items() if {*grid.dims} <= {*variable.dims}]
    head = template.drop_vars(names)
    head.attrs = {
        **{name: _plain(value) for name, value in template.attrs.items()},
        _VERSION: _LAYOUT,
        _SETTINGS: settings_text(settings),
        _DIGEST: digest_of(settings),
        COMPLETE: 0,
    }
    create_zarr(head, folder)
    group: Any = zarr.open_group(folder, mode="r+", zarr_format=3, use_consolidated=False)
    units, chunks = (
        dict(zip(grid.dims, grid.shard, strict=True)),
        dict(zip(grid.dims, grid.chunk, strict=True)),
    )
    for name in names:
        variable = template[name].variable
        # what the template holds is what no pixel that is done has
        fill = variable.values[(0,) * variable.ndim]
        attributes = {name: _plain(value) for name, value in variable.attrs.items()}
        if variable.dtype.kind in "iu" and "flag_meanings" not in attributes:
            attributes["_FillValue"] = int(fill)
        # the mark has one file for each unit in the order of the map's dimensions
        dims = grid.dims if name == MARK else variable.dims
        sizes = {dim: max(size, 1) for dim, size in variable.sizes.items()}
        group.create_array(
            str(name),
            shape=tuple(variable.sizes[dim] for dim in dims),
            dtype=variable.dtype,
            shards=tuple(units.get(str(dim), sizes[dim]) for dim in dims),
            chunks=tuple(chunks.get(str(dim), sizes[dim]) for dim in dims),
            fill_value=fill,
            dimension_names=[str(dim) for dim in dims],
            attributes=attributes,
        )
    list_arrays(folder)


def _plain(value: Any) -> Any:
    """An attribute as JSON can hold it."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
