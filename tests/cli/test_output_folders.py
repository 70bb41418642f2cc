"""Folders that commands write: names that are those of files, and earlier results of the same names."""

from __future__ import annotations

import pytest

from pbrdf.cli.folders import ready_folder, say_written
from pbrdf.instruments.polarimeter.presets import PRESETS


@pytest.mark.parametrize(
    "command",
    [
        ("fit", "matte-white-thick"),
        ("compare", "matte-white-thick"),
        ("identify", "matte-white-thick"),
        ("render", "white"),
        ("reproduce",),
        ("measure", "white"),
    ],
    ids=lambda command: command[0],
)
@pytest.mark.parametrize("name", ["x.csv", "sub/x.NC"])
def test_the_name_of_a_file_is_no_folder(refused, command, name):
    said = refused(*command, "-o", name)
    assert "into a folder" in said
    assert said.endswith(f"such as {name.rpartition('.')[0]}")


def test_dots_in_names_and_folders_that_are_there_are_taken(tmp_path):
    ready_folder(tmp_path / "paint-1.5mm")
    (tmp_path / "odd.csv").mkdir()
    assert ready_folder(tmp_path / "odd.csv") == frozenset()


def test_what_takes_the_place_of_earlier_results_is_told(tmp_path, capsys):
    folder = tmp_path / "f"
    files = [folder / name for name in ("a.json", "b.png")]
    assert ready_folder(folder) == frozenset()
    say_written(folder, files, frozenset())
    assert "earlier" not in capsys.readouterr().out
    folder.mkdir()
    (folder / "b.png").touch()
    (folder / "mine.txt").touch()
    say_written(folder, files, ready_folder(folder))
    said = " ".join(capsys.readouterr().out.split())
    assert said.endswith("a.json, b.png (in place of earlier ones: b.png)")
    (folder / "a.json").touch()
    say_written(folder, files, ready_folder(folder))
    assert "all of them in place of earlier ones" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_a_second_fit_says_that_the_first_is_gone(run):
    fit = ("fit", "matte-white-thick", "--starts", 1, "--no-figures", "--no-suggestions")
    assert "earlier ones" not in run(*fit).stdout
    assert "all of them in place of earlier ones" in " ".join(run(*fit).stdout.split())


def test_frames_without_an_instrument_are_told_which_there_are(refused):
    said = refused("reduce", "frames")
    assert all(name in said for name in PRESETS)


@pytest.mark.slow
def test_a_plan_goes_into_a_folder(run, refused, tmp_path):
    fast = ("--smallest-bistatic", 30, "--largest-zenith", 70, "--budget", 12)
    run("plan", "matte-white-thick", *fast, "-o", "plans/next")
    assert sorted(p.name for p in (tmp_path / "plans" / "next").iterdir()) == ["plan.csv", "plan.png"]
    assert refused("plan", "white", "-o", "x.txt").endswith("must be .csv; or give a folder")
