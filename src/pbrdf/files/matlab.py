"""MATLAB files: their arrays of real numbers, whichever version, and these as the lines of a table.

Up to version 7 they are read by :mod:`pbrdf.files.mat5`; those of version 7.3 are HDF5 files, with the dimensions in
reverse. As a table a file is a column for each vector, under its variable's name, and for each single number; of a
matrix with as many columns as there are wavelengths in a vector, a column for each of them. Where vectors differ in
length and arrays run over them, a dimension for each, there is a row for each of their elements.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrdf.errors import DataError
from pbrdf.files.hdf5_guard import Look
from pbrdf.files.mat5 import mat5_arrays
from pbrdf.files.text import first_bytes

__all__ = ["MatlabArray", "is_matlab", "matlab_arrays", "matlab_lines"]

_WAVELENGTHS = ("wavelength", "wavelengths", "lambda", "wvl", "wvls", "wl", "nm", "wavelength_nm")
#: How much deflated numbers can grow: deflate stops at about 1032.
_LARGEST_RATIO = 1100


class MatlabArray(Protocol):
    """An array in a file; :meth:`load` gives its numbers."""

    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def is_real(self) -> bool: ...
    def load(self) -> NDArray[Any]: ...


@dataclass(frozen=True)
class _Mat73Array:
    path: Path
    name: str
    shape: tuple[int, ...]
    is_real: bool

    def load(self) -> NDArray[Any]:
        if not self.is_real:
            raise DataError(f"{self.path}: the variable {self.name} does not hold real numbers")
        with _opened(self.path) as file:
            item = file[self.name]
            if item.nbytes > _LARGEST_RATIO * self.path.stat().st_size:
                raise DataError(
                    f"{self.path}: {self.name} cannot have the shape {self.shape} in a file of this size: it is damaged"
                )
            return np.asarray(item[()]).T


def is_matlab(path: Path) -> bool:
    """Whether a file begins as MATLAB's do, from version 5 on."""
    return first_bytes(path, 7) == b"MATLAB "


def matlab_arrays(path: Path) -> Sequence[MatlabArray]:
    """The arrays of a file by their order in it, none of them loaded.

    Raises
    ------
    DataError
        If the file cannot be read.
    """
    if not first_bytes(path, 10).startswith(b"MATLAB 7.3"):
        return mat5_arrays(path)
    import h5py

    with _opened(path) as file:
        return [
            # what is no array of numbers says of what class it is
            _Mat73Array(
                path, name, tuple(reversed(item.shape)), item.dtype.kind in "iuf" and not _is_text(item)
            )
            for name, item in file.items()
            if isinstance(item, h5py.Dataset)
        ]


def _is_text(item: Any) -> bool:
    return bytes(item.attrs.get("MATLAB_class", b"")) in (b"char", b"cell")


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """An HDF5 file; what goes wrong with it is a DataError."""
    import h5py

    try:
        Look(path, kind="a MATLAB file").require_sound()
        with h5py.File(path) as file:
            yield file
    except DataError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise DataError(f"{path}: cannot be read as a MATLAB file: {' '.join(str(error).split())}") from error
    except MemoryError as error:
        raise DataError(f"{path}: there is not enough memory for what this file declares") from error


def matlab_lines(path: Path) -> list[str]:
    """The vectors of a file as a table: a line of names, then the rows, separated by tabs.

    Raises
    ------
    DataError
        If there are no vectors, they differ in length, or there are other arrays beside them; names the variables.
    """
    arrays = [array for array in matlab_arrays(path) if array.is_real and 0 not in array.shape]
    single = [array for array in arrays if math.prod(array.shape) == 1]
    vectors = [
        array for array in arrays if len(array.shape) == 2 and min(array.shape) == 1 < max(array.shape)
    ]
    matrices: list[MatlabArray] = []
    waves = next((array for array in vectors if array.name.lower() in _WAVELENGTHS), None)
    if waves is not None:
        rows = {max(array.shape) for array in vectors if array is not waves}
        count = max(waves.shape)
        matrices = [
            array for array in arrays if rows - {count} and array.shape in {(row, count) for row in rows}
        ]
        if matrices:
            vectors.remove(waves)
    used = [*vectors, *single, *matrices, *([waves] if matrices else [])]
    lengths = {max(array.shape) for array in vectors}
    grids = [array for array in arrays if sorted(array.shape) == sorted(max(v.shape) for v in vectors)]
    if len(lengths) == len(vectors) > 1 and grids and len(used) + len(grids) == len(arrays):
        return _grid_lines(vectors, single, grids)
    if len(lengths) != 1 or len(used) != len(arrays):
        listed = ", ".join(f"{a.name} ({' x '.join(map(str, a.shape))})" for a in arrays) or "no numbers"
        raise DataError(
            f"{path}: vectors of one length, named like the columns of a table (theta_i, theta_r, phi, brdf), or "
            f"axes of different lengths and arrays over them are needed; this file holds {listed}"
        )
    (length,) = lengths
    columns: dict[str, NDArray[Any]] = {array.name: array.load().ravel() for array in vectors}
    columns |= {array.name: np.full(length, array.load().ravel()[0]) for array in single}
    for array in matrices:
        for nanometres, values in zip(waves.load().ravel(), array.load().T, strict=True):  # type: ignore[union-attr]
            columns[f"{array.name}_{nanometres:g}nm"] = values
    return _lines(columns)


def _grid_lines(
    axes: Sequence[MatlabArray], single: Sequence[MatlabArray], grids: Sequence[MatlabArray]
) -> list[str]:
    """A row for each element of arrays over axes of lengths that all differ, whatever their order."""
    lengths = [max(axis.shape) for axis in axes]
    # first the arrays: that they are as large as they declare shows before anything else is
    values = {
        array.name: array.load().transpose([array.shape.index(n) for n in lengths]).ravel() for array in grids
    }
    mesh = np.meshgrid(*(axis.load().ravel() for axis in axes), indexing="ij")
    columns = {axis.name: nodes.ravel() for axis, nodes in zip(axes, mesh, strict=True)}
    columns |= {array.name: np.full(math.prod(lengths), array.load().ravel()[0]) for array in single}
    return _lines(columns | values)


def _lines(columns: Mapping[str, NDArray[Any]]) -> list[str]:
    cells = [[repr(value) for value in column.tolist()] for column in columns.values()]
    return ["\t".join(columns), *("\t".join(row) for row in zip(*cells, strict=True))]
