"""One page at work: its requests are answered in order by one thread, and where pictures are asked for again before
they are drawn, only the latest request is drawn.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.explorer.catalogue import catalogue
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.workspace import Workspace

__all__ = ["REQUESTS", "VIEWS", "Emit", "Session"]

#: Sends a JSON object and buffers to the page, from any thread.
Emit = Callable[[Mapping[str, Any], Sequence[bytes | memoryview]], None]
#: Modules of the views by name; each has ``draw(state, workspace, dragging)`` that gives a header and buffers.
VIEWS = {
    "hemisphere": "pbrdf.explorer.views.hemisphere",
    "cuts": "pbrdf.explorer.views.cuts",
}
#: Modules that answer the other requests, by the request's type; each has
#: ``answer(request, buffers, workspace, emit)``.
REQUESTS: dict[str, str] = {
    "data": "pbrdf.explorer.points",
    "fit": "pbrdf.explorer.fitting",
    "cancel_fit": "pbrdf.explorer.fitting",
}
#: Requests that wait, at most; a page waits for answers, so more come from no page of ours.
_MOST_WAITING = 64

_log = logging.getLogger(__name__)


class Session:
    """Answers one page; use :meth:`close` at its end.

    Parameters
    ----------
    workspace
        What is open: data, maps, the state to begin with.
    emit
        Sends an answer to the page; called from the session's thread and those of fits.
    """

    def __init__(self, workspace: Workspace, emit: Emit) -> None:
        self.workspace = workspace
        self.emit = emit
        self._waiting: queue.Queue[tuple[dict[str, Any], Sequence[Any]] | None] = queue.Queue(_MOST_WAITING)
        self._newest_draw = 0
        self._thread = threading.Thread(target=self._work, daemon=True, name="pbrdf explorer")
        self._thread.start()

    def receive(self, content: dict[str, Any], buffers: Sequence[Any] = ()) -> None:
        """Take a request of the page; the answers come through ``emit``."""
        if content.get("type") == "draw":
            self._newest_draw += 1
            content["_turn"] = self._newest_draw
        try:
            self._waiting.put_nowait((content, buffers))
        except queue.Full:
            self._emit_error(content, "", "too many requests at once: wait for the answers")

    def wait(self) -> None:
        """Return when everything that was received has been answered."""
        self._waiting.join()

    def close(self) -> None:
        """End the thread and what it started."""
        self.workspace.close()
        self._waiting.put(None)

    def _work(self) -> None:
        while (item := self._waiting.get()) is not None:
            content, buffers = item
            try:
                self._answer(content, buffers)
            except StateError as error:
                self._emit_error(content, error.place, str(error))
            except PbrdfError as error:
                self._emit_error(content, "", str(error))
            except Exception:
                _log.exception("the explorer could not answer %s", content.get("type"))
                self._emit_error(content, "", "an error of the explorer; the terminal says more")
            finally:
                self._waiting.task_done()

    def _emit_error(self, content: Mapping[str, Any], place: str, text: str) -> None:
        answer = {"type": "error", "id": content.get("id"), "about": content.get("type")}
        self.emit({**answer, "place": place, "text": text}, [])

    def _answer(self, content: dict[str, Any], buffers: Sequence[Any]) -> None:
        kind = content.get("type")
        if kind == "hello":
            self.emit({"type": "welcome", "catalogue": catalogue(), "state": self.workspace.state()}, [])
        elif kind == "draw":
            self._draw(content)
        elif kind in REQUESTS:
            import_module(REQUESTS[str(kind)]).answer(content, buffers, self.workspace, self.emit)
        else:
            self._emit_error(content, "", f"there is no request {kind!r}")

    def _draw(self, content: dict[str, Any]) -> None:
        """Draw the views that are asked for; the last answer says so."""
        if content["_turn"] != self._newest_draw:
            self.emit({"type": "superseded", "id": content.get("id")}, [])
            return
        state = read_state(content.get("state"))
        views = [view for view in content.get("views", []) if view in VIEWS]
        for view in views:
            try:
                header, buffers = import_module(VIEWS[view]).draw(
                    state, self.workspace, bool(content.get("dragging"))
                )
            except PbrdfError as error:
                place = error.place if isinstance(error, StateError) else ""
                header, buffers = {"error": str(error), "place": place}, []
            answer = {"type": "picture", "id": content.get("id"), "view": view, "last": view == views[-1]}
            self.emit({**answer, **header}, buffers)
