import numpy as np
import pytest
from figure_helpers import legend, lines, numbers_drawn

import pbrdf
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.fit.subject import Report


@pytest.fixture(scope="module")
def figure(report):
    return fit_figure(report)


def test_every_point_and_one_curve_per_group_are_drawn(figure):
    for ax in figure.axes[0], figure.axes[2]:
        assert numbers_drawn(lines(ax, "measured")) == 42
        assert numbers_drawn(lines(ax, "held out")) == 21
        curves = lines(ax, "model")
        assert len(curves) == 3
        assert [curve.get_linestyle() for curve in curves] == ["-", "-", "--"]
        assert min(len(curve.get_xdata()) for curve in curves) > 500


def test_curves_are_the_model(figure, report):
    curve = lines(figure.axes[0], "model")[0]
    x, y = curve.get_xdata(), curve.get_ydata()
    stokes = report.result.model.stokes(
        np.deg2rad(60.0 - x), np.deg2rad(np.abs(x)), np.where(x < 0.0, np.pi, 0.0)
    )
    np.testing.assert_allclose(y, stokes[:, 0], rtol=1e-9)
    dolp = lines(figure.axes[2], "model")[0].get_ydata()
    np.testing.assert_allclose(dolp, pbrdf.dolp(stokes), atol=1e-9)


def test_held_out_points_have_open_markers(figure):
    for line in lines(figure.axes[0], "held out"):
        assert line.get_markerfacecolor() == "white"
    for line in lines(figure.axes[0], "measured"):
        assert line.get_markerfacecolor() == line.get_color()
    assert legend(figure)[:3] == [
        "group 1: θi + θr = 60°",
        "group 2: θi + θr = 80°",
        "group 3: θi + θr = 100° (held out)",
    ]
    assert "measured ± standard uncertainty" in legend(figure)


def test_axes_have_names_and_units(figure):
    intensity, difference, dolp, _ = figure.axes
    assert intensity.get_ylabel() == "intensity (arbitrary scale)"
    assert "(°)" in intensity.get_xlabel()
    assert dolp.get_ylabel() == "degree of linear polarisation"
    assert "%" in difference.get_ylabel()
    assert "group=3 held out" in figure.get_suptitle()
    assert "476 nm" in figure.get_suptitle()


def test_differences_are_those_of_the_comparison(figure, report):
    drawn = np.concatenate([line.get_ydata() for line in lines(figure.axes[1], "held out")])
    comparison = report.result.comparison.isel(geometry=report.result.comparison["held_out"].values)
    expected = 100.0 * comparison["I_residual"] / comparison["I_measured"]
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected.values))


@pytest.mark.slow
def test_points_out_of_plane_are_compared_with_the_model(hemisphere_report):
    figure = fit_figure(hemisphere_report)
    cut, agreement = figure.axes
    assert legend(figure)[:3] == ["θi = 20°", "θi = 40°", "θi = 60° (held out)"]
    assert "measured" in legend(figure)  # the noise was assumed: no error bars
    total = hemisphere_report.dataset.sizes["geometry"]
    assert numbers_drawn(lines(agreement, "measured") + lines(agreement, "held out")) == total
    assert numbers_drawn(lines(agreement, "held out")) == total / 3
    assert len(lines(agreement, "equal")) == 1
    assert agreement.get_title() == f"All {total} geometries"
    assert "hemisphere.csv, 550 nm" in figure.get_suptitle()
    assert "/" not in figure.get_suptitle()
    assert len(lines(cut, "model")) == 3


@pytest.mark.slow
def test_a_partly_held_out_cut_says_so(report):
    result = pbrdf.fit(report.dataset, hold_out="fraction=0.3", starts=2)
    figure = fit_figure(Report(result, report.dataset, "x"))
    assert "held out" in legend(figure)
    assert numbers_drawn(lines(figure.axes[0], "held out")) == 19


def test_no_figure_opens_a_window(figure):
    import sys

    assert "matplotlib.pyplot" not in sys.modules


def test_curves_include_what_the_instrument_adds(report):
    dataset = report.dataset.copy(deep=True)
    first = dataset["group"].values == 1
    for name in "IQUV":
        dataset[name] = dataset[name] * np.where(first, 2.0, 1.0)
    result = pbrdf.fit(dataset, nuisances=["gain:group"], starts=2, fix={"a": 1.5174})
    figure = fit_figure(Report(result, dataset, "x"))
    curve = lines(figure.axes[0], "model")[0]
    points = lines(figure.axes[0], "measured")[0]
    at = np.interp(points.get_xdata(), curve.get_xdata(), curve.get_ydata())
    np.testing.assert_allclose(at, points.get_ydata(), rtol=0.05)


@pytest.mark.slow
def test_the_points_of_the_diffuse_step_are_marked():
    """Stepwise: a white dot on every point outside the lobe, and none without the strategy."""
    dataset = pbrdf.open_experiment("cd-back")
    result = pbrdf.fit(dataset, starts=4, strategy="stepwise")
    stepwise = fit_figure(Report(result, dataset, "cd-back"))
    dots = [line for line in stepwise.axes[0].lines if line.get_label() == "diffuse step"]
    assert sum(len(line.get_xdata()) for line in dots) == int(result.comparison["used_for_diffuse"].sum())
    assert any("diffuse step" in label for label in legend(stepwise))
