"""Files that are dropped on the page: opened by a process of their own, refused in words, nothing left behind."""

import os
import subprocess
import sys
import tempfile
import threading
from importlib import resources

import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.explorer import uploads
from pbrdf.explorer.session import Session
from pbrdf.explorer.upload_process import LIMITS
from pbrdf.explorer.uploads import MOST_BYTES, file_name, open_apart
from pbrdf.explorer.workspace import Workspace, beginning

TABLE = (resources.files("pbrdf.data") / "experiment" / "white.csv").read_bytes()


@pytest.fixture(autouse=True)
def nothing_left(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    yield
    assert list(tmp_path.iterdir()) == []


class Page:
    def __init__(self):
        self.sent, self.heard = [], threading.Condition()
        self.session = Session(Workspace(), self.hear)

    def hear(self, content, buffers):
        with self.heard:
            self.sent.append(content)
            self.heard.notify()

    def drop(self, name, content, **more):
        """Drop a file; returns the answer."""
        before = len(self.sent)
        self.session.receive({"type": "open", "id": 7, "name": name, **more}, [memoryview(content)])
        with self.heard:
            assert self.heard.wait_for(lambda: len(self.sent) > before, 60)
        return self.sent[-1]


@pytest.fixture
def page():
    page = Page()
    yield page
    page.session.close()


@pytest.mark.slow
def test_a_table_is_opened_while_pictures_are_drawn(page, white, monkeypatch):
    """The session answers other requests while the process reads."""
    begun, go = threading.Event(), threading.Event()
    apart = uploads.open_apart

    def slowly(*arguments):
        begun.set()
        assert go.wait(30)
        return apart(*arguments)

    monkeypatch.setattr(uploads, "open_apart", slowly)
    page.session.receive({"type": "open", "id": 7, "name": "../../x.csv"}, [memoryview(TABLE)])
    assert begun.wait(10)
    state = Workspace([("white", white)]).state()
    page.session.receive({"type": "draw", "id": 8, "views": ["hemisphere"], "state": state})
    page.session.wait()
    assert [c["type"] for c in page.sent] == ["picture"]
    go.set()
    with page.heard:
        assert page.heard.wait_for(lambda: len(page.sent) == 2, 60)
    answer = page.sent[-1]
    assert (answer["type"], answer["id"], answer["name"]) == ("opened", 7, "x.csv")
    assert answer["beginning"] == beginning(page.session.workspace.datasets[0][1])
    assert answer["datasets"] == ["x.csv"] and "63 geometries" in " ".join(answer["lines"])
    ((name, dataset),) = page.session.workspace.datasets
    assert name == "x.csv" and dataset.identical(pbrdf.open_experiment("white"))


@pytest.mark.slow
def test_files_that_cannot_be_used(page):
    """Each is refused by its name, not by that of a folder here."""
    nan = b"theta_i,theta_r,phi,I\n10,20,0,nan\n"
    stated = {"quantity": "brdf", "azimuth": "forward=0"}
    for name, content, options, words in (
        ("C:\\data\\x.csv", bytes(5000), {}, "x.csv: line 1: a byte 0x00 is in no text"),
        ("x.csv", nan, stated, "x.csv: there is no measured value in it"),
        ("deep.json", b'{"model": ' + b"[" * 100_000, {}, "deep.json: not JSON"),
    ):
        answer = page.drop(name, content, options=options)
        assert answer["type"] == "error" and answer["about"] == "open", answer
        assert answer["text"].startswith(words)
    assert page.session.workspace.datasets == []


def test_files_that_are_not_even_begun(page, monkeypatch):
    monkeypatch.setattr(uploads, "open_apart", lambda *arguments: pytest.fail("begun"))
    too_large = bytes(MOST_BYTES + 1)
    assert "more than the 50 MB that the page takes" in page.drop("zeros.csv", too_large)["text"]
    assert "empty" in page.drop("x.csv", b"")["text"]
    assert "no option" in page.drop("x.csv", TABLE, options={"path": "/etc/passwd"})["text"]
    answer = page.drop("x.csv", TABLE, options={"format": "csv"})
    assert answer["type"] == "error" and "'format' is no option" in answer["text"]


def test_only_so_many_wait(page, monkeypatch):
    go = threading.Event()
    monkeypatch.setattr(uploads, "open_apart", lambda *arguments: go.wait(30) and Workspace())
    for _ in range(9):
        page.session.receive({"type": "open", "name": "x.csv"}, [memoryview(TABLE)])
    page.session.wait()
    (refused,) = [c for c in page.sent if c["type"] == "error"]
    assert "8 files are waiting" in refused["text"]
    go.set()
    with page.heard:
        assert page.heard.wait_for(lambda: len(page.sent) == 9, 30)


@pytest.mark.slow
def test_a_model_is_opened(page, white):
    answer = page.drop("mine.json", white.to_json().encode())
    assert answer["layers"] == [{"name": "mine", "shown": True, **white.to_dict()}]
    assert answer["datasets"] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (
            LIMITS._replace(seconds=0.05),
            "x.csv: it was not read within 0 s: open it with pbrdf explore x.csv",
        ),
        (LIMITS._replace(written=1000), "x.csv: reading it took more than"),
    ],
)
def test_limits_end_the_process_and_are_said(limits, words):
    ends = []
    with pytest.raises(DataError, match=words):
        open_apart("x.csv", TABLE, {}, ends, limits)
    assert ends == []


@pytest.mark.slow
def test_a_page_that_closes_ends_what_it_opens():
    ends, failed = [], []

    def begin():
        try:
            open_apart("x.csv", TABLE, {}, ends)
        except DataError as error:
            failed.append(error)

    thread = threading.Thread(target=begin)
    thread.start()
    while not ends:
        assert thread.is_alive()
    ends[0]()
    thread.join(10)
    assert not thread.is_alive() and len(failed) == 1


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("../../x.csv", "x.csv"),
        ("..\\..\\x.csv", "x.csv"),
        ("/etc/passwd", "passwd"),
        ("..", "file"),
        ("", "file"),
        (".bashrc", "bashrc"),
        ("a\x00b\n.csv", "a_b_.csv"),
        ("Weiß (2).csv", "Weiß (2).csv"),
        ("-rf", "-rf"),
        ("x" * 300 + ".csv", "x" * 80 + ".csv"),
    ],
)
def test_names_lead_nowhere(given, name, tmp_path):
    assert file_name(given) == name
    assert (tmp_path / name).resolve().parent == tmp_path.resolve()


@pytest.mark.slow
def test_memory_is_limited():
    """In a process as that which opens files: what asks for more than there may be gets none."""
    code = (
        "from pbrdf.explorer import upload_process as process\n"
        "process._limit(process.LIMITS._replace(memory=1 << 30))\n"
        "try: bytearray(1 << 30)\n"
        "except MemoryError: print('refused')"
    )
    path = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **path}, capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "refused\n", done.stderr


def test_limits_leave_room_for_the_largest_file():
    assert LIMITS.memory > 10 * MOST_BYTES and LIMITS.written > 2 * MOST_BYTES
