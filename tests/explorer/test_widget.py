"""``pbrdf.explore`` in a notebook: the module of the page, its requests answered in the kernel."""

import asyncio
import sys
import threading
import types

import pytest

import pbrdf
from pbrdf.errors import PbrdfError
from pbrdf.explorer import explore as explore_module
from pbrdf.explorer.module import module_text
from pbrdf.explorer.workspace import Workspace

pytest.importorskip("anywidget")


@pytest.fixture
def notebook(monkeypatch):
    monkeypatch.setattr(explore_module, "_in_notebook", lambda: True)


@pytest.fixture
def widget(notebook, white, monkeypatch, apart):
    widget = apart(lambda: pbrdf.explore(white, measured=pbrdf.open_experiment("white")))
    widget.sent = []
    monkeypatch.setattr(
        type(widget), "send", lambda self, content, buffers=None: self.sent.append((content, buffers))
    )
    yield widget
    widget.close()


def ask(widget, content, buffers=()):
    """A message as the front end sends it."""
    widget._handle_custom_msg(content, list(buffers))
    widget._session.wait()


def test_it_talks_as_the_page_does(widget, white):
    assert widget._esm == module_text() and ".pbrdf-explorer" in widget._css
    ask(widget, {"type": "hello"})
    ((welcome, _),) = widget.sent
    assert welcome["type"] == "welcome"
    assert welcome["state"]["layers"] == [{"name": white.name, "shown": True, **white.to_dict()}]
    assert [name for name, _ in widget._session.workspace.datasets] == ["measured"]
    ask(widget, {"type": "draw", "id": 1, "views": ["hemisphere"], "state": welcome["state"]})
    header, buffers = widget.sent[-1]
    assert header["type"] == "picture" and len(buffers) >= 1


def test_a_view_that_goes_leaves_the_widget_at_work(widget):
    ask(widget, {"type": "goodbye"})
    assert widget.sent == []
    ask(widget, {"type": "hello"})
    assert len(widget.sent) == 1
    widget.close()
    ask(widget, {"type": "hello"})
    assert len(widget.sent) == 1


def test_answers_are_sent_by_the_thread_of_the_kernel(notebook, white, monkeypatch, apart):
    """Marimo knows from no other thread where to send."""

    async def cell():
        widget = pbrdf.explore(white)
        threads = []
        monkeypatch.setattr(type(widget), "send", lambda *rest: threads.append(threading.current_thread()))
        widget._handle_custom_msg({"type": "hello"}, [])
        while not threads:
            await asyncio.sleep(0.01)
        widget.close()
        return threads == [threading.current_thread()]

    assert apart(lambda: asyncio.run(cell()))


def test_what_it_shows(white):
    add, workspace = explore_module._add, Workspace()
    data = pbrdf.open_experiment("white")
    add(workspace, None, "white")
    add(workspace, "other", white)
    add(workspace, None, data)
    assert [name for name, _ in workspace.models] == ["white", "other"]
    assert [name for name, _ in workspace.datasets] == [data.attrs["title"]]
    with pytest.raises(PbrdfError, match="not int"):
        add(workspace, None, 3)
    with pytest.raises(PbrdfError):
        add(workspace, None, data.drop_vars("theta_i"))


def test_notebooks_are_known(monkeypatch):
    for module in ("marimo", "IPython"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    assert not explore_module._in_notebook()
    shell = types.SimpleNamespace()
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    assert not explore_module._in_notebook()  # IPython in a terminal
    shell.kernel = object()
    assert explore_module._in_notebook()
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: None))
    monkeypatch.setitem(sys.modules, "marimo", types.SimpleNamespace(running_in_notebook=lambda: True))
    assert explore_module._in_notebook()
