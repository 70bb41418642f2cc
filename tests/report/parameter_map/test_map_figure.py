"""Pictures of maps: what is drawn with which colour and scale, and what is said."""

import numpy as np
import pytest
from example_maps import example_map
from figure_helpers import legend

from pbrdf.report.parameter_map.figure import (
    drawn_parameters,
    overview_figure,
    parameter_figure,
    quality_figure,
)
from pbrdf.report.parameter_map.shown_map import ShownMap


def panels(figure):
    return [ax for ax in figure.axes if ax.get_visible() and ax.get_title()]


@pytest.mark.parametrize("count", [1, 4, 6, 12])
def test_every_parameter_has_a_panel_with_its_name(count):
    shown = ShownMap(example_map((12, 16), parameters=count))
    figure = overview_figure(shown, "paint")
    assert [ax.get_title() for ax in panels(figure)] == [label.text for label in shown.labels]
    assert "scales hold the middle 98 %" in figure.get_suptitle()


def test_what_is_the_same_everywhere_is_not_drawn():
    found = example_map((12, 16), parameters=3)
    found["estimate"][1] = 1.5
    shown = ShownMap(found)
    assert drawn_parameters(shown) == [0, 2]
    assert len(panels(overview_figure(shown, "paint"))) == 2
    found["estimate"][:] = 1.5
    assert drawn_parameters(ShownMap(found)) == [0, 1, 2]


def test_a_stray_fit_does_not_set_the_scale():
    found = example_map((40, 40), parameters=1, cause=False)
    low, high = np.percentile(found["estimate"], (1, 99))
    found["estimate"][0, 3, 3] = 1e6
    image = panels(overview_figure(ShownMap(found), "paint"))[0].images[0]
    assert image.norm.vmin == pytest.approx(low, rel=0.05)
    assert image.norm.vmax == pytest.approx(high, rel=0.05)
    assert image.get_array()[3, 3] == 1e6


def test_pixels_without_a_result_have_colours_of_their_own():
    found = example_map((20, 20), parameters=1)
    found["status"][0, 0] = -1
    shown = ShownMap(found)
    figure = overview_figure(shown, "paint")
    image, *others = panels(figure)[0].images
    np.testing.assert_array_equal(~np.ma.getmaskarray(image.get_array()), shown.determined(0))
    drawn = [~np.ma.getmaskarray(other.get_array()) for other in others]
    np.testing.assert_array_equal(drawn.pop(0), shown.good & ~shown.determined(0))
    np.testing.assert_array_equal(drawn[0], ~(shown.good | shown.masked | shown.pending))
    np.testing.assert_array_equal(drawn[1], shown.pending)
    assert legend(figure) == ["not measured or left out", "no result", "not yet fitted", "undetermined"]


def test_what_the_data_do_not_determine_has_no_colour_of_the_scale():
    """Its values mean nothing, however large: such pixels stand apart, and outside of the scale."""
    found = example_map((40, 40), parameters=1, cause=False)
    undetermined = np.zeros((40, 40), dtype=bool)
    undetermined[:10] = True
    found["flags"][0] = np.where(undetermined, 4, 0)
    found["estimate"][0] = np.where(undetermined, 1e3, found["estimate"][0])
    found["standard_error"][0] = np.where(undetermined, np.nan, found["standard_error"][0])
    found["standard_error"][0, 20] = np.nan
    figure = parameter_figure(ShownMap(found), 0, "paint")
    value, error, histogram = panels(figure)
    assert value.images[0].norm.vmax < 1.0
    assert histogram.get_xlim()[1] < 1.0
    for ax, others in (
        (value, [undetermined]),
        (error, [undetermined, np.arange(40)[:, None] * np.ones(40) == 20]),
    ):
        drawn = [~np.ma.getmaskarray(image.get_array()) for image in ax.images[1:]]
        np.testing.assert_array_equal(drawn, others)
    assert legend(figure) == ["undetermined", "on a bound: no standard error"]


def test_the_error_stands_beside_the_value_and_goes_to_a_logarithm_where_it_is_wide():
    shown = ShownMap(example_map((40, 20)))
    even, wide = parameter_figure(shown, 0, "paint"), parameter_figure(shown, 1, "paint")
    assert [ax.get_title() for ax in panels(even)[:2]] == ["value", "standard error"]
    assert panels(even)[1].images[0].norm.vmin == 0.0
    assert type(panels(wide)[1].images[0].norm).__name__ == "LogNorm"


def test_the_histogram_says_median_spread_and_error():
    found = example_map((100, 100), parameters=1, cause=False)
    found["estimate"][0] = np.random.default_rng(1).normal(3.0, 0.2, (100, 100))
    found["standard_error"][0] = 0.2
    figure = parameter_figure(ShownMap(found), 0, "paint")
    title = panels(figure)[2].get_title()
    assert title == "median 3, middle 68 % ± 0.2,\nstandard error 0.2"


@pytest.mark.slow
def test_of_good_fits_the_histogram_of_chi2_follows_the_expected_curve():
    shown = ShownMap(example_map((120, 120), parameters=1, freedom=50))
    ax = next(ax for ax in quality_figure(shown, "paint").axes if ax.get_xlabel().startswith("χ² per"))
    heights = np.array([patch.get_height() for patch in ax.patches])
    middles = np.array([patch.get_x() + 0.5 * patch.get_width() for patch in ax.patches])
    line = ax.get_lines()[0]
    expected = np.interp(middles, *line.get_data())
    assert np.abs(heights - expected).max() < 5.0 * np.sqrt(expected.max())


def test_counts_have_whole_steps_and_the_last_one_says_if_there_are_more():
    found = example_map((20, 20), parameters=1, cause=False)
    found["optima"][:] = 1
    found["optima"][0, 0] = 9
    figure = quality_figure(ShownMap(found), "paint")
    image = next(ax for ax in figure.axes if ax.get_title() == "distinct optima seen").images[0]
    labels = [text.get_text() for text in image.colorbar.ax.get_yticklabels()]
    assert labels == ["1", "2", "3", "4", "≥ 5"]
    assert image.get_array().max() == 5


def test_states_are_named_with_their_shares():
    figure = quality_figure(ShownMap(example_map((40, 40))), "paint")
    ax = next(ax for ax in figure.axes if ax.get_title() == "state of the fit")
    names = [text.get_text().partition("\n")[0] for text in ax.get_legend().get_texts()]
    assert names == ["converged", "not converged", "failed", "not measured", "masked"]


def test_a_map_with_one_dimension_is_a_line_with_a_band():
    found = example_map((50,), parameters=2, dims=("sample",))
    shown = ShownMap(found)
    value, error, _ = panels(parameter_figure(shown, 0, "paint"))
    line = value.get_lines()[0]
    assert np.isnan(line.get_ydata()[~shown.good]).all()
    np.testing.assert_array_equal(line.get_ydata()[shown.good], shown.estimate[0][shown.good])
    assert len(value.collections) == 1
    assert error.get_xlabel() == "sample, pixels"
    assert len(panels(quality_figure(shown, "paint"))) == 6


@pytest.mark.parametrize("shape", [(4, 900), (900, 4)])
def test_extreme_proportions_are_stretched_and_said(shape):
    figure = overview_figure(ShownMap(example_map(shape, parameters=2)), "paint")
    assert "not to scale" in figure.get_suptitle()
    width, height = figure.get_size_inches()
    assert 0.1 < height / width < 3.0


@pytest.mark.slow
def test_a_map_without_any_result_is_drawn_all_the_same():
    found = example_map((6, 6), parameters=2)
    found["status"][:] = 3
    for name in ("estimate", "standard_error", "chi2"):
        found[name][:] = np.nan
    shown = ShownMap(found)
    assert drawn_parameters(shown) == [0, 1]
    for figure in (overview_figure(shown, "p"), parameter_figure(shown, 0, "p"), quality_figure(shown, "p")):
        figure.canvas.draw()
