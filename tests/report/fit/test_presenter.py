"""A fit as it shows itself in Python."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pbrdf.report.fit.checks import run_checks
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import summary_text, verdict_in_words


@pytest.fixture(scope="module")
def result(report):
    return report.result


@pytest.mark.slow
def test_print_shows_the_summary_of_the_command(result):
    checks = run_checks(result, result.dataset)
    name = result.dataset.attrs["title"]
    expected = summary_text(Report(result, result.dataset, name, checks=checks))
    assert result.summary() == expected
    assert str(result) == expected.rstrip()
    assert "Determined" in str(result) and "double-gauss" in str(result)
    assert str(result).count(name) == 1
    assert len(result.summary(verbose=True)) > len(expected)


def test_repr_is_one_short_line(result):
    assert "\n" not in repr(result) and len(repr(result)) < 200
    assert "DoubleGauss(sigma=" in repr(result)


def test_a_notebook_shows_a_table_of_the_parameters(result):
    html = result._repr_html_()
    assert html.count("<tr>") == 1 + len(result.estimates)
    for name, estimate in result.estimates.items():
        assert f"<td>{name}</td>" in html and f"<td>{verdict_in_words(estimate)}</td>" in html
    assert html.index(result.verdict().sentence) < html.index("<table>")
    assert "held out, predicted: median error of the intensity" in html
    assert not re.search(r"<(?!/?(div|table|thead|tbody|tr|th|td|p)>)", html)


def test_the_figure_is_that_of_the_report(result):
    figure = result.plot()
    assert result.model.name in figure.get_suptitle() and len(figure.axes) >= 4


def test_the_data_set_holds_comparison_and_estimates(result):
    made = result.to_dataset()
    for name, estimate in result.estimates.items():
        row = made.sel(parameter=name)
        assert float(row["value"]) == estimate.value and str(row["verdict"].values) == estimate.verdict
    free = [n for n, e in result.estimates.items() if e.verdict == "determined"]
    assert np.array_equal(
        made["correlation"].sel(parameter=free, other=free),
        result.correlation.sel(parameter=free, other=free),
    )
    assert np.array_equal(made["I_residual"], result.comparison["I_residual"])
    assert made.attrs["model"] == "double-gauss"
