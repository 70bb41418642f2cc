"""Files that are dropped on the page: ``{type: "open", name, options?}`` with one buffer, the file's bytes.

They are opened as what the command line names, in a process of its own, :mod:`pbrdf.explorer.upload_process`, with
limits of time and memory, while sliders go on moving. The bytes lie in a temporary folder for as long as they are read,
under a name that cannot lead out of it. The answer is ``{type: "opened", name, layers, datasets, maps, lines}``:
models as layers of the state, data sets and maps by name, and what is in the data in words; or an error about ``open``,
with ``choices`` where stating an option would mend it.
"""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from pbrdf.data.schema import QUANTITIES
from pbrdf.errors import DataError, PbrdfError
from pbrdf.explorer.catalogue import layer_of
from pbrdf.explorer.messages import error_answer
from pbrdf.explorer.upload_process import LIMITS, Limits
from pbrdf.explorer.workspace import Workspace, beginning

__all__ = ["MOST_BYTES", "OPTIONS", "answer", "file_name", "open_apart"]

#: Bytes of a file, at most; larger ones are named on the command line.
MOST_BYTES = 48 << 20
#: Options of the readers that a page may state: those that say what numbers mean, none that names a file.
OPTIONS = frozenset(
    {
        *("quantity", "azimuth", "stokes", "illumination", "cosine_weighted", "angles", "coverage", "scale"),
        *("column", "unit", "ignore", "where", "skip_invalid", "sheet", "wavelength", "every"),
    }
)
#: Options of a table with what they can be, which the page offers where a file does not say enough of itself.
CHOICES = {
    "quantity": list(QUANTITIES),
    "azimuth": ["forward=0", "forward=180"],
    "stokes": ["p-s", "s-p"],
    "angles": ["degrees", "radians"],
}
#: An error that an option would mend.
_ASKS = re.compile(rf"\boptions? ({'|'.join(OPTIONS)})\b|\b({'|'.join(OPTIONS)})=|no usable|skip_invalid")
#: Files that are read or wait to be read, and those that are read at once.
_MOST_WAITING, _AT_ONCE = 8, 1
_waiting = threading.BoundedSemaphore(_MOST_WAITING)
_reading = threading.BoundedSemaphore(_AT_ONCE)


def answer(
    request: Mapping[str, Any],
    buffers: Sequence[Any],
    workspace: Workspace,
    emit: Callable[[Mapping[str, Any], Sequence[bytes | memoryview]], None],
) -> None:
    """Begin to open a file; the answer comes when it is read.

    Raises
    ------
    DataError
        If the request is none, the file is too large, or too many are waiting.
    """
    name, options = request.get("name"), request.get("options") or {}
    if not isinstance(name, str) or not isinstance(options, Mapping) or len(buffers) != 1:
        raise DataError("a file to open has a name and its bytes")
    name = file_name(name)
    if unknown := sorted(set(options) - OPTIONS):
        raise DataError(
            f"{name}: {str(unknown[0])[:40]!r} is no option; there are {', '.join(sorted(OPTIONS))}"
        )
    content = bytes(buffers[0])
    if len(content) > MOST_BYTES:
        raise DataError(
            f"{name}: {len(content) / 1e6:.0f} MB are more than the {MOST_BYTES / 1e6:.0f} MB that the page takes: "
            f"open it with pbrdf explore {name}"
        )
    if not content:
        raise DataError(f"{name}: this file is empty")
    if not _waiting.acquire(blocking=False):
        raise DataError(f"{name}: {_MOST_WAITING} files are waiting to be read: drop it again in a moment")
    threading.Thread(
        target=_open,
        args=(request, name, content, options, workspace, emit),
        daemon=True,
        name="pbrdf upload",
    ).start()


def file_name(given: str) -> str:
    """A name for a file of these bytes that is no path, not hidden and not long; its extension is kept."""
    last = re.split(r"[/\\]", given)[-1]
    clean = re.sub(r"[^\w.+()\- ]", "_", last).strip(" .") or "file"
    stem, dot, extension = clean.rpartition(".")
    return clean if len(clean) <= 100 else f"{stem[:80]}{dot}{extension[-16:]}"


def _open(
    request: Mapping[str, Any],
    name: str,
    content: bytes,
    options: Mapping[str, Any],
    workspace: Workspace,
    emit: Callable[[Mapping[str, Any], Sequence[bytes | memoryview]], None],
) -> None:
    try:
        found = _opened(name, content, options, workspace)
        emit({"type": "opened", "id": error_answer(request, "")["id"], **found}, [])
    except PbrdfError as error:
        asked = {"choices": CHOICES} if _ASKS.search(str(error)) else {}
        emit({**error_answer(request, str(error)), **asked}, [])
    except Exception as error:
        emit(error_answer(request, f"{name}: cannot be opened: {type(error).__name__}"), [])
        raise
    finally:
        _waiting.release()


def _opened(name: str, content: bytes, options: Mapping[str, Any], workspace: Workspace) -> dict[str, Any]:
    from pbrdf.report.dataset.describe import describe

    with _reading:
        found = open_apart(name, content, options, workspace.at_close)
    datasets = [(workspace.add_dataset(own, dataset), dataset) for own, dataset in found.datasets]
    workspace.fits += found.fits
    maps = [workspace.add_map(own, dataset) for own, dataset in found.maps]
    return {
        "name": name,
        "layers": [layer_of(own, model) for own, model in found.models],
        "datasets": [own for own, _ in datasets],
        "beginning": beginning(datasets[0][1]) if datasets else None,
        "lines": [line for _, dataset in datasets for line in describe(dataset)],
        "maps": maps,
    }


def open_apart(
    name: str,
    content: bytes,
    options: Mapping[str, Any],
    at_close: list[Callable[[], None]],
    limits: Limits = LIMITS,
) -> Workspace:
    """Open a file in a process of its own.

    Parameters
    ----------
    name
        Of :func:`file_name`.
    content
        The file.
    options
        Of :func:`pbrdf.read`.
    at_close
        Gets what ends the process, for as long as it runs.
    limits
        Of time and memory.

    Raises
    ------
    DataError
        If it cannot be read within the limits; names the file as it was called.
    """
    folder = Path(tempfile.mkdtemp(prefix="pbrdf-upload-"))
    try:
        file, result = folder / name, folder / "read"
        file.write_bytes(content)
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "pbrdf.explorer.upload_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            start_new_session=True,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                "OPENBLAS_NUM_THREADS": "1",
                "TMPDIR": str(folder),
            },
        )
        end = partial(_end, child)
        at_close.append(end)
        task = {
            "file": str(file),
            "result": str(result),
            "options": dict(options),
            "limits": limits._asdict(),
        }
        try:
            child.communicate(json.dumps(task).encode(), timeout=limits.seconds)
        except subprocess.TimeoutExpired:
            raise DataError(
                f"{name}: it was not read within {limits.seconds:.0f} s: open it with pbrdf explore {name}"
            ) from None
        finally:
            _end(child)
            with suppress(ValueError):
                at_close.remove(end)
        try:
            found = pickle.loads(result.read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):
            raise DataError(
                f"{name}: reading it took more than {limits.memory / 2**30:.2g} GiB of memory, or the reader broke: "
                "the file is damaged or too large"
            ) from None
        if isinstance(found, str):
            raise DataError(found.replace(f"{folder}{os.sep}", ""))
        return Workspace(**found)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _end(child: subprocess.Popen[bytes]) -> None:
    """End a process with those that it started, if it runs."""
    if child.poll() is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL) if hasattr(os, "killpg") else child.kill()
        child.wait()
