"""The page served from this machine, and its WebSocket: Tornado, bound to the loopback address.

Who may ask:

* The server listens on 127.0.0.1 alone, so nothing but this machine reaches it.
* The token in the address keeps other users of this machine out, and pages of elsewhere. The first load leaves it in a
  cookie that scripts cannot read and that goes to no other site (``HttpOnly; SameSite=Strict``), and the page takes it
  out of the address bar: a reload works, a link that is sent to a colleague or a picture of the screen holds no token.
  Another start has another token.
* A page of elsewhere whose name was made to point to this machine (DNS rebinding) still sends its own name as ``Host``,
  one that opens a socket its own as ``Origin``: both are refused.
* No request names a file of this machine: the four files of the page are listed here, uploads are bytes.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import tornado.httpserver
import tornado.web
import tornado.websocket

from pbrdf.errors import DataError, PbrdfError
from pbrdf.explorer.messages import pack, unpack
from pbrdf.explorer.module import PAGE, module_text
from pbrdf.explorer.session import Session, get_ready
from pbrdf.explorer.workspace import Workspace

__all__ = ["serve"]

#: Bytes of one message, at most; the page itself refuses larger files in words.
_MOST_BYTES = 64 << 20
#: Pages that are open at once, at most: each has a thread.
_MOST_PAGES = 16
#: Files of the page with their media types.
_KINDS = {
    "index.html": "text/html",
    "page.js": "text/javascript",
    "explorer.js": "text/javascript",
    "style.css": "text/css",
}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
        "form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_NO_TOKEN = "This page needs its token: open the whole address that pbrdf explore has printed."
_FOREIGN = "This is not the address of the explorer: open the one that pbrdf explore has printed."


class _Guard(NamedTuple):
    """Names under which this server may be asked, its token, and the name of the cookie that keeps it."""

    hosts: frozenset[str]
    token: str
    cookie: str


class _Guarded(tornado.web.RequestHandler):
    def initialize(self, guard: _Guard) -> None:
        self.guard = guard

    def prepare(self) -> None:
        origin = self.request.headers.get("Origin")
        known = origin is None or origin in {f"http://{host}" for host in self.guard.hosts}
        if not known or self.request.host not in self.guard.hosts:
            raise tornado.web.HTTPError(403, _FOREIGN)

    def set_default_headers(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)

    def require_token(self) -> None:
        given = self.get_query_argument("token", None) or self.get_cookie(self.guard.cookie) or ""
        if not secrets.compare_digest(given.encode(), self.guard.token.encode()):
            raise tornado.web.HTTPError(403, _NO_TOKEN)

    def log_exception(self, *error: Any) -> None:
        if not isinstance(error[1], tornado.web.HTTPError):
            super().log_exception(*error)

    def write_error(self, status_code: int, **given: Any) -> None:
        error = given.get("exc_info", (None, None))[1]
        said = error.log_message if isinstance(error, tornado.web.HTTPError) else None
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{said or self._reason}\n")


class _File(_Guarded):
    def get(self, name: str) -> None:
        file = name or "index.html"
        if file not in _KINDS:
            raise tornado.web.HTTPError(404)
        self.require_token()
        if file == "index.html":
            self.set_cookie(self.guard.cookie, self.guard.token, path="/", httponly=True, samesite="Strict")
        self.set_header("Content-Type", f"{_KINDS[file]}; charset=utf-8")
        self.write(module_text() if file == "explorer.js" else (PAGE / file).read_text(encoding="utf-8"))


class _Socket(_Guarded, tornado.websocket.WebSocketHandler):
    def initialize(  # type: ignore[override]
        self, guard: _Guard, workspace: Callable[[], Workspace], pages: set[_Socket]
    ) -> None:
        super().initialize(guard)
        self.open_workspace, self.pages = workspace, pages
        self.session: Session | None = None

    def prepare(self) -> None:
        super().prepare()
        self.require_token()

    def open(self, *args: str, **kwargs: str) -> None:
        if len(self.pages) >= _MOST_PAGES:
            self.close(1013, f"{_MOST_PAGES} pages are open, close some")
            return
        self.pages.add(self)
        loop = asyncio.get_running_loop()

        def emit(content: Any, buffers: Any) -> None:
            frame = pack(content, buffers)
            with suppress(RuntimeError):  # the loop has ended, and with it the page
                loop.call_soon_threadsafe(self._send, frame)

        self.set_nodelay(True)
        self.session = Session(self.open_workspace(), emit)

    def _send(self, frame: bytes) -> None:
        if self.ws_connection is not None and not self.ws_connection.is_closing():
            with suppress(tornado.websocket.WebSocketClosedError):
                self.write_message(frame, binary=True)

    def on_message(self, message: str | bytes) -> None:
        if self.session is None:
            return
        try:
            content, buffers = unpack(message if isinstance(message, bytes) else message.encode())
        except DataError:
            self.close(1003, "not a message of the explorer")
            return
        self.session.receive(content, buffers)

    def on_close(self) -> None:
        self.pages.discard(self)
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

    Raises
    ------
    PbrdfError
        If the port is taken or not allowed.
    """
    try:
        listening = socket.create_server(("127.0.0.1", port), backlog=128)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise PbrdfError(
            f"port {port} cannot be used ({reason}): choose another, or leave it out for any that is free"
        ) from None
    listening.setblocking(False)
    bound = listening.getsockname()[1]
    # a cookie goes to all ports of a host, so each has a name of its own
    guard = _Guard(
        frozenset({f"127.0.0.1:{bound}", f"localhost:{bound}"}),
        secrets.token_urlsafe(32),
        f"pbrdf-explorer-{bound}",
    )
    pages: set[_Socket] = set()
    application = tornado.web.Application(
        [
            ("/socket", _Socket, {"guard": guard, "workspace": workspace, "pages": pages}),
            (r"/([a-z.]*)", _File, {"guard": guard}),
        ],
        default_handler_class=_Nothing,
        default_handler_args={"guard": guard},
        websocket_max_message_size=_MOST_BYTES,
        log_function=lambda handler: None,  # addresses hold the token
    )
    server = tornado.httpserver.HTTPServer(
        application, max_body_size=1 << 16, max_header_size=1 << 16, idle_connection_timeout=60.0
    )
    server.add_socket(listening)
    # while the browser opens
    threading.Thread(target=get_ready, name="pbrdf gets ready").start()
    try:
        ready(f"http://127.0.0.1:{bound}/?token={guard.token}")
        await asyncio.Event().wait()
    finally:
        server.stop()
        for page in list(pages):
            page.close(1001, "the program has ended")
            page.on_close()
        await server.close_all_connections()


class _Nothing(_Guarded):
    def prepare(self) -> None:
        super().prepare()
        raise tornado.web.HTTPError(404)
