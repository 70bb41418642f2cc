"""Who may ask the server of the page, and what it answers the others."""

import asyncio
import http.client
import socket
from contextlib import ExitStack
from urllib.parse import parse_qs, urlsplit

import pytest

from pbrdf.errors import PbrdfError
from pbrdf.explorer.messages import pack, unpack
from pbrdf.explorer.server import serve
from pbrdf.explorer.workspace import Workspace


@pytest.fixture
def address(served):
    return urlsplit(served(Workspace))


@pytest.fixture
def token(address):
    return parse_qs(address.query)["token"][0]


def get(address, path, **headers):
    """Status, headers and text of an answer; headers are sent as they are given."""
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=10)
    try:
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.putrequest("GET", path, skip_host="Host" in given)
        for name, value in given.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()
    finally:
        connection.close()


def cookie_of(headers):
    return headers["Set-Cookie"].partition(";")[0]


class RawSocket:
    """A WebSocket as a program makes one that is no browser: it says what it wants; use as a context."""

    def __init__(self, address, query="", **headers):
        given = {"Host": f"{address.hostname}:{address.port}", **headers}
        self.socket = socket.create_connection((address.hostname, address.port), timeout=10)
        lines = [
            f"GET /socket{query} HTTP/1.1",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==",
            *(f"{name}: {value}" for name, value in given.items()),
        ]
        self.socket.sendall("\r\n".join([*lines, "", ""]).encode())
        self.stream = self.socket.makefile("rb")
        self.status = int(self.stream.readline().split()[1])
        while self.stream.readline().strip():
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stream.close()
        self.socket.close()

    def send(self, content):
        """A binary message under a mask of zeros."""
        assert len(content) < 126
        self.socket.sendall(bytes([0x82, 0x80 | len(content), 0, 0, 0, 0]) + content)

    def receive(self):
        """Kind (2: bytes, 8: the end) and content of the next message."""
        kind, length = self.stream.read(2)
        if length > 125:
            length = int.from_bytes(self.stream.read(2 if length == 126 else 8), "big")
        return kind & 15, self.stream.read(length)

    def close_code(self):
        """Why the server ends it."""
        kind, content = self.receive()
        assert kind == 8
        return int.from_bytes(content[:2], "big")


def refusal(address, query="", **headers):
    """Status with which a socket is refused."""
    with RawSocket(address, query, **headers) as refused:
        return refused.status


def test_the_page_is_given_for_its_token(address):
    status, headers, text = get(address, f"/?{address.query}")
    assert status == 200 and 'id="explorer"' in text
    assert headers["Referrer-Policy"] == "no-referrer" and headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy


@pytest.mark.parametrize(
    "path", ["/", "/?token=", "/?token=x", "/?token=%C3%A9", "/explorer.js", "/page.js?token=1"]
)
def test_without_the_token_there_is_nothing(address, path):
    status, headers, text = get(address, path)
    assert status == 403 and "open the whole address" in text
    assert "Set-Cookie" not in headers


def test_after_the_first_load_a_cookie_does(address, token):
    """A reload of the address without the token works; scripts and other sites do not get the cookie."""
    _, headers, _ = get(address, f"/?token={token}")
    attributes = {part.strip().lower() for part in headers["Set-Cookie"].split(";")[1:]}
    assert {"httponly", "samesite=strict", "path=/"} <= attributes
    for path in ("/", "/page.js", "/explorer.js", "/style.css"):
        assert get(address, path, Cookie=cookie_of(headers))[0] == 200
    assert get(address, "/", Cookie=cookie_of(headers)[:-1])[0] == 403


def test_the_token_of_another_start_is_none(served, token):
    other = urlsplit(served(Workspace))
    assert get(other, f"/?token={token}")[0] == 403


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "[::1]:{port}", ""]
)
def test_a_foreign_host_is_refused(address, token, host):
    """Also where a name of elsewhere was made to point to this machine (DNS rebinding), and with the token."""
    foreign = host.format(port=address.port)
    for path in (f"/?token={token}", f"/nothing?token={token}"):
        status, headers, text = get(address, path, Host=foreign)
        assert status in (400, 403)
        assert token not in text and "Set-Cookie" not in headers
    assert refusal(address, f"?token={token}", Host=foreign or "x") == 403


def test_this_machine_by_name_is_none_of_those(address, token):
    assert get(address, f"/?token={token}", Host=f"localhost:{address.port}")[0] == 200


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://127.0.0.1:1",
        "https://127.0.0.1:{port}",
        "null",
        "http://127.0.0.1:{port}.evil.example",
    ],
)
def test_a_socket_of_a_foreign_page_is_refused(address, token, origin):
    assert refusal(address, f"?token={token}", Origin=origin.format(port=address.port)) == 403


def test_a_socket_needs_the_token(address):
    origin = f"http://127.0.0.1:{address.port}"
    assert refusal(address, Origin=origin) == 403
    assert refusal(address, "?token=guessed", Origin=origin) == 403


def test_the_page_talks_over_its_socket(address, token):
    cookie = cookie_of(get(address, f"/?token={token}")[1])
    with RawSocket(address, Origin=f"http://127.0.0.1:{address.port}", Cookie=cookie) as page:
        assert page.status == 101
        page.send(pack({"type": "hello"}))
        kind, frame = page.receive()
        content, buffers = unpack(frame)
        assert kind == 2 and content["type"] == "welcome" and buffers == []


@pytest.mark.parametrize("frame", [b"", b"\xff\xff\xff\xff", b"\x02\0\0\0[]", b"hello"])
def test_what_is_no_message_ends_the_socket(address, token, frame):
    with RawSocket(address, f"?token={token}") as page:
        page.send(frame)
        assert page.close_code() == 1003


def test_a_message_beyond_measure_ends_the_socket(address, token):
    """By the size that it declares: 200 MB of zeros are not waited for."""
    with RawSocket(address, f"?token={token}") as page:
        page.socket.sendall(bytes([0x82, 0x80 | 127]) + (200_000_000).to_bytes(8, "big") + bytes(4 + 1000))
        assert page.close_code() == 1009


def test_pages_are_counted(address, token):
    with ExitStack() as stack:
        pages = [stack.enter_context(RawSocket(address, f"?token={token}")) for _ in range(16)]
        assert {page.status for page in pages} == {101}
        with RawSocket(address, f"?token={token}") as one_more:
            assert one_more.close_code() == 1013
        # one that goes makes room
        pages[0].send(b"goodbye")
        assert pages[0].close_code() == 1003
        pages[0].socket.shutdown(socket.SHUT_RDWR)
        with RawSocket(address, f"?token={token}") as another:
            another.send(pack({"type": "hello"}))
            assert another.receive()[0] == 2


@pytest.mark.parametrize(
    "path",
    ["/../pyproject.toml", "/%2e%2e/server.py", "/server.py", "/page/page.js", "//etc/passwd", "/module.py"],
)
def test_no_other_file_is_given(address, token, path):
    assert get(address, f"{path}?token={token}")[0] == 404


def test_nothing_listens_elsewhere(address):
    """Only the loopback address: that of this machine in a network is refused."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing, finds the outward address
        except OSError:
            pytest.skip("this machine is in no network")
        own = probe.getsockname()[0]
    if own.startswith("127."):
        pytest.skip("this machine is in no network")
    with pytest.raises(OSError), socket.create_connection((own, address.port), timeout=2):
        pass


def test_a_port_that_is_taken_is_a_sentence(address, apart):
    with pytest.raises(PbrdfError, match=f"port {address.port} cannot be used .*choose another"):
        apart(asyncio.run, serve(Workspace, address.port, print))


def test_a_frame_holds_numbers_of_json_alone():
    frame = pack({"type": "x"}, [b"ab", b"c"])
    content, buffers = unpack(frame)
    assert content == {"type": "x"} and [bytes(b) for b in buffers] == [b"ab", b"c"]
