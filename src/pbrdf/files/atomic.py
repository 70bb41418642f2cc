"""Files and folders that appear under their names when they are complete, and not at all otherwise."""

from __future__ import annotations

import errno
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pbrdf.errors import DataError

__all__ = ["atomic_file", "atomic_folder", "require_new_folder", "require_writable_folder"]


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to; it replaces `path` when the block ends well, and goes otherwise.

    Raises
    ------
    DataError
        If the folder does not exist or cannot be written to.
    """
    beside = _name_beside(path)
    try:
        yield beside
        beside.replace(path)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        with suppress(OSError):  # the error that matters is the one above
            beside.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path, *, fill: bool = False) -> Iterator[Path]:
    """An empty folder to write into that becomes `path` when the block ends well, and goes otherwise.

    Parameters
    ----------
    path
        The folder; the folders that it lies in are made where they are missing.
    fill
        What to do where there is a folder of that name. By default it is replaced as a whole. If true, the files of the
        same names are replaced and others are left alone; a Zarr store in it is one thing and is replaced as a whole.

    Raises
    ------
    DataError
        If the folder cannot be written, or a file has its name.
    """
    place = path.resolve()
    beside = _name_beside(place)
    made = _missing_parents(place)
    done = False
    try:
        beside.mkdir(parents=True)
        yield beside
        if fill and place.is_dir():
            _move_into(beside, place)
        else:
            _put(beside, place)
        done = True
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        if not done:
            _remove_empty(made)


def require_new_folder(path: Path) -> None:
    """Check before long work that a folder of this name can be made.

    Raises
    ------
    DataError
        If there is something of that name that is not an empty folder, or no folder to put it into.
    """
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise DataError(
            f"{path}: there is something of that name already; choose another folder with --output"
        )
    if not path.resolve().parent.is_dir():
        raise DataError(f"{path}: there is no folder {path.parent}")


def require_writable_folder(path: Path) -> None:
    """Check before long work that a folder of this name can be made or filled, leaving nothing behind.

    Raises
    ------
    DataError
        If it cannot; the message says why.
    """
    if path.exists() and not path.is_dir():
        raise DataError(f"{path}: there is a file of that name; choose another folder with --output")
    place = path.resolve()
    trial = _name_beside(place)
    made = _missing_parents(place)
    try:
        trial.mkdir(parents=True)
        trial.rmdir()
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        _remove_empty(made)


def _name_beside(path: Path) -> Path:
    """A new hidden name in the folder of `path`, for what is to take its place once it is complete."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


def _not_written(path: Path, error: OSError) -> DataError:
    return DataError(f"{path}: cannot be written: {error.strerror or error}")


def _missing_parents(place: Path) -> list[Path]:
    """Folders that have to be made, innermost first."""
    return [parent for parent in place.parents if not parent.exists()]


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def _put(folder: Path, place: Path) -> None:
    """Move a folder to its place; one that is there goes when the new one has taken it, and is put back otherwise."""
    if not place.exists():
        folder.replace(place)
        return
    if not place.is_dir():
        raise FileExistsError(errno.EEXIST, "there is a file of that name")
    old = _name_beside(place)
    place.replace(old)
    try:
        folder.replace(place)
    except OSError:
        old.replace(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _move_into(folder: Path, target: Path) -> None:
    for entry in sorted(folder.iterdir()):
        place = target / entry.name
        if not entry.is_dir():
            entry.replace(place)
        elif entry.suffix == ".zarr":
            _put(entry, place)
        else:
            place.mkdir(exist_ok=True)
            _move_into(entry, place)
