"""HDF5 files of unknown origin: looked at by another process first.

Some damaged files make the HDF5 library crash, run without end or ask for all memory, and no check from outside finds
all of those. So every file is read once by a process beside, :mod:`pbrdf.files.hdf5_probe`, which has a deadline and a
limit of memory; only what it survives is read here. The process starts with the first file, while this one still
imports what it needs, and stays for the next: the first file takes some 0.2 s longer by it, any further one some
hundredths. Files that this package wrote are no exception: they may have been damaged since.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from pbrdf.errors import DataError
from pbrdf.files import hdf5_probe
from pbrdf.files.hdf5_probe import amount

__all__ = ["Look", "available_memory"]

#: Seconds for a file, and bytes more of it for each second more.
_PATIENCE = 30.0
_BYTES_A_SECOND = 10_000_000


class _Process:
    """The process beside; one, which is started when it is needed."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.child: subprocess.Popen[str] | None = None
        self.owner = 0

    def command(self) -> list[str]:
        """How it is started."""
        return [sys.executable, "-P", str(hdf5_probe.__file__)]

    def start(self) -> subprocess.Popen[str] | None:
        """The process, None where there can be none."""
        if self.child is not None and (self.owner != os.getpid() or self.child.poll() is not None):
            self.forget()
        if self.child is None and sys.executable and Path(hdf5_probe.__file__).is_file():
            environment = {
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                "OPENBLAS_NUM_THREADS": "1",
            }
            with suppress(OSError):
                self.child = subprocess.Popen(
                    self.command(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    text=True,
                    encoding="utf-8",
                    env=environment,
                )
                self.owner = os.getpid()
        return self.child

    def forget(self) -> int | None:
        """End the process; returns how it had ended if it had."""
        child, self.child = self.child, None
        if child is None:
            return None
        if self.owner != os.getpid():  # that of the process that this one was forked from
            child.returncode = 0
            return None
        ended = child.poll()
        if ended is None:
            child.kill()
        child.wait()
        for pipe in (child.stdin, child.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        return ended


_process = _Process()
atexit.register(_process.forget)


class Look:
    """A look at a file by the process beside, which goes on while this one does something else.

    Parameters
    ----------
    path
        The file.
    groups
        Names of its groups, ``"/"`` for the root.
    loaded
        Whether all of it is going to be in memory.
    kind
        What the file should be, for messages.
    """

    def __init__(
        self, path: Path, groups: Sequence[str] = ("/",), *, loaded: bool = True, kind: str = "netCDF"
    ) -> None:
        self._path, self._groups, self._loaded, self._kind = path, list(groups), loaded, kind
        self._answers: list[str] = []
        self._waiting: threading.Thread | None = None
        _process.lock.acquire()
        try:
            child = _process.start()
            if child is not None and child.stdin is not None and child.stdout is not None:
                request = {"path": str(path.resolve()), "groups": self._groups}
                with suppress(OSError):  # it has ended: there will be no answer
                    child.stdin.write(json.dumps(request) + "\n")
                    child.stdin.flush()
                output = child.stdout
                self._waiting = threading.Thread(
                    target=lambda: self._answers.append(output.readline()), daemon=True
                )
                self._waiting.start()
        except BaseException:
            _process.lock.release()
            raise

    def require_sound(self) -> None:
        """Wait for the answer.

        Raises
        ------
        DataError
            If the file is damaged, declares what it cannot hold or what there is no memory for, or the process did not
            survive it or did not answer in time.
        """
        try:
            declared = self._declared()
        finally:
            _process.lock.release()
        if self._loaded and declared > (available := available_memory()):
            raise DataError(
                f"{self._path}: its variables take {amount(declared)} of memory, of which {amount(available)} are left"
            )

    def _declared(self) -> int:
        path = self._path
        if self._waiting is None:  # no process beside: at least what is declared is checked
            try:
                return hdf5_probe.declared_bytes(str(path), self._groups)
            except hdf5_probe.RefusedError as error:
                raise DataError(f"{path}: {error}") from error
            except Exception as error:  # the library raises anything over a damaged file
                raise DataError(f"{path}: cannot be read as {self._kind}: {error}") from error
        size = path.stat().st_size if path.is_file() else 0
        patience = _PATIENCE + size / _BYTES_A_SECOND
        self._waiting.join(patience)
        if self._waiting.is_alive():
            _process.forget()
            self._waiting.join()
            raise DataError(
                f"{path}: cannot be read as {self._kind}: the HDF5 library had not come to an end after "
                f"{patience:.0f} s; the file is damaged"
            )
        answer = self._answers[0] if self._answers else ""
        if not answer.endswith("\n"):
            _process.forget()
            raise DataError(
                f"{path}: cannot be read as {self._kind}: the HDF5 library crashes at it; the file is damaged"
            )
        told = json.loads(answer)
        if "refused" in told:
            raise DataError(f"{path}: {told['refused']}")
        if "failed" in told:
            raise DataError(f"{path}: cannot be read as {self._kind}: {told['failed']}")
        return int(told["declared"])


def available_memory() -> int:
    """Bytes of memory that are left; very many where the system does not tell."""
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return 2**62
