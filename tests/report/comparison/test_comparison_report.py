"""Tables, sentences, files and figures of a comparison of models."""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.ladder import Rung
from pbrdf.inversion.model_comparison import compare_models
from pbrdf.models import DoubleGauss
from pbrdf.report.comparison.figure import curves_figure, ranking_figure
from pbrdf.report.comparison.folder import comparison_record, write_comparison
from pbrdf.report.comparison.subject import Compared, share, table
from pbrdf.report.comparison.summary import print_summary, summary_text


@pytest.fixture(scope="module")
def folder(compared, tmp_path_factory):
    target = tmp_path_factory.mktemp("comparison") / "out"
    written = write_comparison(compared, target)
    assert {path.name for path in written} == {path.name for path in target.iterdir()}
    return target


@pytest.mark.slow
def test_the_table_has_every_rung_once_in_the_order_of_the_ranking(compared):
    headings, rows = table(compared.comparison)
    assert headings[:5] == ["model", "free", "held-out error", "of I", "of pol."]
    assert [row[0] for row in rows] == [c.name for c in compared.comparison.ranking]
    assert {len(row) for row in rows} == {len(headings)}
    assert rows[0][headings.index("behind the best")] == "–"
    scores = [c.score for c in compared.comparison.ranking]
    assert scores == sorted(scores)


def test_shares_as_text():
    assert share(0.0321, 0.0012) == "3.21 ± 0.12 %"
    assert share(0.5, 0.03) == "50.0 ± 3.0 %"
    assert share(0.0, 0.0) == "0 %"
    assert share(0.041) == "4.1 %"
    assert share(math.inf) == "∞"


def test_the_summary_begins_with_the_verdict_and_ends_with_what_failed(compared):
    text = summary_text(compared)
    first, last = text.splitlines()[0], text.strip().splitlines()[-1]
    assert first.startswith(f"matte-white-thick, 476 nm: {compared.comparison.best.name} predicts best")
    assert last == "Not compared: silent: ValueError: no formula [yet]"
    assert "no facets [0]" in text  # brackets are no markup
    joined = " ".join(text.split())
    for sentence in compared.comparison.sentences():
        assert " ".join(sentence.split()) in joined


def test_names_of_models_are_whole_in_a_narrow_table(compared):
    from rich.console import Console

    file = io.StringIO()
    print_summary(compared, Console(file=file, width=90, color_system=None))
    ranking = file.getvalue().split("\n\n")[1]
    for contender in compared.comparison.ranking:
        assert all(word in ranking for word in contender.name.split())


@pytest.mark.slow
def test_the_files_hold_the_same_numbers(compared, folder):
    record = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    with (folder / "comparison.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    ranking = compared.comparison.ranking
    assert len(rows) == len(ranking) + 1
    for row, entry, contender in zip(rows, record["ranking"], ranking, strict=False):
        assert row["model"] == entry["model"] == contender.name
        assert float(row["score"]) == entry["score"] == contender.score
        assert float(row["behind_best_std"]) == pytest.approx(contender.behind.uncertainty)
        assert int(row["free"]) == len([e for e in entry["estimates"].values() if e["verdict"] != "fixed"])
    assert rows[-1]["model"] == "silent" and rows[-1]["rank"] == "" and "no formula" in rows[-1]["remarks"]
    assert record["failures"] == [{"model": "silent", "reason": "ValueError: no formula [yet]"}]
    assert record["settings"] == {"starts": 2}
    assert record["held_out"]["geometries"] == 21
    (first, *_) = record["steps"]
    assert first["difference"] == pytest.approx(
        compared.comparison[first["simple"]].score - compared.comparison[first["rich"]].score
    )
    assert pbrdf.load_model(folder / "best-model.json") == compared.comparison.best.result.model


def test_the_record_is_json(compared):
    json.dumps(comparison_record(compared), allow_nan=False)


def test_every_models_curve_is_drawn_over_the_measurements(compared):
    figure = curves_figure(compared)
    axes = np.array(figure.axes).reshape(2, 3)  # intensity and DoLP of three positions of the camera
    models = len(compared.comparison.ranking)
    held = [ax.get_title().endswith("(held out)") for ax in axes[0]]
    assert held == [False, False, True]
    for ax in axes.ravel():
        curves = [line for line in ax.get_lines() if len(line.get_xdata()) > 100]
        assert len(curves) == models
        (points,) = [c.lines[0] for c in ax.containers]
        assert np.isfinite(points.get_ydata()).sum() == 21
    names = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {c.name for c in compared.comparison.ranking} <= names


def test_a_curve_passes_where_the_fit_predicts(compared):
    best = compared.comparison.best
    ax = curves_figure(compared).axes[2]
    rows = np.flatnonzero(compared.comparison.held_out)
    x = np.rad2deg(compared.comparison.dataset["theta_r"].values[rows])
    curves = [line for line in ax.get_lines() if len(line.get_xdata()) > 100]
    curve = max(curves, key=lambda line: line.get_zorder())
    drawn = np.interp(x, curve.get_xdata(), curve.get_ydata())
    np.testing.assert_allclose(drawn, best.comparison["I_modelled"].values[rows], rtol=1e-6)


def test_the_ranking_has_a_mark_for_each(compared):
    (ax,) = ranking_figure(compared).axes
    assert [t.get_text() for t in ax.get_yticklabels()] == [
        f"{c.name} ({c.free})" for c in compared.comparison.ranking
    ]
    marks = [c.lines[0] for c in ax.containers]
    assert [float(m.get_xdata()[0]) for m in marks] == pytest.approx(
        [
            100.0 * c.score
            for c in compared.comparison.ranking
            if c.score <= 12.0 * compared.comparison.best.score
        ]
    )


def test_data_on_no_cuts_are_drawn_against_what_was_measured():
    rng = np.random.default_rng(3)
    angles = np.deg2rad([rng.uniform(5, 70, 60), rng.uniform(5, 70, 60), rng.uniform(20, 160, 60)])
    truth = DoubleGauss(sigma=0.2, n=1.5, a=0.5, k=1.1, b=0.2, t=0.0)
    data = pbrdf.make_dataset(*angles, quantity="brdf", I=truth.stokes(*angles)[:, 0])
    rung = Rung("t = 0", DoubleGauss, fix={"t": 0.0})
    found = compare_models(data, [rung], hold_out="fraction=0.5", vary=0, starts=2)
    (ax,) = curves_figure(Compared(found, "scattered")).axes
    assert ax.get_ylabel().startswith("predicted")
    assert sum(len(line.get_xdata()) for line in ax.get_lines() if line.get_marker() == ".") == 30


def test_without_figures_no_plotting_library_is_needed(compared, tmp_path, monkeypatch):
    import builtins

    real = builtins.__import__

    def guarded(name, *rest, **more):
        assert not name.startswith("matplotlib"), name
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", guarded)
    written = write_comparison(compared, tmp_path / "plain", figure_format=None)
    assert [p.suffix for p in written] == [".html", ".txt", ".csv", ".json", ".json"]
    assert "No figures were drawn" in written[0].read_text(encoding="utf-8")


def test_the_page_needs_nothing_but_itself_and_says_what_the_summary_says(compared, folder):
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "<script" not in page and not re.search(r'(src|href)="(https?:)?//', page)
    text = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())
    for contender in compared.comparison.ranking:
        assert contender.name in text
    assert " ".join(compared.comparison.sentences()[0].split()) in text
    assert "silent: ValueError: no formula [yet]" in text
    assert len(re.findall(r'<svg role="img" aria-label="[^"]+', page)) == 2
    links = re.findall(r'<a href="([^"#]+)"', page)
    assert {"comparison.csv", "curves.png"} <= set(links)
    assert all((folder / link).is_file() for link in links)
