"""Where the pixels of a map come from: a data set in memory, or files of which each process reads its units only.

A source says what its input is, so that a map that was begun with another is not gone on with. Of files that are their
size, names, shapes and types of the variables, and the digest of a sample of the bytes: all of a file up to 4 MiB, else
the first and the last MiB and 64 pieces of 16 KiB spread evenly. Measured numbers differ everywhere by their noise, so
that a sample tells two measurements apart without reading terabytes; where the file lies and when it was written does
not count, as machines see it under other names. What is in memory is digested as a whole.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import xarray as xr

from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.files.netcdf_files import open_netcdf
from pbrdf.inversion.map_store.settings import digest_of

__all__ = ["DatasetSource", "FileSource", "MapSource", "file_identity"]

_MIB, _PIECE, _PIECES = 2**20, 2**14, 64
#: A file of up to so many bytes is digested as a whole.
_WHOLE = 4 * _MIB


class MapSource(Protocol):
    """What :func:`pbrdf.inversion.map_store.prepare_store` needs of an input; it can be pickled."""

    def outline(self) -> xr.Dataset:
        """The whole input by its names, dimensions, sizes, types and attributes; values of pixels need not be true."""

    def block(self, slices: Mapping[str, slice]) -> xr.Dataset:
        """The input of some pixels."""

    def identity(self) -> dict[str, Any]:
        """What tells this input from another, as JSON can hold it."""


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """A data set in memory.

    Attributes
    ----------
    dataset
        Of the schema, with further dimensions.
    """

    dataset: xr.Dataset

    def outline(self) -> xr.Dataset:
        """The data set."""
        return self.dataset

    def block(self, slices: Mapping[str, slice]) -> xr.Dataset:
        """Some pixels of it."""
        return self.dataset.isel(dict(slices))

    def identity(self) -> dict[str, Any]:
        """Its variables with a digest of each, and its attributes."""
        return _identity(self.dataset)


@dataclass(frozen=True, eq=False)
class FileSource:
    """Files whose numbers are read when they are asked for, by each process for itself.

    Attributes
    ----------
    paths
        netCDF files or Zarr folders, such as ``stokes.nc`` of ``pbrdf reduce``; several follow each other along
        `along`, and agree in the other dimensions.
    turn
        Makes of the pixels of the files, and those of `beside`, the pixels of a data set of the schema:
        ``turn(stokes, beside, **options)``; a function of a module, each pixel for itself. None: the files hold such
        a data set, and `beside`, if there is one, further variables of it.
    beside
        What belongs to the pixels besides, such as their geometry, in memory.
    options
        Further arguments of `turn`, as JSON can hold them.
    dims
        The dimensions of the map.
    along
        The dimension of the files along which several follow each other.
    """

    paths: tuple[Path, ...]
    turn: Callable[..., xr.Dataset] | None = None
    beside: xr.Dataset | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    dims: tuple[str, ...] = ("y", "x")
    along: str = "series"

    def __getstate__(self) -> dict[str, Any]:
        # each process opens the files for itself
        return {name: value for name, value in vars(self).items() if name != "_opened"}

    @cached_property
    def _opened(self) -> list[xr.Dataset]:
        found = []
        for path in self.paths:
            opened = open_zarr(path, cache=False) if path.is_dir() else open_netcdf(path, cache=False)
            for dim in self.dims:
                if dim not in opened.sizes:
                    raise DataError(
                        f"{path}: there is no dimension {dim}, but {', '.join(map(str, opened.sizes))}"
                    )
                if opened.sizes[dim] != (found or [opened])[0].sizes[dim]:
                    raise DataError(
                        f"{path}: {opened.sizes[dim]} pixels along {dim}, where {self.paths[0]} has "
                        f"{found[0].sizes[dim]}"
                    )
            found.append(opened)
        if self.beside is not None:
            for dim in {*self.dims} & {*self.beside.sizes}:
                if self.beside.sizes[dim] != found[0].sizes[dim]:
                    raise DataError(
                        f"{self.paths[0]}: {found[0].sizes[dim]} pixels along {dim}, where its geometry has "
                        f"{self.beside.sizes[dim]}"
                    )
        return found

    def outline(self) -> xr.Dataset:
        """The whole input without its numbers: what the first pixel gives, as often as there are pixels."""
        first = self.block(dict.fromkeys(self.dims, slice(1)))
        whole = self._opened[0]

        def spread(name: Any, variable: xr.Variable) -> Any:
            if not {*self.dims} & {*variable.dims}:
                return variable
            if name in whole.variables and whole[name].dims == variable.dims == (name,):
                return whole[name].variable
            shape = [whole.sizes[dim] if dim in self.dims else variable.sizes[dim] for dim in variable.dims]
            filled = np.full((), np.nan if variable.dtype.kind == "f" else 0, variable.dtype)
            return variable.dims, np.broadcast_to(filled, shape), variable.attrs

        outlined = {name: spread(name, variable) for name, variable in first.variables.items()}
        return xr.Dataset(
            {name: value for name, value in outlined.items() if name not in first.coords},
            {name: value for name, value in outlined.items() if name in first.coords},
            first.attrs,
        )

    def block(self, slices: Mapping[str, slice]) -> xr.Dataset:
        """Some pixels, loaded."""
        parts = [opened.isel(dict(slices)).load() for opened in self._opened]
        stokes = parts[0] if len(parts) == 1 else xr.concat(parts, self.along, join="exact")
        beside = self.beside
        if beside is not None:
            beside = beside.isel({dim: part for dim, part in slices.items() if dim in beside.sizes})
        if self.turn is not None:
            return self.turn(stokes, beside, **self.options)
        return stokes if beside is None else stokes.merge(beside, join="exact")

    def identity(self) -> dict[str, Any]:
        """Files by their size, variables and the digest of a sample; what is beside them; what is made of them."""
        found: dict[str, Any] = {
            "files": [
                file_identity(path, opened)
                for path, opened in zip(self.paths, self._opened, strict=True)
            ],
            "along": self.along,
        }
        if self.beside is not None:
            found["beside"] = _identity(self.beside)
        if self.turn is not None:
            found["turn"] = {
                "function": f"{self.turn.__module__}.{self.turn.__qualname__}",
                "options": dict(self.options),
            }
        return found


def file_identity(path: Path, opened: xr.Dataset) -> dict[str, Any]:
    """Variables and size of a file, and the digest of a sample of it."""
    forms = {str(name): _form(variable) for name, variable in opened.variables.items()}
    return {"variables": forms, **_sampled(path)}


def _form(variable: xr.Variable) -> str:
    """``float32(series: 4, y: 300, x: 400)``"""
    return f"{variable.dtype}({', '.join(f'{dim}: {size}' for dim, size in variable.sizes.items())})"


def _identity(dataset: xr.Dataset) -> dict[str, Any]:
    variables = {}
    for name, variable in dataset.variables.items():
        values = variable.values
        if values.dtype.kind in "OUT":
            digest = digest_of(values.tolist())
        else:
            digest = hashlib.sha256(np.ascontiguousarray(values)).hexdigest()
        variables[str(name)] = {"form": _form(variable), "digest": digest}
    attrs = {
        str(name): np.asarray(value).tolist() if not isinstance(value, (str, list, dict)) else value
        for name, value in dataset.attrs.items()
    }
    return {"variables": variables, "attributes": attrs}


def _sampled(path: Path) -> dict[str, Any]:
    """Size of a file, or of all files of a folder, and the digest of a sample of the bytes."""
    digest, size = hashlib.sha256(), 0
    try:
        files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
        chunks = [file for file in files if file.suffix != ".json" and not file.name.startswith(".z")]
        read = {*files} - {*chunks} | {*_spread(chunks)}
        for file in files:
            length = file.stat().st_size
            size += length
            if len(files) > 1:
                digest.update(f"{file.relative_to(path).as_posix()} {length}\n".encode())
            if file in read:
                with file.open("rb") as opened:
                    for start, count in _pieces(length, pieces=_PIECES // len(read)):
                        opened.seek(start)
                        digest.update(opened.read(count))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    return {"size": size, "digest": digest.hexdigest()}


def _spread(files: list[Path]) -> Iterator[Path]:
    """So many files as there are pieces, spread evenly; all if there are less."""
    step = max(len(files) / _PIECES, 1.0)
    for number in range(min(len(files), _PIECES)):
        yield files[int(number * step)]


def _pieces(length: int, pieces: int) -> Iterator[tuple[int, int]]:
    """Start and length of what is read of a file."""
    if length <= _WHOLE:
        yield 0, length
        return
    yield 0, _MIB
    for number in range(pieces):
        yield _MIB + number * (length - 2 * _MIB) // pieces, _PIECE
    yield length - _MIB, _MIB
