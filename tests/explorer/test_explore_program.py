"""The explorer as a program: where a browser would appear, and what is said where none would."""

import builtins
import threading

import pytest

import pbrdf
from pbrdf.errors import PbrdfError
from pbrdf.explorer import program
from pbrdf.explorer.program import from_elsewhere, has_browser, show
from pbrdf.explorer.workspace import Workspace


@pytest.mark.parametrize(
    ("environment", "platform", "seen"),
    [
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "linux", False),
        ({}, "darwin", True),
        ({}, "win32", True),
        ({"SSH_CONNECTION": "1 2 3 4", "DISPLAY": ":10"}, "linux", False),
        ({"SSH_TTY": "/dev/pts/1"}, "darwin", False),
        ({"BROWSER": "firefox"}, "linux", True),
    ],
)
def test_where_a_browser_appears(environment, platform, seen):
    assert has_browser(environment, platform) is seen


def test_the_way_over_ssh_is_said():
    """The port is the same on both sides: the server refuses other hosts."""
    environment = {"USER": "ann", "SSH_CONNECTION": "10.0.0.9 50000 10.0.0.1 22"}
    lines = from_elsewhere("http://127.0.0.1:4321/?token=x", environment)
    assert "ssh -N -L 4321:127.0.0.1:4321 ann@10.0.0.1" in lines[1]
    assert "user@this-machine" in from_elsewhere("http://127.0.0.1:4321/", {})[1]


@pytest.fixture
def interrupted(monkeypatch):
    """Serving ends with Ctrl-C as soon as the page can be opened."""
    from pbrdf.explorer import server

    async def serve(workspace, port, ready):
        ready("http://127.0.0.1:4321/?token=x")
        raise KeyboardInterrupt

    monkeypatch.setattr(server, "serve", serve)


@pytest.mark.parametrize("wanted", [True, False])
def test_the_address_is_said_and_opened(interrupted, monkeypatch, wanted):
    opened = threading.Event()
    monkeypatch.setattr(program.webbrowser, "open", lambda address: opened.set())
    monkeypatch.setenv("BROWSER", "firefox")
    said = []
    show(Workspace(), 0, wanted, said.append)
    assert said == ["The explorer is at http://127.0.0.1:4321/?token=x", "Ctrl-C ends it."]
    assert opened.wait(10 if wanted else 0.0) is wanted


def test_python_serves_a_page_outside_of_notebooks(interrupted, monkeypatch, capsys, white):
    monkeypatch.setattr(program, "has_browser", lambda environment: False)
    assert pbrdf.explore(white, pbrdf.open_experiment("white")) is None
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("The explorer is at") and any("ssh -N -L 4321" in line for line in lines)


def test_what_is_not_installed_is_said(monkeypatch):
    real = builtins.__import__

    def without(name, *rest):
        if name.partition(".")[0] == "tornado" or name == "pbrdf.explorer.server":
            raise ModuleNotFoundError(name=name if name.startswith("tornado") else "tornado")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(PbrdfError, match=r"needs Tornado: pip install 'pbrdf\[explore\]'"):
        show(Workspace(), 0, False, print)
