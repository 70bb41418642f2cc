"""``pbrdf example`` and ``pbrdf demo``: what a newcomer runs first."""

from __future__ import annotations

import importlib.util
import subprocess

import pytest

from pbrdf.cli import demo as demo_module
from pbrdf.instruments.virtual.examples import EXAMPLES


def test_examples_are_listed(run):
    table = run("example").stdout
    for name, example in EXAMPLES.items():
        assert f"\n{name} " in table and example.target in table


def test_an_example_is_written_and_says_what_takes_it(run, refused, tmp_path):
    lines = run("example", "table", "scene").stdout.splitlines()
    assert lines[:3] == ["paint.csv", "Try it with:", "  pbrdf check paint.csv"]
    assert (tmp_path / "scene.xml").is_file()
    assert "Nothing is wrong with it." in run("check", "paint.csv").stdout
    assert "paint.csv: there is something of that name already" in refused("example", "table")
    assert "there is no example 'csv': choose one of table, " in refused("example", "csv")


@pytest.mark.slow
def test_the_demonstration_goes_from_a_table_to_a_picture(run, tmp_path):
    done = run("demo", "-o", "here")
    for step in demo_module.STEPS:
        assert f"   $ {' '.join(step.command)}\n" in done.stdout
        for name, _ in step.shows:
            assert (tmp_path / "here" / name).is_file()
    assert "# stokes: p-s" in done.stdout
    assert "Nothing is wrong with it." in done.stdout
    assert "The model describes the data" in done.stdout
    assert "double-gauss predicts best" in done.stdout
    assert done.stdout.rstrip().splitlines()[-1].endswith("pbrdf reproduce")
    # what a newcomer must not read in a run where all is well
    for word in ("fails", "fail", "error:", "warning", "refus"):
        assert word not in (done.stdout + done.stderr).lower()


def stand_in(monkeypatch, code=0):
    """Run no command, but say what was run; one of them ends with a code."""
    ran = []

    def run_nothing(words, *, cwd, **more):
        words = words[len(demo_module._PROGRAM) :]
        ran.append(words[0])
        if words[0] == "example":
            (cwd / "paint.csv").write_text("# a table\n" * 20)
        return subprocess.CompletedProcess(words, code if words[0] == "fit" else 0, "one\n\n\n" * 30)

    monkeypatch.setattr(demo_module.subprocess, "run", run_nothing)
    return ran


def test_without_mitsuba_the_demonstration_says_how_to_get_it(run, monkeypatch):
    ran = stand_in(monkeypatch)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    text = run("demo").stdout
    assert ran == ["example", "check", "fit", "compare"]
    assert "pip install 'pbrdf[render]' brings it" in text
    assert "stokes.png" not in text and "index.html" in text
    # again: the table stays, as it may be the user's by now
    run("demo")
    assert ran[4:] == ["check", "fit", "compare"]


def test_the_demonstration_ends_where_a_step_does(run, monkeypatch):
    ran = stand_in(monkeypatch, code=3)
    done = run("demo", code=3)
    assert ran == ["example", "check", "fit"]
    assert "pbrdf fit paint.csv --hold-out group=3 ended with exit code 3" in done.stderr
