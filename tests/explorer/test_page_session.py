"""One page at work: what is answered, what is not any more, and what a page that is none may send."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from pbrdf.explorer import session as session_module
from pbrdf.explorer.messages import MOST_BUFFERS, MOST_TEXT, pack, unpack
from pbrdf.explorer.session import Session
from pbrdf.explorer.workspace import Workspace


class View:
    """A view whose pictures wait until they are let go."""

    def __init__(self):
        self.begun, self.go, self.drawn = threading.Event(), threading.Event(), 0

    def draw(self, state, workspace, dragging):
        self.begun.set()
        assert self.go.wait(10)
        self.drawn += 1
        return {"shape": [1]}, [b"1234"]


@pytest.fixture
def view(monkeypatch):
    view = View()
    monkeypatch.setattr(session_module, "VIEWS", {"one": "one", "two": "two"})
    monkeypatch.setattr(session_module, "import_module", lambda name: view)
    return view


@pytest.fixture
def page(white):
    """A session and what it has sent."""
    sent = []
    workspace = Workspace([("white", white)])
    session = Session(workspace, lambda content, buffers: sent.append((content, buffers)))
    session.sent = sent
    session.state = workspace.state()
    yield session
    session.close()


def draw(page, number, **changes):
    page.receive({"type": "draw", "id": number, "views": ["one"], "state": page.state, **changes})


def test_the_latest_picture_wins(page, view):
    for number in range(1, 6):
        draw(page, number)
        assert view.begun.wait(10)
    view.go.set()
    page.wait()
    assert view.drawn == 2  # the one that was at work, and the last
    assert [(c["type"], c["id"]) for c, _ in page.sent] == [
        ("picture", 1),
        *(("superseded", number) for number in (2, 3, 4)),
        ("picture", 5),
    ]


def test_a_page_that_goes_while_it_is_drawn(page, view):
    draw(page, 1, views=["one", "two"])
    assert view.begun.wait(10)
    draw(page, 2)
    page.close()
    page.close()
    view.go.set()
    page._thread.join(10)
    assert not page._thread.is_alive()
    assert view.drawn == 1 and page.sent == []
    draw(page, 3)
    assert page.sent == []


def test_what_runs_for_a_page_ends_with_it(page):
    ended = []
    page.workspace.at_close += [lambda: ended.append(1), lambda: 1 / 0]
    page.close()
    assert ended == [1]


def test_a_page_that_cannot_be_sent_to(white, view, caplog):
    """The thread survives an answer that does not get through."""
    view.go.set()
    tried = []

    def emit(content, buffers):
        tried.append(content)
        raise OSError("gone")

    session = Session(Workspace([("white", white)]), emit)
    session.state = session.workspace.state()
    for number in (1, 2):
        draw(session, number)
        session.wait()
    assert len(tried) == 2 and "could not send" in caplog.text
    session.close()


def test_a_fault_of_one_view_is_told_beside_it(page, view, caplog):
    view.draw = lambda state, workspace, dragging: 1 / 0
    draw(page, 1, views=["one", "two"])
    page.wait()
    assert [(c["view"], c["last"]) for c, _ in page.sent] == [("one", False), ("two", True)]
    assert all("error of the explorer" in c["error"] for c, _ in page.sent)
    assert "ZeroDivisionError" in caplog.text


def test_a_flood_is_refused_in_words(page, view):
    draw(page, 0)
    assert view.begun.wait(10)
    for number in range(1, 100):
        draw(page, number)
    refused = [c for c, _ in page.sent if c["type"] == "error"]
    assert len(refused) == 99 - 64 and "wait for the answers" in refused[0]["text"]
    view.go.set()
    page.wait()


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"type": None},
        {"type": ["draw"]},
        {"type": {"a": 1}, "id": {"b": [2]}},
        {"type": "nothing"},
        {"type": "draw"},
        {"type": "draw", "views": "one", "state": {"version": 1}},
        {"type": "draw", "views": [{}], "state": []},
        {"type": "open"},
        {"type": "open", "name": ["x"]},
        {"type": "open", "name": "x.csv", "options": [1]},
    ],
)
def test_requests_that_are_none_are_answered_in_words(page, request_, caplog):
    page.receive(request_)
    page.wait()
    ((answer, _),) = page.sent
    assert answer["type"] == "error" and answer["text"]
    assert answer["id"] is None
    assert caplog.text == ""


@pytest.mark.parametrize("too_much", [{"a": 1e300}, {"a": 1e39}])
def test_numbers_beyond_measure_end_in_words(page, too_much, caplog):
    page.state["layers"][0]["parameters"] |= too_much
    page.state["quantities"] = ["intensity", "dolp", "q", "m11"]
    views = list(session_module.VIEWS)
    page.receive({"type": "draw", "id": 1, "views": views, "state": page.state})
    page.wait()
    answers = {content["view"]: content for content, _ in page.sent}
    assert list(answers) == views and answers[views[-1]]["last"]
    assert "too large to be drawn" in answers["hemisphere"]["error"]
    assert caplog.text == ""


def test_an_answer_that_cannot_be_sent_is_said(white):
    sent = []

    def send(content, buffers):
        pack(content, buffers)
        sent.append(content)

    session = Session(Workspace([("white", white)]), send)
    picture = {"type": "picture", "id": 4, "view": "one", "last": True}
    session.emit({**picture, "most": float("inf")}, [])
    session.emit({"type": "found", "id": 5, "most": float("nan")}, [])
    session.close()
    assert sent[0].items() >= picture.items() and "the terminal says more" in sent[0]["error"]
    assert sent[1]["type"] == "error" and sent[1]["id"] == 5


def frame(text, rest=b""):
    return len(text).to_bytes(4, "little") + text + rest


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b'{"a":NaN}',
        b'{"a":' + b"9" * 5000 + b"}",
        b'{"buffers":[-1]}',
        b'{"buffers":[true]}',
        b'{"buffers":["1"]}',
        b'{"buffers":[9]}',
        b'{"buffers":' + str([0] * (MOST_BUFFERS + 1)).encode() + b"}",
        b'{"a":"' + b"x" * MOST_TEXT + b'"}',
        b"\xff",
    ],
    ids=lambda text: text[:14].decode(errors="replace"),
)
def test_frames_beyond_measure_are_refused(text):
    with pytest.raises(ValueError, match="no frame of the explorer"):
        unpack(frame(text))


def test_pages_draw_at_once(white):
    """Dr.Jit evaluates in the threads of several pages: their pictures are those of one page alone."""
    pictures = {}

    def emit_of(key):
        return lambda content, buffers: pictures.setdefault(key, []).append(np.frombuffer(buffers[0], "<f2"))

    pages = [Session(Workspace([("white", white)]), emit_of(k)) for k in range(3)]
    for _ in range(4):
        for page in pages:
            page.receive({"type": "draw", "views": ["hemisphere"], "state": page.workspace.state()})
    for page in pages:
        page.wait()
        page.close()
    first = pictures[0][0]
    assert np.isfinite(first).all()
    assert all(np.array_equal(picture, first) for drawn in pictures.values() for picture in drawn)


@pytest.mark.slow
def test_python_ends_though_pages_are_open():
    """As a notebook's kernel does, whose widgets nobody has closed."""
    code = (
        "import pbrdf\n"
        "from pbrdf.explorer.session import Session\n"
        "from pbrdf.explorer.workspace import Workspace\n"
        "workspace = Workspace([('white', pbrdf.load_paint('white'))])\n"
        "session = Session(workspace, lambda content, buffers: None)\n"
        "session.receive({'type': 'draw', 'views': ['hemisphere'], 'state': workspace.state()})\n"
        "session.wait()"
    )
    path = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **path}, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stderr) == (0, "")
