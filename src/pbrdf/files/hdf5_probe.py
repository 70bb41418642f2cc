"""A first look at an HDF5 file, made in a process of its own: what it declares, and whether the library survives it.

Run as a script it answers requests, one line of JSON each, until its input ends: ``{"path", "groups"}`` gives
``{"declared": bytes}``, ``{"refused": sentence}`` or ``{"failed": sentence}``. It imports nothing of this package, so
that it starts quickly; :mod:`pbrdf.files.hdf5_guard` starts it, asks it, and ends it when it does not answer.

Nothing is allocated before it is compared with the size of the file: deflate, the strongest common filter, packs at
most 1032 bytes into one, so a file that declares far more than that holds next to nothing of what it declares.

Numbers that were never written read as the fill value, which is 0 where nothing else is said: an array with such chunks
is refused, unless its fill value says that nothing is there (NaN, or CF's ``_FillValue``).
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, TextIO

__all__ = ["RefusedError", "amount", "declared_bytes", "look", "serve"]

#: A file may declare so many times its own size, and so much in any case.
MOST_TIMES_ITS_SIZE = 2000
ALWAYS_ALLOWED = 16 * 2**20
#: Address space that the process may take beyond what it has when it starts to read.
_ROOM = 2**30
#: Values are read in pieces of so many bytes, and not at all where there are more than so many.
_PIECE = 2**25
_MOST_VALUES = 2**27


class RefusedError(Exception):
    """The file declares what it cannot hold, or keeps it elsewhere."""


def look(path: str, groups: Sequence[str]) -> int:
    """Check what groups of a file declare, then read it as netCDF.

    Parameters
    ----------
    path
        The file.
    groups
        Names of the groups, ``"/"`` for the root.

    Returns
    -------
    int
        Bytes of all arrays of these groups.

    Raises
    ------
    RefusedError
        Says what is wrong.
    Exception
        Whatever the library raises.
    """
    import h5netcdf

    total = declared_bytes(path, groups)
    with h5netcdf.File(path, "r", phony_dims="access") as file:
        for name in groups:
            group = file if name == "/" else file[name]
            dict(group.attrs)
            for variable in group.variables.values():
                dict(variable.attrs)
                _ = variable.dimensions, variable.dtype, variable.shape
                _read(variable)
    return total


def _read(variable: Any) -> None:
    """Read all values, in pieces, unless they are very many."""
    if not variable.shape:
        variable[...]
        return
    row = math.prod(variable.shape[1:]) * max(getattr(variable.dtype, "itemsize", 8), 1)
    if 0 in variable.shape or row * variable.shape[0] > _MOST_VALUES:
        return
    step = max(_PIECE // row, 1)
    for first in range(0, variable.shape[0], step):
        variable[first : first + step]


def declared_bytes(path: str, groups: Sequence[str]) -> int:
    """Bytes of all arrays of some groups, each checked against the size of the file.

    Raises
    ------
    RefusedError
        If an array, its chunks or an attribute is larger than the file can hold, or kept in another file; or an array
        was not written as a whole.
    """
    import h5py

    size = os.path.getsize(path)  # noqa: PTH202  no import that is not needed
    most = max(ALWAYS_ALLOWED, MOST_TIMES_ITS_SIZE * size)
    total, unwritten = 0, ""
    with h5py.File(path, "r") as file:
        for name in groups:
            if name != "/" and not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise LookupError(f"there is no group {name!r} in it")
            group, arrays = file[name], []
            _check_attributes(group, f"the group {name!r}", size)
            for key, item in _members(group):
                if isinstance(item, h5py.Dataset):
                    bytes_of = _check_array(item, key, most)
                    _check_attributes(item, f"the variable {key!r}", size)
                    total += bytes_of
                    unwritten = unwritten or _unwritten(item, key)
                    arrays.append((key, item))
            unwritten = unwritten or _too_short(arrays)
    if total > most:
        raise RefusedError(
            f"its variables declare {amount(total)} together, but the file has {amount(size)}: it is damaged"
        )
    if unwritten:
        raise RefusedError(unwritten)
    return total


def _members(group: Any) -> Iterator[tuple[str, Any]]:
    import h5py

    for key in group:
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise RefusedError(f"{key!r} is a link to another file, {link.filename!r}: copy it into this one")
        with suppress(Exception):  # what cannot be opened is told where it is needed
            yield key, group[key]


def _check_array(array: Any, name: str, most: int) -> int:
    import h5py

    layout = array.id.get_create_plist()
    if layout.get_layout() == h5py.h5d.VIRTUAL or layout.get_external_count():
        raise RefusedError(
            f"the variable {name!r} keeps its numbers in another file (external storage): copy them into this one"
        )
    shape = array.id.get_space().get_simple_extent_dims() or ()
    item = max(array.id.get_type().get_size(), 1)
    declared: int = math.prod(shape) * item
    if declared > most:
        raise RefusedError(
            f"the variable {name!r} declares {' × '.join(map(str, shape))} values, {amount(declared)}, which a file "
            "of this size cannot hold: it is damaged"
        )
    if layout.get_layout() == h5py.h5d.CHUNKED and math.prod(layout.get_chunk()) * item > most:
        raise RefusedError(
            f"the variable {name!r} declares chunks of {amount(math.prod(layout.get_chunk()) * item)}, which a file of "
            "this size cannot hold: it is damaged"
        )
    return declared


def _unwritten(array: Any, name: str) -> str:
    """What to say of an array whose missing numbers would be read as the fill value; empty if there are none.

    Of one without chunks it is known only if all are missing.
    """
    import h5py

    shape = array.shape or ()
    # a number alone, and a dimension without numbers, need not be written
    if not shape or 0 in shape or not _has_numbers(array):
        return ""
    layout = array.id.get_create_plist().get_layout()
    if layout == h5py.h5d.CHUNKED:
        needed = math.prod(-(-length // chunk) for length, chunk in zip(shape, array.chunks, strict=True))
        held, what = array.id.get_num_chunks(), "chunks"
    elif layout == h5py.h5d.CONTIGUOUS:
        needed, what = math.prod(shape), "values"
        held = 0 if array.id.get_space_status() == h5py.h5d.SPACE_STATUS_NOT_ALLOCATED else needed
    else:
        return ""
    return _told_unwritten(array, name, held, needed, what) if held < needed else ""


def _too_short(arrays: Sequence[tuple[str, Any]]) -> str:
    """The same of arrays that end before others along a dimension that grows: netCDF fills up what is not there."""
    found = []
    longest: dict[str, int] = {}
    for name, array in arrays:
        growing = [axis for axis, most in enumerate(array.maxshape or ()) if most is None]
        for axis in growing:
            # the numbers of a dimension are along themselves
            own = array.is_scale or not len(array.dims[axis])
            scale = array if own else array.dims[axis][0]
            longest[scale.name] = max(longest.get(scale.name, 0), scale.shape[0], array.shape[axis])
            found.append((name, array, array.shape[axis], scale.name))
    for name, array, length, scale in found:
        if length < longest[scale] and _has_numbers(array):
            what = f"places along {scale.rpartition('/')[2]}"
            if said := _told_unwritten(array, name, length, longest[scale], what):
                return said
    return ""


def _has_numbers(array: Any) -> bool:
    """Whether an array has numbers that mean something where they were not written; MATLAB means 0 by it."""
    try:
        kind = array.dtype.kind
    except TypeError:  # what NumPy has no type for
        return False
    name = array.attrs.get("NAME", b"")
    of_dimension = isinstance(name, bytes) and name.startswith(b"This is a netCDF dimension but not a netCDF")
    return kind in "iufb" and "MATLAB_class" not in array.attrs and not of_dimension


def _told_unwritten(array: Any, name: str, held: int, needed: int, what: str) -> str:
    """What to say of it; empty where the fill value says by itself that nothing is there."""
    import numpy as np

    fill = array.fillvalue
    said = [array.attrs[key] for key in ("_FillValue", "missing_value") if key in array.attrs]
    if fill != fill or any(fill in np.ravel(value) for value in said):
        return ""
    return (
        f"the variable {name!r} holds {held} of its {needed} {what}: the others were never written and would read as "
        f"{fill}. If the program that writes the file was interrupted, run it again; if nothing is to stand there, "
        "give the variable the attribute _FillValue"
    )


def _check_attributes(item: Any, name: str, size: int) -> None:
    import h5py

    for index in range(h5py.h5a.get_num_attrs(item.id)):
        attribute = h5py.h5a.open(item.id, index=index)
        space, kind = attribute.get_space(), attribute.get_type()
        declared = math.prod(space.get_simple_extent_dims() or ()) * kind.get_size()
        if declared > size:
            raise RefusedError(
                f"an attribute of {name} declares {amount(declared)}, more than the file has: it is damaged"
            )


def amount(count: int) -> str:
    """Bytes in words: ``12 kB``, ``3.2 GB``."""
    for unit, size in (("GB", 10**9), ("MB", 10**6), ("kB", 10**3)):
        if count >= size:
            return f"{count / size:.3g} {unit}" if count < 1000 * 10**9 else f"{count / size:.0f} {unit}"
    return f"{count} bytes"


def _limit_memory() -> None:
    """Let the process have a gigabyte more than it has, where the system can hold it to that."""
    try:
        import resource

        with open("/proc/self/statm") as file:  # noqa: PTH123
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + _ROOM, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        pass


def serve(requests: TextIO, answers: TextIO) -> None:
    """Answer requests until there are no more."""
    import h5netcdf  # noqa: F401  before memory is limited

    for line in requests:
        asked = json.loads(line)
        _limit_memory()
        try:
            answer: dict[str, Any] = {"declared": look(asked["path"], asked["groups"])}
        except RefusedError as error:
            answer = {"refused": str(error)}
        except MemoryError:
            answer = {"refused": f"reading it takes more than {amount(_ROOM)} of memory: it is damaged"}
        except Exception as error:  # the library raises anything over a damaged file
            answer = {"failed": " ".join(str(error).split()) or type(error).__name__}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    serve(sys.stdin, sys.stdout)
