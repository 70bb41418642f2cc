"""Every page of documentation runs: its Python blocks, cells and commands, in order, in a folder of its own.

What a page takes for granted is made by :mod:`docs_setup`; commands that cannot run here stand there with the reason.
"""

from __future__ import annotations

import importlib
import re
from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

import docs_setup
import pbrdf
from docs_pages import DOCS, PAGES, pieces, words
from pbrdf.cli.main import COMMANDS, app
from pbrdf.models import MODELS


@contextmanager
def models_of_the_package():
    """As a command finds them: a process of its own knows nothing of the models that a page's Python has registered."""
    registered = dict(MODELS._classes)
    for name in registered.keys() - KNOWN:
        del MODELS._classes[name]
    yield
    MODELS._classes.clear()
    MODELS._classes.update(registered)


KNOWN = set(MODELS)
#: Commands of other pages, which the gallery names again.
ELSEWHERE = {piece.text for name, page in PAGES.items() if name != "gallery" for piece in pieces(page)}
RUNNING = [
    name
    for name, page in PAGES.items()
    if name not in docs_setup.PAGES_NOT_RUN and any(True for _ in pieces(page))
]


@pytest.mark.slow
# a session leaves pictures open
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", RUNNING)
def test_the_page_runs(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    docs_setup.prepare(name)
    namespace: dict = {"__name__": "page"}
    for piece in pieces(PAGES[name]):
        place = f"{PAGES[name]}:{piece.line}"
        if piece.kind == "file":
            file, _, text = piece.text.partition("\n")
            (tmp_path / file).write_text(text, encoding="utf-8")
        elif piece.kind == "python":
            # the line numbers of an error are those of the page
            exec(compile("\n" * (piece.line - 1) + piece.text, str(PAGES[name]), "exec"), namespace)
        elif docs_setup.why_not(piece.text) is None and not (name == "gallery" and piece.text in ELSEWHERE):
            with models_of_the_package():
                result = CliRunner().invoke(app, docs_setup.small(name, words(piece.text)))
            assert result.exit_code == piece.code, f"{place}: {piece.text}\n{result.output}"
            if result.exception is not None and not isinstance(result.exception, SystemExit):
                raise result.exception
    if name in CHECKS:
        CHECKS[name](namespace, capsys.readouterr().out)


def identification(namespace, output):
    """The example comes out as the page says."""
    assert namespace["found"].materials == ["grey"]
    assert output.endswith("True\n")


def own_model(namespace, output):
    """The model is found again, in few lines."""
    assert namespace["result"].estimates["alpha"].value == pytest.approx(0.1, rel=1e-3)
    assert "lambert-ggx" in output
    first = next(piece.text for piece in pieces(PAGES["own-model"]) if piece.kind == "python")
    assert first.count("\n") <= 45


CHECKS = {"identification": identification, "own-model": own_model}


def test_every_exception_is_of_use():
    """A command that no page shows any more is no exception."""
    commands = [piece.text for page in PAGES.values() for piece in pieces(page) if piece.kind == "command"]
    for pattern in docs_setup.NOT_RUN:
        assert any(pattern in command for command in commands), pattern


def links(page):
    """What the links and pictures of a page name, outside of code."""
    prose = re.sub(
        r"^```.*?^```|^    .*?$|`[^`\n]*`",
        "",
        page.read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    )
    return [
        target for target in re.findall(r"\]\(([^()\s]+)\)", prose) if not target.startswith(("http", "#"))
    ]


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_to_files(name):
    for target in links(PAGES[name]):
        path = PAGES[name].parent / target.partition("#")[0]
        # these are made when the manual is built
        assert path.exists() or "docs/generated/" in path.as_posix(), target


def test_every_page_has_its_place():
    listed = set(re.findall(r"^[\w/-]+$", PAGES["index"].read_text(encoding="utf-8"), re.MULTILINE))
    assert set(PAGES) - {"index", "README"} <= listed


@pytest.fixture
def generated(monkeypatch):
    """The Sphinx extension, which needs no Sphinx to write most of its pages."""
    monkeypatch.syspath_prepend(DOCS / "_ext")
    return importlib.import_module("generated_pages")


@pytest.mark.slow
def test_every_command_is_described(generated):
    page = generated.commands_page()
    for command in COMMANDS:
        assert f"\n## pbrdf {command}\n" in page
    assert "\n### pbrdf library add\n" in page
    assert "`--hold-out KIND=VALUES`\n: " in page
    assert "FORMATS" not in page


def test_every_public_name_has_its_group(generated):
    names = [name for group in generated._groups().values() for name in group]
    assert sorted(names) == sorted(name for name in pbrdf.__all__ if not name.startswith("__"))


def test_every_model_is_shown(generated, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(generated, "_draw", lambda model, name, target: drawn.append(name))
    page = generated.model_zoo(tmp_path)
    assert drawn == list(MODELS)
    assert all(f"\n## {name}\n" in page for name in MODELS)
