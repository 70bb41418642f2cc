"""``pbrdf compare``: what it prints, writes and refuses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import own_model

STARTS = ("--starts", 2, "--vary", 0)


@pytest.mark.slow
def test_a_bundled_paint_and_a_model_of_ones_own(run, tmp_path, monkeypatch):
    from pbrdf.models import MODELS

    monkeypatch.setattr(MODELS, "_classes", dict(MODELS._classes))
    shutil.copy(Path(own_model.__file__), tmp_path / "mine.py")
    result = run(
        "compare",
        "matte-white-thick",
        "--models",
        "double-gauss,mine.py:LambertGGX",
        "--hold-out",
        "group=3",
        *STARTS,
    )
    assert result.stderr == ""
    printed = " ".join(result.stdout.split())
    assert printed.startswith("matte-white-thick, 476 nm: double-gauss predicts best")
    for text in (
        "held-out error",
        "AIC",
        "BIC",
        "lambert-ggx",
        "costs",
        "Written to matte-white-thick-compare/",
    ):
        assert text in printed, text
    folder = tmp_path / "matte-white-thick-compare"
    assert {
        "index.html", "summary.txt", "comparison.csv", "comparison.json", "best-model.json",
        "curves.png", "ranking.png",
    } <= {p.name for p in folder.iterdir()}  # fmt: skip
    record = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    assert {entry["model"] for entry in record["ranking"]} == {
        "double-gauss",
        "double-gauss, visible",
        "double-gauss, unpolarised body",
        "lambert-ggx",
    }
    assert record["settings"]["hold_out"] == "group=3"


@pytest.mark.slow
def test_options_reach_the_comparison(run, tmp_path):
    run("simulate", "cd-back", "--plane", "--theta-i", "20,40,60", "--theta-r=-70:70:14", "-o", "data.csv")
    result = run(
        "compare", "data.csv", "--models", "double-gauss", "--by", "angle", "--folds", 3, "--noise", "3%,1%",
        "--select", "theta_i=20:40", "--quiet", "--no-figures", "-o", "out", *STARTS,
    )  # fmt: skip
    assert result.output == "out\n"
    assert not list((tmp_path / "out").glob("*.png"))
    record = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))
    assert record["held_out"]["by"] == "3 folds by angle, each predicted from the others"
    assert record["held_out"]["geometries"] == 22
    assert record["settings"]["noise"] == "3%,1%"
    assert record["settings"]["reading"] == {"select": ["theta_i=20:40"]}


def test_what_is_refused(refused):
    assert "give one of the two" in refused("compare", "white", "--hold-out", "group=3", "--by", "group")
    assert "name at least one" in refused("compare", "white", "--models", " , ")
    assert "unknown model 'phong'" in refused("compare", "white", "--models", "phong")
    assert "no such file" in refused("compare", "absent.csv")
    assert "choose one of png, pdf, svg" in refused("compare", "white", "--figure-format", "gif")
    assert "no such data" in refused("compare", "white", "--hold-out", "group=9")
