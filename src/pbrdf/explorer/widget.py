"""The explorer in a notebook: the module of the page as an AnyWidget, its requests answered in this kernel."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any

import anywidget

from pbrdf.explorer.module import PAGE, module_text
from pbrdf.explorer.session import Session
from pbrdf.explorer.workspace import Workspace

__all__ = ["Explorer"]


class Explorer(anywidget.AnyWidget):
    """A widget that shows a workspace.

    Parameters
    ----------
    workspace
        What is open.
    """

    _esm = module_text()
    _css = (PAGE / "style.css").read_text(encoding="utf-8")

    def __init__(self, workspace: Workspace) -> None:
        super().__init__()
        try:
            # a kernel sends from its own thread: marimo knows where to from no other
            self._loop: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
        except RuntimeError:
            self._loop = None
        self._session = Session(workspace, self._emit)
        self.on_msg(lambda widget, content, buffers: self._session.receive(dict(content), buffers))

    def close(self) -> None:
        """End the widget and what runs for it."""
        if hasattr(self, "_session"):
            self._session.close()
        super().close()

    def _emit(self, content: Mapping[str, Any], buffers: Sequence[bytes | memoryview]) -> None:
        if self._loop is None or self._loop.is_closed():
            self.send(dict(content), list(buffers))
        else:
            self._loop.call_soon_threadsafe(self.send, dict(content), list(buffers))
