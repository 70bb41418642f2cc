"""Where the pixels of a map come from: a data set in memory, or files of which each process reads its units only.

A source says what its input is, so that a map that was begun with another is not gone on with. Of files that are their
size, names, shapes and types of the variables, labels that are few, and the digest of a sample of the bytes: all of a
file up to 4 MiB, else the first and the last MiB and 64 pieces of 16 KiB spread evenly. Measured numbers differ
everywhere by their noise, so that a sample tells two measurements apart without reading terabytes; where the file lies
and when it was written does not count, as machines see it under other names. What is in memory is digested as a whole.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.inversion.map_store.settings import digest_of

__all__ = ["DatasetSource", "MapSource", "file_identity"]

_MIB, _PIECE, _PIECES = 2**20, 2**14, 64
#: Coordinates of up to so many values are told one by one.
_FEW_LABELS = 64
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


def file_identity(path: Path, opened: xr.Dataset) -> dict[str, Any]:
    """Variables and size of a file, and the digest of a sample of it.

    Parameters
    ----------
    path
        A file, or the folder of a Zarr store.
    opened
        What it holds; no numbers are read but those of short coordinates.

    Raises
    ------
    DataError
        If it cannot be read.
    """
    forms = {str(name): _form(variable) for name, variable in opened.variables.items()}
    try:
        labels = _labels(opened)
    except Exception as error:  # decoders raise anything over a damaged chunk
        raise DataError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    return {"variables": forms, "labels": labels, **_sampled(path)}


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
            digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
        variables[str(name)] = {"form": _form(variable), "digest": digest}
    attrs = {
        str(name): np.asarray(value).tolist() if not isinstance(value, (str, list, dict)) else value
        for name, value in dataset.attrs.items()
    }
    return {"variables": variables, "labels": _labels(dataset), "attributes": attrs}


def _labels(dataset: xr.Dataset) -> dict[str, Any]:
    """Values of the coordinates that have few: digests tell that they differ, and these how."""
    return {
        str(name): np.asarray(coordinate.values).astype(str).tolist()
        for name, coordinate in dataset.coords.items()
        if coordinate.ndim <= 1 and coordinate.size <= _FEW_LABELS
    }


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
