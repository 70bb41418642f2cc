"""The address of the page in Chromium: its token goes into a cookie; other browsers and foreign pages are refused."""

import asyncio
import http.server
import threading
from urllib.parse import urlsplit

import pytest

from pbrdf.explorer.workspace import Workspace

pytestmark = pytest.mark.slow

# A page of another port of this machine, that is another origin, tries what it can with a token that it has guessed.
FOREIGN = """<!doctype html><title>foreign</title><iframe src="ADDRESS"></iframe><script>
  window.found = new Promise(resolve => {
    const socket = new WebSocket("ADDRESS".replace("http", "ws").replace("/?", "/socket?"));
    socket.onopen = () => resolve("open");
    socket.onerror = () => resolve("refused");
  });
  window.read = fetch("ADDRESS", { credentials: "include" }).then(() => "read", () => "refused");
</script>"""


@pytest.fixture
def foreign():
    """A function that serves a page of elsewhere and gives its address."""
    servers = []

    def serve(text):
        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.end_headers()
                self.wfile.write(text.encode())

            def log_message(self, *arguments):
                pass

        servers.append(http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{servers[-1].server_port}/"

    yield serve
    for server in servers:
        server.shutdown()
        server.server_close()


def test_the_token_leaves_the_address_and_a_reload_works(served, page, chrome, white):
    workspace = Workspace([("white", white)])
    address = served(workspace.again)
    asked = []
    page.on("request", lambda request: asked.append(request))
    page.goto(address)
    page.wait_for_selector("canvas")
    assert "token" not in page.url
    assert page.evaluate("document.cookie") == ""
    assert not any(request.all_headers().get("referer") for request in asked)
    page.reload()
    page.wait_for_selector("canvas")
    # another browser has no cookie
    other = chrome.new_context()
    bare = other.new_page()
    assert bare.goto(page.url.partition("#")[0]).status == 403
    assert "open the whole address" in bare.text_content("body")
    other.close()


def test_a_page_of_elsewhere_gets_nothing(served, page, foreign, white):
    """Not even with the token: neither the socket, nor the text of the page, nor the page in a frame."""
    address = served(lambda: Workspace([("white", white)]))
    page.goto(foreign(FOREIGN.replace("ADDRESS", address)))
    assert page.evaluate("window.found") == "refused"
    assert page.evaluate("window.read") == "refused"
    (frame,) = page.frames[1:]
    assert frame.query_selector("canvas") is None and "explorer" not in frame.content()


def test_a_program_that_ends_is_said_and_one_that_is_started_anew(page, white):
    """The page says so itself; the server does not wait for it, and another start is not asked for ever."""
    from pbrdf.explorer.server import serve

    def start(port):
        ready, address, loop = threading.Event(), [], asyncio.new_event_loop()
        running = []

        def tell(text):
            address.append(text)
            ready.set()

        def run():
            asyncio.set_event_loop(loop)
            task = loop.create_task(serve(lambda: Workspace([("white", white)]), port, tell))
            running.append(task)
            loop.run_until_complete(asyncio.gather(task, return_exceptions=True))
            loop.close()

        thread = threading.Thread(target=run)
        thread.start()

        def end():
            loop.call_soon_threadsafe(running[0].cancel)
            thread.join(10)
            assert not thread.is_alive()

        assert ready.wait(30)
        return address[0], end

    address, end = start(0)
    page.goto(address)
    page.wait_for_selector("canvas")
    end()
    page.get_by_text("pbrdf explore").first.wait_for(timeout=10_000)
    _, end = start(urlsplit(address).port)
    try:
        gone = page.locator(".notice.gone")
        gone.get_by_text("was started anew").wait_for(timeout=20_000)
        tried = []
        page.on("websocket", lambda socket: tried.append(socket))
        page.wait_for_timeout(2000)
        assert tried == []
        # nothing that is asked for waits for ever
        page.locator("input[type=range][name=sigma]").press("ArrowRight")
        page.wait_for_function("() => location.hash.length > 9")
        assert gone.is_visible()
    finally:
        end()
