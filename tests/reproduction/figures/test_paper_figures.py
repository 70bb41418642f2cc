"""What the figures show, as far as their objects tell."""

from __future__ import annotations

import matplotlib.image
import numpy as np
import pytest

from pbrdf.report.polar_surface import polar_surface
from pbrdf.report.style import save_figure
from pbrdf.reproduction.figures.all import pictures
from pbrdf.reproduction.figures.angles import dop_figure, intensity_figure
from pbrdf.reproduction.figures.errors import dop_error_figure, intensity_error_figure
from pbrdf.reproduction.figures.polar import polar_figure
from pbrdf.reproduction.paper import SIMULATED

pytestmark = pytest.mark.slow


def texts(figure):
    """All text outside the axes, and the titles of these."""
    return " ".join([t.get_text() for t in figure.texts] + [figure.get_suptitle()])


def test_every_figure_says_that_it_is_simulated(samples, positions):
    makers = pictures(samples, positions)
    assert list(makers) == ["figure-3", "figure-5", "figure-6", "figure-7", "figure-8"]
    for make in makers.values():
        assert SIMULATED in texts(make())


def test_figure_3_marks_forward_and_its_numbers(tmp_path):
    figure = polar_figure()
    surfaces = [ax for ax in figure.axes if ax.name == "3d"]
    assert len(surfaces) == 2
    for ax in surfaces:
        labels = [t.get_text() for t in ax.texts]
        assert "forward\nφ = 0°" in labels
        assert {"90°", "−90°", "light", "mirror"} <= set(labels)
    cut = figure.axes[-1]
    notes = " ".join(t.get_text() for t in cut.texts)
    for number in ("0 at −3.8°", "0 at 64.7°", "20.6 %", "46°"):
        assert number in notes
    assert cut.get_xlabel().startswith("viewing angle")
    save_figure(figure, tmp_path / "figure.png")
    assert matplotlib.image.imread(tmp_path / "figure.png").std() > 0.05


def test_figure_3_radius_is_the_value():
    """Each point lies in the direction it stands for, forward along x, at the distance of its value."""
    theta_r, phi = np.deg2rad([0.0, 30.0, 60.0])[:, None], np.deg2rad([0.0, 90.0, 180.0])[None, :]
    values = np.arange(1.0, 10.0).reshape(3, 3)
    x, y, z = polar_surface(theta_r, phi, values)
    np.testing.assert_allclose(np.sqrt(x**2 + y**2 + z**2), values)
    np.testing.assert_allclose([x[1, 0], y[1, 0], z[1, 0]], [4.0 * 0.5, 0.0, 4.0 * np.cos(np.pi / 6)])
    assert y[1, 1] > 0.0 > x[1, 2]


def test_figures_5_and_7_show_all_samples_and_positions(samples, positions):
    for make, label in ((intensity_figure, "intensity (DN)"), (dop_figure, "degree of polarisation")):
        figure = make(samples, positions)
        assert len(figure.axes) == 5
        for ax, sample in zip(figure.axes, samples, strict=True):
            assert sample.label in ax.get_title()
            assert ax.get_ylabel().startswith(label)
            assert "Angle_S_I" in ax.get_xlabel()
            points = [line for line in ax.lines if line.get_linestyle() == "None"]
            assert [len(line.get_xdata()) for line in points] == [21, 21, 21]
            # the predicted position is drawn open and broken
            assert points[2].get_markerfacecolor() == "white" != points[1].get_markerfacecolor()
            assert [line.get_linestyle() for line in ax.lines if line not in points] == ["-", "-", "--"]
        legend = [t.get_text() for t in figure.legends[0].get_texts()]
        assert "position 3: Ψ = 100° (predicted)" in legend
        assert "simulated measurement" in legend


def test_figures_6_and_8_show_the_errors_and_the_papers_numbers(samples, positions):
    sample = samples[2]
    for make, theirs, error in (
        (intensity_error_figure, "4 DN", sample.modelled_intensity - sample.intensity),
        (dop_error_figure, "0.028", sample.modelled_dolp - sample.dolp),
    ):
        figure = make(sample, positions)
        assert "Sample 3" in texts(figure)
        assert f"paper (measured): {'standard deviation ' if 'DN' not in theirs else ''}{theirs}" in texts(
            figure
        )
        against, histogram = figure.axes
        drawn = np.concatenate([line.get_ydata() for line in against.lines if len(line.get_ydata()) == 21])
        np.testing.assert_allclose(np.sort(drawn), np.sort(error))
        assert sum(patch.get_height() for patch in histogram.patches) == 63
