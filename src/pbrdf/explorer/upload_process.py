"""The process that reads a file which was dropped on the page; :mod:`pbrdf.explorer.uploads` starts it.

It takes its task, one JSON object, from standard input and leaves what it has read as a pickle in the temporary folder.
It runs as the same user, so it is a wall against files that crash, never end or ask for all memory, and not against one
that takes the process over. Limits are set before any library is loaded.
"""

from __future__ import annotations

import json
import pickle
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["LIMITS", "Limits", "main"]


class Limits(NamedTuple):
    """What reading a file may take.

    Attributes
    ----------
    seconds
        Of time, by the clock and of a processor.
    memory
        Bytes of address space.
    written
        Bytes of a file that it writes.
    """

    seconds: float
    memory: int
    written: int


LIMITS = Limits(seconds=60.0, memory=4 << 30, written=1 << 30)


def main() -> None:
    """Read the file of the task."""
    task = json.loads(sys.stdin.buffer.read())
    _limit(Limits(**task["limits"]))
    result = Path(task["result"])
    with result.open("xb") as out:
        pickle.dump(_opened(task["file"], task["options"]), out, protocol=pickle.HIGHEST_PROTOCOL)


def _limit(limits: Limits) -> None:
    try:
        import os
        import resource
    except ImportError:  # Windows: the clock alone
        return
    seconds = int(limits.seconds) + 1
    for kind, most in (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, limits.memory),
        (resource.RLIMIT_FSIZE, limits.written),
        (resource.RLIMIT_CORE, 0),
    ):
        _, hard = resource.getrlimit(kind)
        bound = most if hard == resource.RLIM_INFINITY else min(most, hard)
        with suppress(OSError, ValueError):  # macOS has no limit of the address space
            resource.setrlimit(kind, (bound, bound))
    with suppress(OSError):
        os.nice(5)


def _opened(file: str, options: dict[str, Any]) -> dict[str, Any] | str:
    """The lists of a workspace by name, or what is wrong in words."""
    from pbrdf.data.readers import read
    from pbrdf.errors import PbrdfError
    from pbrdf.explorer.opening import open_source
    from pbrdf.explorer.workspace import Workspace

    found = Workspace()
    try:
        open_source(found, file, lambda path: read(path, **options).load())
    except PbrdfError as error:
        return str(error)
    except (TypeError, ValueError, KeyError) as error:
        return f"{file}: cannot be read: {error}"
    if found.pictures:
        return (
            f"{file}: data of every pixel of an image are opened beside their map: pbrdf explore MAP {file}"
        )
    return {name: getattr(found, name) for name in ("models", "datasets", "fits", "maps")}


if __name__ == "__main__":
    main()
