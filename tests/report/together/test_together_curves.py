"""Curves and Mueller elements of several sources: what is drawn is what was measured and what the models are."""

from __future__ import annotations

import numpy as np
import pytest
from figure_helpers import legend, lines

import pbrdf
from pbrdf.errors import DataError, ModelError
from pbrdf.report.together.curves import curves_figure, mueller_figure
from pbrdf.report.together.source import Source

PAINT = pbrdf.load_paint("white")
OTHER = pbrdf.load_paint("cd-back")


@pytest.fixture(scope="module")
def fitted(report):
    return Source("fit", model=report.result.model, dataset=report.dataset)


def test_models_alone_are_drawn_at_35_degrees_or_as_asked():
    for theta_i in (None, 50.0):
        figure = curves_figure([Source("a", PAINT), Source("b", OTHER)], theta_i)
        angle = 35.0 if theta_i is None else theta_i
        assert figure.axes[0].get_title() == f"θi = {angle:g}°"
        assert legend(figure) == ["a (model)", "b (model)"]
        for name, model in (("a", PAINT), ("b", OTHER)):
            (curve,) = lines(figure.axes[0], name)
            x = np.deg2rad(curve.get_xdata())
            expected = model.stokes(np.deg2rad(angle), np.abs(x), np.where(x < 0.0, np.pi, 0.0))
            np.testing.assert_allclose(curve.get_ydata(), expected[:, 0])
            assert np.isclose(curve.get_xdata(), angle).any()  # the top of a narrow peak
            (ratio,) = lines(figure.axes[1], name)
            np.testing.assert_allclose(ratio.get_ydata(), expected[:, 1] / expected[:, 0])


def test_models_are_drawn_in_the_light_that_is_asked_for():
    light = (1.0, 0.0, 0.6, 0.0)
    figure = curves_figure([Source("a", PAINT)], 40.0, light)
    assert figure.get_suptitle() == "a, light 1, 0, 0.6, 0"
    assert [ax.get_ylabel() for ax in figure.axes] == ["intensity (1/sr)", "Q/I", "U/I", "V/I", "DoLP"]
    (curve,) = lines(figure.axes[2], "a")
    x = np.deg2rad(curve.get_xdata())
    S = PAINT.stokes(np.deg2rad(40.0), np.abs(x), np.where(x < 0.0, np.pi, 0.0), incident=light)
    np.testing.assert_allclose(curve.get_ydata(), S[:, 2] / S[:, 0])
    with pytest.raises(ModelError, match="not the Stokes vector"):
        curves_figure([Source("a", PAINT)], 40.0, (1.0, 2.0, 0.0, 0.0))


@pytest.mark.slow
def test_data_have_a_light_of_their_own(fitted):
    with pytest.raises(DataError, match="was measured under light"):
        curves_figure([fitted], None, (1.0, 1.0, 0.0, 0.0))


def test_two_models_differ_in_more_than_colour():
    figure = curves_figure([Source("a", PAINT), Source("b", OTHER)])
    first, second = (lines(figure.axes[0], name)[0] for name in "ab")
    assert first.get_linestyle() != second.get_linestyle()
    assert first.get_color() != second.get_color()


@pytest.mark.slow
def test_a_model_follows_the_cuts_of_the_data(fitted):
    figure = curves_figure([fitted, Source("other", OTHER)])
    titles = [ax.get_title() for ax in figure.axes[:3]]
    assert titles == ["θi + θr = 60°", "θi + θr = 80°", "θi + θr = 100°"]
    points, *_ = (line for line in lines(figure.axes[0], "fit") if line.get_marker() != "None")
    assert len(points.get_xdata()) == 21
    (curve,) = lines(figure.axes[0], "other")
    x = np.deg2rad(curve.get_xdata())
    assert x.min() == pytest.approx(np.deg2rad(points.get_xdata().min()))
    expected = OTHER.stokes(np.deg2rad(60.0) - x, np.abs(x), np.where(x < 0.0, np.pi, 0.0))
    np.testing.assert_allclose(curve.get_ydata(), expected[:, 0])


def test_models_are_drawn_under_the_light_of_the_data():
    theta_r = np.deg2rad(np.arange(5.0, 80.0, 5.0))
    light = (1.0, 1.0, 0.0, 0.0)
    stokes = PAINT.stokes(np.deg2rad(40.0), theta_r, 0.0, incident=light)
    dataset = pbrdf.make_dataset(
        np.full(theta_r.shape, np.deg2rad(40.0)),
        theta_r,
        0.0 * theta_r,
        quantity="brdf",
        I=stokes[:, 0],
        Q=stokes[:, 1],
        illumination=light,
    )
    figure = curves_figure([Source("data", dataset=dataset), Source("paint", PAINT)])
    (curve,) = lines(figure.axes[0], "paint")
    measured = np.interp(np.rad2deg(theta_r), curve.get_xdata(), curve.get_ydata())
    np.testing.assert_allclose(measured, stokes[:, 0], rtol=1e-9)
    natural = pbrdf.open_experiment("white")
    with pytest.raises(DataError, match="different light"):
        curves_figure([Source("data", dataset=dataset), Source("natural", dataset=natural)])


def test_the_nearest_measured_incidence_is_drawn(hemisphere):
    figure = curves_figure([Source("data", dataset=hemisphere)], 45.0)
    assert figure.axes[0].get_title() == "θi = 40°" and len(figure.axes) == 1


def test_an_incidence_cannot_be_chosen_where_it_is_not_constant(fitted):
    with pytest.raises(DataError, match="leave it out"):
        curves_figure([fitted], 50.0)


def test_scattered_points_are_no_curves():
    rng = np.random.default_rng(3)
    angles = rng.uniform(0.1, 1.2, (3, 40))
    dataset = pbrdf.make_dataset(*angles, quantity="brdf", I=np.ones(40))
    with pytest.raises(DataError, match="--kind hemisphere"):
        curves_figure([Source("scattered", dataset=dataset)])


def test_maps_of_parameters_are_refused():
    with pytest.raises(ModelError, match="map: its parameters are arrays"):
        Source("map", PAINT.replace(a=np.ones(3)))


def test_mueller_elements_of_data_and_model_stand_in_their_places(fitted):
    figure = mueller_figure([fitted, Source("other", OTHER)])
    assert len(figure.axes) == 16
    (curve,) = lines(figure.axes[6], "other")
    x = np.deg2rad(curve.get_xdata())
    M = OTHER.mueller(np.deg2rad(80.0) - x, np.abs(x), np.where(x < 0.0, np.pi, 0.0))
    np.testing.assert_allclose(curve.get_ydata(), M[:, 1, 2] / M[:, 0, 0], atol=1e-12)
    ds = fitted.dataset
    chosen = ds["group"].values == 2
    points = [line for line in lines(figure.axes[4], "fit") if line.get_marker() != "None"]
    np.testing.assert_allclose(
        np.sort(points[0].get_ydata()), np.sort((ds["Q"] / ds["I"]).values[chosen]), rtol=1e-12
    )
    assert not [line for line in lines(figure.axes[5], "fit") if line.get_marker() != "None"]


def test_degrees_of_polarisation_are_no_mueller_elements():
    theta_r = np.deg2rad(np.arange(0.0, 70.0, 10.0))
    dataset = pbrdf.make_dataset(
        np.full(7, 0.5), theta_r, 0.0 * theta_r, quantity="brdf", I=np.full(7, np.nan), dolp=np.full(7, 0.1)
    )
    with pytest.raises(DataError, match="no element of a Mueller matrix"):
        mueller_figure([Source("degree", dataset=dataset)])
