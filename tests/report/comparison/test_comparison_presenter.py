"""A comparison of models as it shows itself in Python."""

from __future__ import annotations

import re

import pytest

from pbrdf.errors import PbrdfError
from pbrdf.report.comparison.subject import Compared, table
from pbrdf.report.comparison.summary import summary_text

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def comparison(compared):
    return compared.comparison


def test_print_shows_the_summary_of_the_command(comparison):
    expected = summary_text(Compared(comparison, comparison.dataset.attrs["title"]))
    assert comparison.summary() == expected
    assert str(comparison) == expected.rstrip()
    assert comparison.sentences()[0] in " ".join(str(comparison).split())
    assert (
        "\n" not in repr(comparison)
        and comparison.best.name in repr(comparison)
        and len(repr(comparison)) < 200
    )


def test_a_notebook_shows_the_ranking_and_what_failed(comparison):
    html = comparison._repr_html_()
    _, rows = table(comparison)
    assert html.count("<tr>") == 1 + len(rows)
    places = [html.index(f"<td>{row[0]}</td>") for row in rows]
    assert places == sorted(places)
    assert "Not compared: silent: " in html
    assert not re.search(r"<(?!/?(div|table|thead|tbody|tr|th|td|p)>)", html)


def test_a_comparison_draws_and_saves_itself(comparison, tmp_path):
    figure = comparison.plot()
    labels = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    assert sorted(labels) == sorted(f"{c.name} ({c.free})" for c in comparison.ranking)
    written = comparison.save(tmp_path / "saved", figure_format="svg")
    assert {path.name for path in written} == {path.name for path in (tmp_path / "saved").iterdir()}
    assert "ranking.svg" in {path.name for path in written}
    with pytest.raises(PbrdfError, match="figure_format 'jpg': choose one of"):
        comparison.save(tmp_path / "other", figure_format="jpg")
    assert not (tmp_path / "other").exists()
