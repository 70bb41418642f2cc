"""Where the command line writes: results to standard output, everything else to standard error."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pbrdf.errors import visible

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["NOT_CONVERGED", "fail", "output_console", "progress_bar", "reading_width", "stage_bar", "warn"]

#: Exit code of a command whose fit has not converged: everything is written, but its numbers are no result.
NOT_CONVERGED = 3

#: Lines longer than this are hard to read, however wide the terminal is.
_WIDEST = 110
#: Width where there is no terminal to ask, as in a pipe.
_WITHOUT_TERMINAL = 110


def reading_width() -> int | None:
    """Width of lines on standard output; None leaves it to a narrower terminal."""
    import shutil

    return min(shutil.get_terminal_size((_WITHOUT_TERMINAL, 24)).columns, _WIDEST)


def output_console() -> Console:
    """A console for results; a pipe or a file gets plain text."""
    from pbrdf.report.printing import printing_console

    return printing_console(width=reading_width(), soft_wrap=False)


def fail(message: str) -> None:
    """Write one line about an error."""
    print(f"pbrdf: error: {visible(message)}", file=sys.stderr)


def warn(message: str) -> None:
    """Write one line that a user should see but that stops nothing."""
    print(f"pbrdf: {visible(message)}", file=sys.stderr)


#: Where standard error is no terminal, a line of progress comes after so many seconds, and again after as many.
_EVERY = 10.0


@contextmanager
def progress_bar(what: str, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error, gone when the work is done; a line now and then if that is no terminal.

    Yields
    ------
    callable
        To be called with the number of finished pieces and of all.
    """
    with stage_bar(quiet, what) as show:
        yield lambda finished, total: show(what, finished, total)


@contextmanager
def stage_bar(quiet: bool = False, first: str = "") -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar as of :func:`progress_bar` for work in stages.

    Parameters
    ----------
    quiet
        Whether to show nothing at all.
    first
        What stands beside the bar before the first call.

    Yields
    ------
    callable
        To be called with the name of the stage, the number of its finished pieces and of all, 0 if that is not known.
    """
    if quiet:
        yield lambda stage, finished, total: None
        return
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        with _lines_now_and_then(first) as show:
            yield show
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as progress:
        task = progress.add_task(first, total=None)
        yield lambda stage, finished, total: progress.update(
            task, description=stage, completed=finished, total=total or None
        )


@contextmanager
def _lines_now_and_then(first: str) -> Iterator[Callable[[str, int, int], None]]:
    """Lines that tell how far long work is: from a thread, as the work itself may be silent for long."""
    began, over = time.monotonic(), threading.Event()
    state = [first, ""]

    def show(stage: str, finished: int, total: int) -> None:
        state[:] = [stage, f": {finished} of {total}" if total else ""]

    def tell() -> None:
        while not over.wait(_EVERY):
            warn(f"{state[0]}{state[1]} ({time.monotonic() - began:.0f} s)")

    teller = threading.Thread(target=tell, name="progress", daemon=True)
    teller.start()
    try:
        yield show
    finally:
        over.set()
        teller.join()
