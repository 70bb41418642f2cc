import numpy as np
from figure_helpers import legend

from pbrdf.report.fit.starts_figure import starts_figure


def test_every_start_is_drawn_from_begin_to_end(report):
    figure = starts_figure(report)
    free = [e.parameter.symbol for e in report.result.estimates.values() if e.verdict != "fixed"]
    assert [ax.get_title().split(":")[0] for ax in figure.axes] == free
    drawn = np.concatenate([line.get_ydata().reshape(-1, 3) for line in figure.axes[1].get_lines()])
    found = drawn[np.argsort(drawn[:, 0]), :2]
    expected = np.stack([report.result.start_values[:, 1], report.result.end_values[:, 1]], axis=1)
    np.testing.assert_allclose(found, expected[np.argsort(expected[:, 0])])
    assert figure.axes[0].get_yscale() == "log"
    assert "reached the best optimum" in legend(figure)[0]
