"""The page of a fit: what it says, and that it says what the numbers are."""

from __future__ import annotations

import html
import re
from dataclasses import replace

import drjit
import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.verdict import Level
from pbrdf.report.fit.checks import run_checks
from pbrdf.report.fit.page import page_text
from pbrdf.report.page import paragraph

SECTIONS = [
    "What was measured",
    "What was fitted",
    "How sure it is",
    "How it predicts what it has not seen",
    "Where it fails",
    "How to repeat it",
]


@pytest.fixture(scope="module")
def whole(report):
    """The report with everything that a command adds."""
    return replace(
        report,
        checks=run_checks(report.result, report.dataset, profile=True),
        command="pbrdf fit matte-white-thick --hold-out group=3",
        sha256="ab" * 32,
    )


def words(text):
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text)))


def section(text, title):
    """The words of one section."""
    return words(text.split(f"<h2>{title}</h2>")[1].split("</section>")[0])


@pytest.mark.slow
def test_the_questions_are_answered_in_order(whole):
    text = page_text(whole, {}, ["fit.json"])
    assert re.findall("<h2>(.*?)</h2>", text) == SECTIONS
    assert "http" not in text and "<script" not in text


def test_every_parameter_stands_there_with_its_error(whole):
    fitted = section(page_text(whole, {}, []), "What was fitted")
    for name, estimate in whole.result.estimates.items():
        assert f"{name}" in fitted and estimate.parameter.description in fitted
    sigma = whole.result.estimates["sigma"]
    assert f"{sigma.value:.5f} ± {sigma.std:.5f}" in fitted


def test_the_prediction_is_that_of_the_result(whole):
    said = section(page_text(whole, {}, []), "How it predicts what it has not seen")
    assert "group=3, 21 geometries" in said
    assert f"all 21 {100.0 * whole.result.predicted['all'].intensity_median:.2f} %" in said


@pytest.mark.slow
def test_without_anything_held_out_it_says_what_that_means(hemisphere_report):
    result = pbrdf.fit(hemisphere_report.dataset, starts=2, fix={"t": 0.5})
    said = section(
        page_text(replace(hemisphere_report, result=result), {}, []), "How it predicts what it has not seen"
    )
    assert "Nothing was held out" in said and "--hold-out" in said


def test_the_worst_geometry_is_the_one_with_the_largest_residual(whole):
    said = section(page_text(whole, {}, []), "Where it fails")
    table = whole.result.comparison
    channels = whole.result.data.channels
    pulls = {c: np.abs(table[f"{c}_residual"].values / table[f"{c}_std"].values) for c in channels}
    worst = max(channels, key=lambda c: pulls[c].max())
    at = int(pulls[worst].argmax())
    first = said.split("uncertainties apart")[1].split()
    assert first[0] == str(table["group"].values[at])
    assert first[1] == f"{np.rad2deg(table['theta_i'].values[at]):g}°"
    assert worst in first[:7]


def test_signs_of_the_residuals_are_part_of_where_it_fails(whole):
    said = section(page_text(whole, {}, []), "Where it fails")
    analysis = whole.result.error_analysis().sentences()
    assert analysis[0] in said and analysis[-1] in said


def test_it_can_be_repeated(whole):
    said = section(page_text(whole, {}, ["fit.json"]), "How to repeat it")
    assert whole.command in said and whole.sha256 in said
    for package, version in (
        ("pbrdf", pbrdf.__version__),
        ("numpy", np.__version__),
        ("drjit", drjit.__version__),
    ):
        assert f"{package} {version}" in said
    assert "starts: 8" in said and "fit.json" in said


def test_figures_stand_where_they_belong(whole):
    figures = {name: paragraph(f"the {name}") for name in ("figure", "starts", "hemisphere")}
    text = page_text(whole, figures, [])
    for name, title in (("figure", SECTIONS[1]), ("starts", SECTIONS[2]), ("hemisphere", SECTIONS[4])):
        assert f"the {name}" in section(text, title)
    assert "No figures" not in text


def test_names_of_files_are_no_markup(whole):
    text = page_text(replace(whole, name="<i>a & b</i>.csv"), {}, [])
    assert "<i>" not in text


def test_the_verdict_stands_first_and_nothing_contradicts_it(whole, monkeypatch):
    good = page_text(whole, {}, [])
    verdict = whole.result.verdict()
    assert 'class="verdict good"' in good and verdict.sentence in html.unescape(good)
    assert good.index("verdict good") < good.index("What was measured</h2>")
    assert "determined to" in section(good, "What was fitted")
    bad = replace(verdict, level=Level.DOES_NOT, sentence="Does not describe this sample.")
    monkeypatch.setattr(type(whole.result), "verdict", lambda _: bad)
    text = page_text(whole, {}, [])
    assert 'class="verdict bad"' in text
    said = section(text, "What was fitted")
    assert "determined to" not in said and "do not quote" in said


def test_what_to_try_next_is_told_where_there_is_something(whole, monkeypatch):
    assert "What to try next" not in page_text(whole, {}, [])
    monkeypatch.setattr(type(whole.checks), "advice", lambda _: ["try --loss cauchy"])
    assert "try --loss cauchy" in section(page_text(whole, {}, []), "What to try next")
