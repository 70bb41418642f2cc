import pytest

from pbrdf.errors import DataError
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.style import DISTINCT_COLOURS, looks_of, save_figure


@pytest.mark.slow
def test_figures_are_saved_alike_and_by_extension(report, tmp_path):
    figure = fit_figure(report)
    for kind in ("png", "svg"):
        save_figure(figure, tmp_path / f"a.{kind}")
        save_figure(figure, tmp_path / f"b.{kind}")
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    with pytest.raises(DataError, match=r"figures are written as \.png, \.pdf, \.svg"):
        save_figure(figure, tmp_path / "a.jpeg")
    assert len(list(tmp_path.iterdir())) == 4


def test_looks_are_distinct():
    for count in (1, DISTINCT_COLOURS, DISTINCT_COLOURS + 1, 10):
        assert len({look.colour for look in looks_of(count)}) == count
