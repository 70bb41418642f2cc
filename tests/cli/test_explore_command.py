"""``pbrdf explore``: what it opens, what it refuses, and its end."""

import os
import signal
import subprocess
import sys
import urllib.request

import pytest

import pbrdf
from pbrdf.explorer import program


@pytest.fixture
def shown(monkeypatch):
    """What is shown instead of a page."""
    calls = []
    monkeypatch.setattr(
        program, "show", lambda workspace, port, browser, say: calls.append((workspace, port, browser))
    )
    monkeypatch.setattr("pbrdf.cli.explore.end", lambda code: None)
    return calls


def test_sources_are_opened(run, shown, tmp_path):
    pbrdf.write(pbrdf.open_experiment("white"), tmp_path / "paint.csv")
    run("explore", "white", "paint.csv", "--select", "group=1", "--no-browser", "--port", "4321")
    ((workspace, port, browser),) = shown
    assert (port, browser) == (4321, False)
    assert [name for name, _ in workspace.models] == ["white"]
    ((name, dataset),) = workspace.datasets
    assert name == "paint.csv" and dataset.sizes["geometry"] == 21
    run("explore")
    assert shown[1][0].state() is None and shown[1][1:] == (0, True)


def test_what_cannot_be_shown(refused, shown):
    assert "no paint of that name" in refused("explore", "nothing")
    assert refused("explore", "white", "--azimuth", "forward=180").startswith(
        "--azimuth is for files of data"
    )
    assert refused("explore", *["white"] * 7).startswith("white: the explorer shows 6 models")
    assert shown == []


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="SIGINT")
def test_ctrl_c_ends_it(tmp_path):
    """The address answers until then; nothing but the one line is said after it."""
    # a shell that starts it in the background would have it ignore SIGINT
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from pbrdf.cli.main import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", code, "explore", "white", "--no-browser"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        address = process.stdout.readline().split()[-1]
        assert process.stdout.readline() == "Ctrl-C ends it.\n"
        with urllib.request.urlopen(address, timeout=30) as page:
            assert page.status == 200
        # the port is taken now
        port = address.partition("/?")[0].rpartition(":")[2]
        taken = subprocess.run(
            [sys.executable, "-c", code, "explore", "--no-browser", "--port", port],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert taken.returncode == 2
        assert taken.stderr.startswith(f"pbrdf: error: port {port} cannot be used")
        process.send_signal(signal.SIGINT)
        rest, said = process.communicate(timeout=30)
    assert (process.returncode, rest, said) == (0, "", "pbrdf: the explorer has ended\n")
