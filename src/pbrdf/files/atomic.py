"""Files and folders that appear under their names when they are complete, and not at all otherwise.

What is written lies in a hidden folder beside, ``.NAME.xxxxxxxx.tmp``, until it takes its place by one renaming. The
folder is locked for as long as its process lives; one that a killed process left is known by that, and the next writer
of the same name removes it.

A folder that is there already changes place with the new one in a single step, where the system can do that: whoever
looks, and whenever a process is killed, sees the old one or the new one. To keep what others put into the folder, it is
linked into the new one before. Where that cannot be (the folder is the working directory or a mount point, holds
thousands of other files, or the file system knows no links), files are moved one by one, and :data:`MARK` lies in the
folder meanwhile: :func:`require_whole` refuses a folder with it.
"""

from __future__ import annotations

import ctypes
import errno
import itertools
import os
import re
import secrets
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pbrdf.errors import DataError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = [
    "MARK",
    "atomic_file",
    "atomic_folder",
    "atomic_new_folder",
    "require_new_folder",
    "require_whole",
    "require_writable_folder",
]

#: A file of this name lies in a folder while files are moved into it one by one.
MARK = "INCOMPLETE.txt"
_MARK_TEXT = (
    "Files of two runs are mixed in this folder as long as this one is there: pbrdf was moving new files into it. "
    "If it is not at work any more it was interrupted; run the same command again.\n"
)
#: A folder that is to be made is not meant where its name ends like that of a file.
_FILES = frozenset(
    [
        ".csv",
        ".tsv",
        ".txt",
        ".dat",
        ".nc",
        ".json",
        ".toml",
        ".xlsx",
        ".png",
        ".pdf",
        ".svg",
        ".html",
        ".htm",
        ".tif",
        ".tiff",
        ".npy",
        ".exr",
    ]
)
#: A folder with more files of others than this is filled in place.
_MOST_LINKS = 2000
#: Seconds after which a hidden folder that cannot be locked, or a file of an older version, is taken for a left one.
_OLD = 86400.0
#: Where in the hidden folder an old folder waits while the new one takes its place.
_ASIDE = "old"


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """A name to write to; it replaces `path` when the block ends well, and goes otherwise.

    Raises
    ------
    DataError
        If the folder does not exist or cannot be written to, or the disk is full.
    """
    try:
        with _workspace(path) as space:
            beside = space / path.name
            yield beside
            beside.replace(path)
    except OSError as error:
        raise _not_written(path, error) from error


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
        If the folder cannot be written, a file has its name, or the disk is full.
    """
    place = path.resolve()
    made = _missing_parents(place)
    done = False
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with _workspace(place) as space:
            new = space / place.name
            new.mkdir()
            yield new
            if place.exists() and not place.is_dir():
                raise FileExistsError(errno.EEXIST, "there is a file of that name")
            with _locked_parent(place):
                if not (fill and place.is_dir()):
                    _put(new, place, space)
                elif not (_can_be_exchanged(place) and _links(place, new) and _exchanged(new, place)):
                    _move_in(new, place)
        done = True
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        if not done:
            _remove_empty(made)


@contextmanager
def atomic_new_folder(path: Path) -> Iterator[Path]:
    """An empty folder to write into that becomes `path` when the block ends well, unless another is that by then.

    Of several processes that make the same folder one is first; what the others have written goes.

    Raises
    ------
    DataError
        If the folder cannot be written, or the disk is full.
    """
    try:
        with _workspace(path) as space:
            new = space / path.name
            new.mkdir()
            yield new
            try:
                new.rename(path)
            except OSError:
                # a folder takes no other's place unless that is empty
                if not path.exists():
                    raise
    except OSError as error:
        raise _not_written(path, error) from error


def require_whole(folder: Path) -> None:
    """Check that the files of a folder are those of one run.

    Raises
    ------
    DataError
        If they were being moved into it when the process ended.
    """
    if (folder / MARK).exists():
        raise DataError(
            f"{folder}: files of two runs are mixed in it: the last one was interrupted while it moved them ({MARK}); "
            "run the same command again"
        )


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
    _require_no_name_of_a_file(path)
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
    _require_no_name_of_a_file(path)
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


def _require_no_name_of_a_file(path: Path) -> None:
    if path.suffix.lower() in _FILES and not path.is_dir():
        raise DataError(
            f"{path}: several files are written, into a folder, and this is the name of one; give a "
            f"folder with --output, such as {path.with_suffix('')}"
        )


# The hidden folder


def _name_beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


@contextmanager
def _workspace(path: Path) -> Iterator[Path]:
    """A hidden folder beside `path`, locked while it is in use; those that killed processes left are removed."""
    _clear_up(path)
    while True:
        space = _name_beside(path)
        space.mkdir()
        # another process may take it for a left one before it is locked, and remove it
        try:
            lock = _lock(space)
        except BlockingIOError:
            continue
        if space.exists() if lock is None else _is_there(lock, space):
            break
        if lock is not None:
            os.close(lock)
    try:
        yield space
    finally:
        _remove(space)
        if lock is not None:
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder until the descriptor is closed; None where there are no such locks.

    Raises
    ------
    BlockingIOError
        If another process holds the lock.
    """
    if fcntl is None:
        return None
    descriptor = -1
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return descriptor
    except OSError as error:
        if descriptor >= 0:
            os.close(descriptor)
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            raise BlockingIOError(error.errno, error.strerror) from error
        return None


def _is_there(descriptor: int, folder: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), folder.stat())
    except OSError:
        return False


def _clear_up(path: Path) -> None:
    """Remove what killed processes left beside `path`, and put back what one of them had moved aside."""
    ours = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]{{8}}\.tmp")
    try:
        with os.scandir(path.parent) as entries:
            left = [entry for entry in entries if ours.fullmatch(entry.name)]
    except OSError:
        return
    for entry in left:
        space = Path(entry.path)
        with suppress(OSError):
            old = time.time() - entry.stat(follow_symlinks=False).st_mtime > _OLD
            if not entry.is_dir(follow_symlinks=False):
                if old:
                    space.unlink()
                continue
            lock = _lock(space)
            if lock is None and not old:
                continue
            if (space / _ASIDE).exists() and not path.exists():
                (space / _ASIDE).replace(path)
            _remove(space)
            if lock is not None:
                os.close(lock)


@contextmanager
def _locked_parent(place: Path) -> Iterator[None]:
    """Let no other process change folders beside `place`; one that takes longer than 10 s is not waited for."""
    lock, until = None, time.monotonic() + 10.0
    while lock is None and time.monotonic() < until:
        try:
            lock = _lock(place.parent)
            break
        except BlockingIOError:
            time.sleep(0.01)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


# Taking the place


def _put(new: Path, place: Path, space: Path) -> None:
    """Move a folder to its place; one that is there goes when the new one has taken it, and is put back otherwise."""
    if not place.exists():
        new.replace(place)
    elif not _exchanged(new, place):
        place.replace(space / _ASIDE)
        try:
            new.replace(place)
        except OSError:
            (space / _ASIDE).replace(place)
            raise


def _exchanged(one: Path, other: Path) -> bool:
    """Let two folders change places in one step; False if the system cannot."""
    library = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
    if sys.platform == "darwin":
        call = getattr(library, "renamex_np", None)
        arguments: tuple[object, ...] = (os.fsencode(one), os.fsencode(other), 2)
    else:
        call = getattr(library, "renameat2", None)
        here = -100  # names are relative to the working directory
        arguments = (here, os.fsencode(one), here, os.fsencode(other), 2)
    return call is not None and call(*arguments) == 0


def _can_be_exchanged(place: Path) -> bool:
    """Whether nobody stands in a folder, and another may have its name."""
    with suppress(OSError):
        here = Path.cwd().resolve()
        return not (here == place or place in here.parents or place.is_mount())
    return False


def _links(old: Path, new: Path) -> bool:
    """Link what only the old folder has into the new one; False if there is too much, or it cannot be done."""
    left = _MOST_LINKS

    def fill(source: Path, target: Path) -> None:
        nonlocal left
        with os.scandir(source) as entries:
            found = list(itertools.islice(entries, left + 1))
        for entry in found:
            left -= 1
            if left < 0:
                raise OSError(errno.EMLINK, "too many")
            beside = target / entry.name
            if entry.name == MARK and source == old:
                continue
            if entry.is_dir(follow_symlinks=False):
                if beside.is_file():
                    raise FileExistsError(
                        errno.EEXIST, f"there is a folder {entry.name} in the place of a file"
                    )
                if beside.suffix == ".zarr" and beside.exists():
                    continue
                beside.mkdir(exist_ok=True)
                fill(Path(entry.path), beside)
                shutil.copystat(entry.path, beside)
            elif beside.is_dir():
                raise FileExistsError(errno.EEXIST, f"there is a file {entry.name} in the place of a folder")
            elif not os.path.lexists(beside):
                os.link(entry.path, beside, follow_symlinks=False)

    try:
        fill(old, new)
        shutil.copystat(old, new)
    except FileExistsError:
        raise
    except (OSError, NotImplementedError):
        return False
    return True


def _move_in(new: Path, place: Path) -> None:
    """Move files into a folder one by one, marked meanwhile."""
    mark = place / MARK
    mark.write_text(_MARK_TEXT, encoding="utf-8")
    _move(new, place)
    with suppress(FileNotFoundError):
        mark.unlink()


def _move(folder: Path, target: Path) -> None:
    for entry in sorted(folder.iterdir()):
        place = target / entry.name
        if not entry.is_dir():
            entry.replace(place)
        elif entry.suffix == ".zarr" or not place.exists():
            if place.exists():
                shutil.rmtree(place)
            entry.replace(place)
        else:
            place.mkdir(exist_ok=True)
            _move(entry, place)


def _not_written(path: Path, error: OSError) -> DataError:
    """What to say of a file or folder, by the name that it would have got: a hidden folder is left out of it."""
    parts = path.parts
    shown = [
        part
        for part, inside in itertools.zip_longest(parts, parts[1:])
        if not re.fullmatch(rf"\.{re.escape(inside or '')}\.[0-9a-f]{{8}}\.tmp", part)
    ]
    return DataError(f"{Path(*shown)}: cannot be written: {error.strerror or error}")


def _remove(folder: Path) -> None:
    """Remove a folder as far as that is possible: an error that matters is another one."""
    # after one of a library's threads has failed, others may go on writing for a moment
    for wait in (0.0, 0.05, 0.2, 0.5):
        time.sleep(wait)
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return


def _missing_parents(place: Path) -> list[Path]:
    """Folders that have to be made, innermost first."""
    return [parent for parent in place.parents if not parent.exists()]


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
