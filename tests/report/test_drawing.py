"""A figure drawn as pixels and as SVG at once, against matplotlib's own of each kind."""

import io
import re

import numpy as np
import pytest
from matplotlib.lines import Line2D

from pbrdf.report.drawing import drawn
from pbrdf.report.style import panels, styled

DOTS = 140


@pytest.fixture
def figure():
    rng = np.random.default_rng(1)
    with styled():
        figure, axes = panels(1, 2, (2.0, 1.5), "a title", [Line2D([], [], label="a line")])
        axes[0, 0].errorbar([0.0, 1.0, 2.0], [1.0, 0.0, 3.0], yerr=0.3, fmt="o--", linewidth=2.0)
        axes[0, 0].fill_between([0.0, 2.0], [0.0, 1.0], [1.0, 2.0])
        axes[0, 0].text(1.0, 1.0, "$x^2$ and\nmore")
        axes[0, 1].pcolormesh(rng.random((3, 4)), shading="flat")
        axes[0, 1].scatter(rng.random(9), rng.random(9), c=rng.random(9))
    return figure


def test_pixels_are_those_of_matplotlib(figure):
    with styled():
        pixels, _ = drawn(figure, DOTS)
        expected = io.BytesIO()
        figure.savefig(expected, format="rgba", dpi=DOTS)
    assert pixels.tobytes() == expected.getvalue()


def test_svg_is_that_of_matplotlib_in_pixels(figure):
    """Places, widths and letters are larger by dots per point; the axes are laid out in whole pixels or none."""
    with styled():
        import matplotlib

        matplotlib.rcParams["svg.fonttype"] = "none"
        _, ours = drawn(figure, DOTS)
        theirs = io.StringIO()
        figure.savefig(theirs, format="svg", metadata={"Date": None}, transparent=True)
    scale = DOTS / 72.0
    for what in (
        r"stroke-width: ([\d.]+)",
        r"font(?:-size)?: ([\d.]+)px",
        r'<text[^>]* x="([\d.]+)"',
    ):
        found, expected = (
            np.array(re.findall(what, text), dtype=float) for text in (ours, theirs.getvalue())
        )
        found = found[~np.isclose(found, scale)]  # a width of one point is not written in points
        assert len(found) == len(expected) > 0, what
        np.testing.assert_allclose(found, scale * expected, atol=1.5, rtol=1e-3, err_msg=what)
    grounds = 3
    assert ours.count("<path") == theirs.getvalue().count("<path") - grounds, (
        "matplotlib draws them transparent"
    )


def test_what_is_rasterized_is_a_picture_and_the_figure_is_as_before(figure):
    before = figure.dpi, [ax.patch.get_gid() for ax in figure.axes]
    figure.axes[0].lines[0].set_rasterized(True)
    with styled():
        _, svg = drawn(figure, DOTS)
    assert len(re.findall("<image", svg)) == 1
    assert (figure.dpi, [ax.patch.get_gid() for ax in figure.axes]) == before
