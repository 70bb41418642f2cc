"""A process beside that fits: the sliders stay fluid, and a fit ends at once when it is no longer wanted.

It is started before it is needed, so that a fit does not wait for imports. Its program is a module of its own and not
one that :mod:`multiprocessing` starts, which would run the user's script again.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary

from pbrdf.errors import FitError
from pbrdf.explorer.workspace import Workspace

__all__ = ["FitProcess", "process_of"]

_PROGRAM = "pbrdf.explorer.fit_worker"
#: Windows' word for a low priority; the program lowers its own elsewhere.
_LOW = getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)

Tell = Callable[[dict[str, Any]], None]
_processes: WeakKeyDictionary[Workspace, FitProcess] = WeakKeyDictionary()


def process_of(workspace: Workspace) -> FitProcess:
    """The process of a page, which ends with it; it is not started yet."""
    if workspace not in _processes:
        _processes[workspace] = FitProcess()
        workspace.at_close.append(_processes[workspace].close)
    return _processes[workspace]


class _Job:
    def __init__(self, child: subprocess.Popen[bytes], tell: Tell) -> None:
        self.child, self.tell, self.cancelled = child, tell, False


class FitProcess:
    """Fits of one page, one at a time; use :meth:`close` at the end."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._child: subprocess.Popen[bytes] | None = None
        self._job: _Job | None = None
        self._closed = False

    @property
    def busy(self) -> bool:
        """Whether a fit is running."""
        return self._job is not None

    @property
    def pid(self) -> int | None:
        """Number of the process; None where there is none."""
        return None if self._child is None else self._child.pid

    def warm(self) -> None:
        """Start the process if there is none."""
        with self._lock:
            if self._child is not None and self._child.poll() is not None:
                self._end()
            if self._child is None and not self._closed and sys.executable:
                environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
                with suppress(OSError):
                    self._child = subprocess.Popen(
                        [sys.executable, "-P", "-m", _PROGRAM],
                        stdin=subprocess.PIPE,
                        stdout=subprocess.PIPE,
                        env=environment,
                        creationflags=_LOW,
                    )

    def start(self, job: dict[str, Any], tell: Tell) -> None:
        """Begin a fit.

        Parameters
        ----------
        job
            See :func:`pbrdf.explorer.fit_worker.found_by`.
        tell
            Told from a thread what comes: any number of messages of the ``kind`` ``progress``, at last one that is
            ``found``, ``error`` or ``cancelled``.

        Raises
        ------
        FitError
            If another fit is running, there can be no process, or none that can be told of the model.
        """
        try:
            content = pickle.dumps(job)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise FitError(f"this model cannot be fitted by a process beside: {error}") from None
        with self._lock:
            if self._job is not None:
                raise FitError("a fit is running: wait for it, or cancel it")
            self.warm()
            if self._child is None:
                raise FitError("no process can be started that fits")
            self._job = _Job(self._child, tell)
            threading.Thread(target=self._follow, args=(self._job, content), daemon=True).start()

    def cancel(self) -> bool:
        """End the fit that is running at once; False if there is none."""
        with self._lock:
            if self._job is None:
                return False
            self._job.cancelled = True
            self._job = None
            self._end()
            self.warm()
            return True

    def close(self) -> None:
        """End the process, whatever it does."""
        with self._lock:
            self._closed = True
            if not self.cancel():
                self._end()

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.kill()
            child.wait()
            for pipe in (child.stdin, child.stdout):
                assert pipe is not None
                with suppress(OSError):
                    pipe.close()

    def _follow(self, job: _Job, content: bytes) -> None:
        """Hand the job over and tell what comes of it."""
        message: dict[str, Any] | None = None
        assert job.child.stdin is not None and job.child.stdout is not None
        with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            pickle.dump(content, job.child.stdin)
            job.child.stdin.flush()
            while (heard := pickle.load(job.child.stdout))["kind"] == "progress":
                if not job.cancelled:
                    job.tell(heard)
            message = heard
        with self._lock:
            if job.cancelled:
                message = {"kind": "cancelled"}
            else:
                self._job = None
                if message is None:
                    message = {"kind": "error", "text": "the process that fits has ended: try again"}
                    self._end()
        job.tell(message)
