"""One page at work: its requests are answered in order by one thread, and where pictures are asked for again before
they are drawn, only the latest request is drawn.

Several pages have a thread each; Dr.Jit evaluates in several threads at once.
"""

from __future__ import annotations

import atexit
import logging
import queue
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.explorer.catalogue import catalogue
from pbrdf.explorer.messages import error_answer, request_number
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.uploads import MOST_BYTES
from pbrdf.explorer.workspace import Workspace

__all__ = ["REQUESTS", "VIEWS", "Emit", "Session", "get_ready"]

#: Sends a JSON object and buffers to the page, from any thread.
Emit = Callable[[Mapping[str, Any], Sequence[bytes | memoryview]], None]
#: Modules of the views by name; each has ``draw(state, workspace, dragging)`` that gives a header and buffers.
VIEWS = {
    "hemisphere": "pbrdf.explorer.views.hemisphere",
    "cuts": "pbrdf.explorer.views.cuts",
    "mueller": "pbrdf.explorer.views.mueller",
    "sphere": "pbrdf.explorer.views.sphere",
    "polar": "pbrdf.explorer.views.polar",
    "map": "pbrdf.explorer.views.map",
}
#: Modules that answer the other requests, by the request's type; each has
#: ``answer(request, buffers, workspace, emit)``.
REQUESTS: dict[str, str] = {
    "cancel_fit": "pbrdf.explorer.fitting",
    "data": "pbrdf.explorer.points",
    "export": "pbrdf.explorer.exports",
    "fit": "pbrdf.explorer.fitting",
    "map_picture": "pbrdf.explorer.maps",
    "map_pixel": "pbrdf.explorer.map_pixels",
    "open": "pbrdf.explorer.uploads",
    "previews": "pbrdf.explorer.previews",
    "read_state": "pbrdf.explorer.reading",
}
#: Requests that wait, at most; a page waits for answers, so more come from no page of ours.
_MOST_WAITING = 64
#: What a page is told of a fault that is not its own.
_FAULT = "an error of the explorer; the terminal says more"

#: Seconds that the end of Python waits for a session's thread: one that it ends amid Dr.Jit takes the process down.
_TO_END = 2.0
_at_work: weakref.WeakSet[Session] = weakref.WeakSet()
_preparing = threading.Lock()
_log = logging.getLogger(__name__)


def prepared() -> dict[str, Any]:
    """The catalogue, put together once: whoever asks meanwhile waits for it."""
    with _preparing:
        return catalogue()


def get_ready() -> None:
    """Load what the first page asks for before it shows pictures."""
    prepared()
    for module in (*VIEWS.values(), REQUESTS["data"]):
        import_module(module)


@atexit.register
def _close_all() -> None:
    for session in list(_at_work):
        session.close()
        session._thread.join(_TO_END)


class Session:
    """Answers one page; use :meth:`close` at its end.

    Parameters
    ----------
    workspace
        What is open: data, maps, the state to begin with.
    emit
        Sends an answer to the page; called from the session's thread and those of uploads and fits, never after
        :meth:`close`.
    """

    def __init__(self, workspace: Workspace, emit: Emit) -> None:
        self.workspace = workspace
        self._send = emit
        self._closed = threading.Event()
        self._waiting: queue.Queue[tuple[dict[str, Any], Sequence[Any], int] | None] = queue.Queue(
            _MOST_WAITING
        )
        self._newest_draw = 0
        self._thread = threading.Thread(target=self._work, daemon=True, name="pbrdf explorer")
        self._thread.start()
        _at_work.add(self)

    def emit(self, content: Mapping[str, Any], buffers: Sequence[bytes | memoryview]) -> None:
        """Send an answer, from any thread; nothing where the page has gone."""
        if self._closed.is_set():
            return
        try:
            self._send(content, buffers)
        except Exception as error:
            # a page that goes while its picture is drawn takes what sends to it away
            if self._closed.is_set():
                return
            _log.exception("the explorer could not send %s", content.get("type"))
            if isinstance(error, ValueError):  # a number that JSON has not, and the page waits for an answer
                with suppress(Exception):
                    self._send(_unsent(content), [])

    def receive(self, content: dict[str, Any], buffers: Sequence[Any] = ()) -> None:
        """Take a request of the page; the answers come through ``emit``."""
        if self._closed.is_set():
            return
        if content.get("type") == "draw":
            self._newest_draw += 1
        try:
            self._waiting.put_nowait((content, buffers, self._newest_draw))
        except queue.Full:
            self.emit(error_answer(content, "too many requests at once: wait for the answers"), [])

    def wait(self) -> None:
        """Return when everything that was received has been answered."""
        self._waiting.join()

    def close(self) -> None:
        """End the thread, after the answer that it is at, and what it started; what waits is not answered."""
        if self._closed.is_set():
            return
        self._closed.set()
        self.workspace.close()
        try:
            while True:
                self._waiting.get_nowait()
                self._waiting.task_done()
        except queue.Empty:
            self._waiting.put(None)

    def _work(self) -> None:
        while (item := self._waiting.get()) is not None:
            content, buffers, turn = item
            try:
                self._answer(content, buffers, turn)
            except StateError as error:
                self.emit(error_answer(content, str(error), error.place), [])
            except PbrdfError as error:
                self.emit(error_answer(content, str(error)), [])
            except Exception:
                if not self._closed.is_set():
                    _log.exception("the explorer could not answer %r", content.get("type"))
                self.emit(error_answer(content, _FAULT), [])
            finally:
                self._waiting.task_done()
        self._waiting.task_done()

    def _answer(self, content: dict[str, Any], buffers: Sequence[Any], turn: int) -> None:
        kind = content.get("type")
        if kind == "hello":
            welcome = {"catalogue": prepared(), "state": self.workspace.state(), "most_bytes": MOST_BYTES}
            self.emit({"type": "welcome", **welcome}, [])
        elif kind == "draw":
            self._draw(content, turn)
        elif kind == "goodbye":  # a notebook shows the same widget again
            pass
        elif isinstance(kind, str) and kind in REQUESTS:
            import_module(REQUESTS[kind]).answer(content, buffers, self.workspace, self.emit)
        else:
            self.emit(error_answer(content, f"there is no request {str(kind)[:40]!r}"), [])

    def _draw(self, content: dict[str, Any], turn: int) -> None:
        """Draw the views that are asked for; the last answer says so."""
        number = request_number(content)
        if turn != self._newest_draw:
            self.emit({"type": "superseded", "id": number}, [])
            return
        state = read_state(content.get("state"))
        asked = content.get("views")
        known = (
            [view for view in asked if isinstance(view, str) and view in VIEWS]
            if isinstance(asked, list)
            else []
        )
        views = list(dict.fromkeys(known))
        if not views:
            raise StateError("views", f"no view is asked for: choose of {', '.join(VIEWS)}")
        for view in views:
            if self._closed.is_set():
                return
            try:
                # what comes of numbers beyond measure is no number, and is drawn as none
                with np.errstate(all="ignore"):
                    header, buffers = import_module(VIEWS[view]).draw(
                        state, self.workspace, bool(content.get("dragging"))
                    )
            except PbrdfError as error:
                place = error.place if isinstance(error, StateError) else ""
                header, buffers = {"error": str(error), "place": place}, []
            except Exception:
                _log.exception("the explorer could not draw %s", view)
                header, buffers = {"error": _FAULT, "place": ""}, []
            answer = {"type": "picture", "id": number, "view": view, "last": view == views[-1]}
            self.emit({**answer, **header}, buffers)


def _unsent(content: Mapping[str, Any]) -> dict[str, Any]:
    """What is said instead of an answer that cannot be sent."""
    if content.get("type") == "picture":
        known = {key: content[key] for key in ("type", "id", "view", "last")}
        return {**known, "error": _FAULT, "place": ""}
    return error_answer({**content, "type": None}, _FAULT)
