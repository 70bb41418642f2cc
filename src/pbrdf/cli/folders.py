"""Folders that commands write their results into: checked before the work, and told after it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from pbrdf.cli.console import output_console

__all__ = ["ready_folder", "say_written", "standing"]


def ready_folder(folder: Path) -> frozenset[str]:
    """Check before long work that a folder can be made or filled; gives what is :func:`standing` in it.

    Raises
    ------
    DataError
        If it cannot; the message says why.
    """
    from pbrdf.files.atomic import require_writable_folder

    require_writable_folder(folder)
    return standing(folder)


def standing(folder: Path) -> frozenset[str]:
    """The names of what is in a folder, if there is one."""
    return frozenset(path.name for path in folder.iterdir()) if folder.is_dir() else frozenset()


def say_written(folder: Path, files: Sequence[Path], stood: Collection[str]) -> None:
    """Print what was written, and which of it took the place of earlier results.

    Parameters
    ----------
    folder, files
        Where, and what.
    stood
        What was :func:`standing` there before.
    """
    replaced = [path.name for path in files if path.name in stood]
    if not replaced:
        words = ""
    elif len(replaced) == len(files):
        words = " (all of them in place of earlier ones)"
    else:
        words = f" (in place of earlier ones: {', '.join(replaced)})"
    names = ", ".join(path.name for path in files)
    output_console().print(f"\nWritten to {folder}/: {names}{words}", markup=False)
