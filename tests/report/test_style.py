import numpy as np
import pytest
from matplotlib.lines import Line2D
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.style import DISTINCT_COLOURS, FIGURE_FORMATS, looks_of, panels, save_figure, styled


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


def test_png_shows_what_matplotlib_would_write(tmp_path):
    with styled():
        figure, axes = panels(1, 1, (2.0, 1.5), "a title", [Line2D([], [], label="a line")])
        axes[0, 0].plot([0.0, 1.0, 2.0], [1.0, 0.0, 3.0])
    save_figure(figure, tmp_path / "ours.png")
    with styled():
        figure.savefig(tmp_path / "theirs.png", **FIGURE_FORMATS["png"])
    with Image.open(tmp_path / "ours.png") as ours, Image.open(tmp_path / "theirs.png") as theirs:
        assert ours.mode == "RGB" and ours.info["dpi"] == theirs.info["dpi"]
        assert np.array_equal(np.asarray(ours), np.asarray(theirs.convert("RGB")))
