"""The help: nothing wider than 80 columns, common options first, and examples that run."""

from __future__ import annotations

import re
import shlex
from collections import Counter

import pytest
import typer

from pbrdf.cli.help_page import GROUPS, READING_PANEL
from pbrdf.cli.main import COMMANDS, app
from pbrdf.instruments.virtual.examples import EXAMPLES

ROOT = typer.main.get_command(app)
#: Pages by the words that ask for them.
PAGES = [(), *((name,) for name in COMMANDS)]
PAGES += [("library", name) for name in ROOT.commands["library"].commands]
#: The example that the help of a command names, with files for its first example; made small where that takes long.
NEEDED = {
    "calibrate": "known-light",
    "check": "table",
    "convert": "table",
    "library add": "panels",
    "map": "frames",
    "reduce": "mosaic",
}
SMALLER = {
    "fit": "--starts 2 --no-figures",
    "compare": "--starts 2 --vary 0 --no-figures",
    "map": "--starts 2 --no-figures",
    "measure": "--sample-angles 40 --patch 2",
    "plan": "--camera-positions 2",
    "render": "--size 16x16 --spp 16",
    "reduce": "--no-pictures",
}
#: What shows a page until it is stopped, what has slow tests of its own, what takes a file of another program.
NOT_RUN = {"explore", "reproduce", "demo", "compare-with"}


def command(words):
    found = ROOT
    for word in words:
        found = found.commands[word]
    return found


def shown(words):
    """What stands in backticks and begins with the command, in the order of its help."""
    if hasattr(command(words), "commands"):
        return []
    text = " ".join((command(words).help or "").split())
    return [
        line
        for line in re.findall(r"`(pbrdf [^`]+)`", text)
        if f"{line} ".startswith(f"pbrdf {' '.join(words)} ")
    ]


@pytest.mark.parametrize("words", PAGES, ids=" ".join)
def test_every_page_fits_into_80_columns(run, monkeypatch, words):
    monkeypatch.setenv("COLUMNS", "200")
    text = run(*words, "--help").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "\x00" not in text
    monkeypatch.setenv("COLUMNS", "60")
    # a name with what it takes may be longer than a narrow terminal; words are not
    assert "Options:" in run(*words, "--help").stdout


def test_the_first_page_has_every_command_once():
    assert Counter(name for names in GROUPS.values() for name in names) == Counter(list(COMMANDS))


@pytest.mark.parametrize("words", PAGES[1:], ids=" ".join)
def test_common_options_come_first_and_are_few(words):
    found = command(words)
    if hasattr(found, "commands"):
        return
    panels = [getattr(p, "rich_help_panel", None) for p in found.params if p.param_type_name == "option"]
    assert panels.count(None) <= 15
    assert all(count > 1 for panel, count in Counter(panels).items() if panel not in (None, READING_PANEL))


def test_options_that_read_a_file_are_spelled_out_once(run):
    names = ("check", "fit", "compare", "identify", "plot", "convert")
    pages = {name: " ".join(run(name, "--help").stdout.split()) for name in names}
    for name, page in pages.items():
        assert f"{READING_PANEL}:" in page
        assert ("--skip-invalid Leave out" in page) == (name == "check")
        assert ("see `pbrdf check --help`" in page) == (name != "check")


def test_defaults_and_ranges_are_told_in_words(run):
    page = " ".join(run("render", "--help").stdout.split())
    assert "[default: by scene; 0 to 88]" in page
    assert "[default: 256; at least 1]" in page
    assert "[default: the models' own amplitudes]" in page


def test_examples_can_be_copied(run):
    """A long command is continued as a shell takes it."""
    page = run("library", "add", "--help").stdout
    line = page[page.index("pbrdf library add pearl") :].split("\n  #")[0].replace("\\\n", " ")
    assert shlex.split(line) == shlex.split(shown(("library", "add"))[0])


@pytest.mark.parametrize(
    ("words", "expected"), [("pbrdf rend", "render"), ("pbrdf fit --hold", "--hold-out")]
)
def test_a_shell_completes_commands_and_options(monkeypatch, capsys, words, expected):
    monkeypatch.setenv("_PBRDF_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
    with pytest.raises(SystemExit):
        app([], prog_name="pbrdf")
    assert expected in capsys.readouterr().out.split()


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [words for words in PAGES[1:] if shown(words) and words[0] not in NOT_RUN], ids=" ".join
)
def test_the_first_example_of_each_command_runs(run, words):
    name = " ".join(words)
    first = shown(words)[0]
    if name in NEEDED:
        example = NEEDED[name]
        assert re.search(rf"`pbrdf example [^`]*\b{example}\b", command(words).help)
        run("example", example)
        for before in EXAMPLES[example].commands:
            if before.split()[1] == words[0]:
                break
            run(*shlex.split(before)[1:], *shlex.split(SMALLER.get(before.split()[1], "")))
    # what follows holds: of an option that is given twice the last one
    run(*shlex.split(first)[1:], *shlex.split(SMALLER.get(name, "")))


def test_commands_without_an_example_are_those_that_take_nothing():
    without = {" ".join(words) for words in PAGES[1:] if not shown(words)}
    assert without == {
        "paints",
        "models",
        "doctor",
        "library",
        "library list",
        "library show",
        "library remove",
    }
