"""The folder that a reproduction leaves behind."""

from __future__ import annotations

import csv
import json
import re

import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.reproduction import run
from pbrdf.reproduction.page.page import verdicts_in_words
from pbrdf.reproduction.paper import SAMPLES, SIMULATED
from pbrdf.reproduction.run import write_reproduction

pytestmark = pytest.mark.slow

TABLES = {
    "errors.csv",
    "errors-at-strongest-points.csv",
    "expected-numbers.csv",
    "points.csv",
    "starts.csv",
    "statements.csv",
    "table1.csv",
}


@pytest.fixture(scope="module")
def folder(reproduction, tmp_path_factory):
    """The report written once."""
    target = tmp_path_factory.mktemp("reproduction") / "report"
    stages = []
    written = write_reproduction(reproduction, target, lambda *stage: stages.append(stage))
    assert stages == [("Figures", number, 5) for number in range(6)]
    assert written[0] == target / "index.html"
    assert set(written) == {path for path in target.rglob("*") if path.is_file()}
    return target


def rows(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def test_the_folder_holds_everything_and_nothing_else(folder):
    assert {path.name for path in folder.iterdir()} == {"index.html", "figures", "tables", "data", "models"}
    names = {f"figure-{n}.{kind}" for n in (3, 5, 6, 7, 8) for kind in ("png", "svg")}
    assert {path.name for path in (folder / "figures").iterdir()} == names
    assert {path.name for path in (folder / "tables").iterdir()} == TABLES
    assert {path.stem for path in (folder / "data").iterdir()} == set(SAMPLES)
    assert {path.stem for path in (folder / "models").iterdir()} == set(SAMPLES)
    assert [path.name for path in folder.parent.iterdir()] == ["report"]


def test_every_file_says_that_it_is_simulated(folder):
    for path in folder.rglob("*"):
        if path.suffix in (".html", ".csv", ".json"):
            assert SIMULATED in path.read_text(encoding="utf-8"), path


def test_data_sets_and_models_read_back(folder, samples):
    for sample in samples:
        dataset = pbrdf.read(folder / "data" / f"{sample.name}.csv")
        assert dataset.attrs["simulated"] == 1
        assert dataset.attrs["quantity"] == "dn"
        assert (dataset["I"].values == sample.dataset["I"].values).all()
        assert pbrdf.load_model(folder / "models" / f"{sample.name}.json") == sample.result.model


def test_a_fit_to_the_written_data_finds_the_same(folder, samples):
    """The whole chain again from the file: the parameters of the page come out of the data beside it."""
    sample = samples[4]
    result = pbrdf.fit(
        pbrdf.read(folder / "data" / "cd-back.csv"), strategy="stepwise", starts=8, hold_out="group=3"
    )
    for name, estimate in sample.result.estimates.items():
        assert result.estimates[name].value == pytest.approx(estimate.value, rel=1e-6)


def test_the_tables_have_the_numbers_of_the_run(folder, reproduction):
    table = rows(folder / "tables" / "table1.csv")
    assert len(table) == 30
    first = next(r for r in table if r["sample"] == "3" and r["parameter"] == "n")
    estimate = reproduction.samples[2].result.estimates["n"]
    assert float(first["true"]) == 1.6207
    assert float(first["recovered"]) == pytest.approx(estimate.value, rel=1e-5)
    assert float(first["pull"]) == pytest.approx((estimate.value - 1.6207) / estimate.std, rel=1e-3)
    assert len(rows(folder / "tables" / "points.csv")) == 5 * 63
    statements = rows(folder / "tables" / "statements.csv")
    assert {int(r["number"]) for r in statements} == set(range(1, 29))
    assert [r["result"] for r in statements if r["number"] == "11"] == ["holds", "FAILS", "holds", "FAILS"]
    assert [r["result"] for r in statements if r["number"] == "14"] == ["not tested"]
    expected = rows(folder / "tables" / "expected-numbers.csv")
    assert sum(r["within"] == "0" for r in expected) == 2


def test_the_page_shows_failures_and_needs_nothing_but_itself(folder, reproduction):
    text = (folder / "index.html").read_text(encoding="utf-8")
    # the letters of an encoded picture may spell anything
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)
    assert text.count("data:image/png;base64,") == 5
    failures = sum(not o.passed for e in reproduction.statements for o in e.outcomes.values())
    assert text.count("✗ fails") == failures
    assert text.count("✗ outside") == sum(not n.within for n in reproduction.numbers)
    for entry in reproduction.statements:
        assert f"<td>{entry.statement.number}</td>" in text
    assert "about the paper&#39;s measured data only" in text.lower()
    assert "not comparable" in text


def test_verdicts_are_counted_in_words(reproduction):
    default, literal, parameters = verdicts_in_words(reproduction.statements)
    assert (
        default == "weighted / flux (default reading): 13 of 14 statements about the model hold; #10 fails."
    )
    assert "8 of 14" in literal
    assert literal.endswith("#4, #6, #10, #11, #17, #19 fail.")
    assert parameters.startswith("Parameters: ")


def test_a_model_file_keeps_its_note(folder):
    content = json.loads((folder / "models" / "white.json").read_text(encoding="utf-8"))
    assert SIMULATED in content["note"]
    assert "12 bits" in content["note"]


def test_a_failure_leaves_nothing_behind(reproduction, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run, "write", fail)
    monkeypatch.setattr("pbrdf.reproduction.figures.all.pictures", lambda *_: {})
    with pytest.raises(DataError, match="report: cannot be written: No space left"):
        write_reproduction(reproduction, tmp_path / "report")
    assert list(tmp_path.iterdir()) == []


def test_files_of_the_same_name_are_replaced_and_others_stay(reproduction, tmp_path, monkeypatch):
    monkeypatch.setattr("pbrdf.reproduction.figures.all.pictures", lambda *_: {})
    monkeypatch.setattr("pbrdf.reproduction.page.page.page_text", lambda *_: "new")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "mine.txt").write_text("mine")
    (tmp_path / "index.html").write_text("old")
    write_reproduction(reproduction, tmp_path)
    assert (tmp_path / "data" / "mine.txt").read_text() == "mine"
    assert (tmp_path / "index.html").read_text() == "new"
    assert (tmp_path / "data" / "white.csv").exists()
