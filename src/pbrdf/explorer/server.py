"""The page served from this machine, and its WebSocket: Tornado, bound to the loopback address."""

from __future__ import annotations

import asyncio
import secrets
import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

from pbrdf.errors import DataError
from pbrdf.explorer.catalogue import catalogue
from pbrdf.explorer.messages import pack, unpack
from pbrdf.explorer.module import PAGE, module_text
from pbrdf.explorer.session import Session
from pbrdf.explorer.workspace import Workspace

__all__ = ["serve"]

#: Bytes of one message, at most.
_MOST_BYTES = 64 << 20
#: Files of the page with their media types.
_KINDS = {
    "index.html": "text/html",
    "page.js": "text/javascript",
    "explorer.js": "text/javascript",
    "style.css": "text/css",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
    "form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)


class _Guarded(tornado.web.RequestHandler):
    def initialize(self, hosts: set[str], token: str) -> None:
        self.hosts, self.token = hosts, token

    def prepare(self) -> None:
        # a page of elsewhere whose name was made to point here still sends that name
        if self.request.host not in self.hosts:
            raise tornado.web.HTTPError(403, reason="foreign host")

    def set_default_headers(self) -> None:
        self.set_header("Content-Security-Policy", _POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")

    def has_token(self) -> bool:
        return secrets.compare_digest(self.get_argument("token", ""), self.token)


class _File(_Guarded):
    def get(self, name: str) -> None:
        if not name and not self.has_token():
            raise tornado.web.HTTPError(403, reason="the address lacks its token")
        file = name or "index.html"
        if file not in _KINDS:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", f"{_KINDS[file]}; charset=utf-8")
        self.write(module_text() if file == "explorer.js" else (PAGE / file).read_text(encoding="utf-8"))


class _Socket(_Guarded, tornado.websocket.WebSocketHandler):
    def initialize(self, hosts: set[str], token: str, workspace: Callable[[], Workspace]) -> None:  # type: ignore[override]
        super().initialize(hosts, token)
        self.open_workspace = workspace
        self.session: Session | None = None

    def check_origin(self, origin: str) -> bool:
        return urlsplit(origin).netloc in self.hosts

    def prepare(self) -> None:
        super().prepare()
        if not self.has_token():
            raise tornado.web.HTTPError(403, reason="the address lacks its token")

    def open(self, *args: str, **kwargs: str) -> None:
        loop = asyncio.get_running_loop()

        def emit(content: Any, buffers: Any) -> None:
            frame = pack(content, buffers)
            loop.call_soon_threadsafe(self._send, frame)

        self.set_nodelay(True)
        self.session = Session(self.open_workspace(), emit)

    def _send(self, frame: bytes) -> None:
        if self.ws_connection is not None and not self.ws_connection.is_closing():
            self.write_message(frame, binary=True)

    def on_message(self, message: str | bytes) -> None:
        assert self.session is not None
        try:
            content, buffers = unpack(message if isinstance(message, bytes) else message.encode())
        except DataError:
            self.close(1003, "not a message of the explorer")
            return
        self.session.receive(content, buffers)

    def on_close(self) -> None:
        if self.session is not None:
            self.session.close()


async def serve(workspace: Callable[[], Workspace], port: int, ready: Callable[[str], None]) -> None:
    """Serve the page until cancelled.

    Parameters
    ----------
    workspace
        Makes what a page begins with, once for each page.
    port
        Port of the loopback address; 0 for any that is free.
    ready
        Told the address with its token once the page can be opened.
    """
    sockets = tornado.netutil.bind_sockets(port, "127.0.0.1")
    bound = sockets[0].getsockname()[1]
    hosts = {f"127.0.0.1:{bound}", f"localhost:{bound}"}
    token = secrets.token_urlsafe(16)
    guard = {"hosts": hosts, "token": token}
    application = tornado.web.Application(
        [("/socket", _Socket, {**guard, "workspace": workspace}), (r"/([a-z.]*)", _File, guard)],
        websocket_max_message_size=_MOST_BYTES,
    )
    server = tornado.httpserver.HTTPServer(application, max_body_size=1 << 16)
    server.add_sockets(sockets)
    # what the first page asks for is put together while the browser opens
    threading.Thread(target=catalogue, name="pbrdf catalogue").start()
    try:
        ready(f"http://127.0.0.1:{bound}/?token={token}")
        await asyncio.Event().wait()
    finally:
        server.stop()
        await server.close_all_connections()
