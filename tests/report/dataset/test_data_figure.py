import numpy as np
from figure_helpers import legend, lines, numbers_drawn

import pbrdf
from pbrdf.report.dataset.figure import data_figure


def test_intensity_is_logarithmic_only_over_decades():
    s = np.linspace(-60.0, 60.0, 13)
    for peak, scale in ((1.2, "linear"), (5.0, "linear"), (100.0, "log")):
        ds = pbrdf.make_dataset(
            np.deg2rad(30.0),
            np.deg2rad(np.abs(s)),
            np.where(s < 0.0, np.pi, 0.0),
            quantity="brdf",
            I=np.where(s == 30.0, peak, 1.0),
        )
        ax = data_figure(ds, "x").axes[0]
        assert ax.get_yscale() == scale
        if peak == 5.0:
            assert ax.get_ylim()[0] == 0.0


def test_values_that_a_logarithm_cannot_show_are_counted():
    s = np.linspace(-60.0, 60.0, 25)
    I = np.where(s == 30.0, 100.0, 1.0)  # noqa: E741
    I[3] = -0.01
    I[4] = 0.0
    ds = pbrdf.make_dataset(
        np.deg2rad(30.0), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0), quantity="brdf", I=I
    )
    texts = [text.get_text() for text in data_figure(ds, "x").axes[0].texts]
    assert texts == ["2 measured values ≤ 0 not shown"]


def test_data_without_a_plane_are_drawn_over_the_hemisphere(hemisphere):
    aside = hemisphere.isel(geometry=np.abs(np.sin(hemisphere["phi"].values)) > 0.5)
    figure = data_figure(aside, "aside")
    discs = [ax for ax in figure.axes if ax.name == "polar"]
    assert [ax.get_title() for ax in discs] == ["group 20", "group 40", "group 60"]
    assert sum(len(ax.collections[0].get_offsets()) for ax in discs) == aside.sizes["geometry"]
    assert "intensity (1/sr)" in {ax.get_ylabel() for ax in figure.axes}


def test_data_have_no_model_lines(report):
    figure = data_figure(report.dataset, "paint.csv")
    assert len(figure.axes) == 2
    assert lines(figure.axes[0], "model") == []
    assert numbers_drawn(lines(figure.axes[0], "measured")) == 63


def test_too_many_curves_are_thinned_out():
    theta_i, s = (a.ravel() for a in np.meshgrid(np.arange(2.0, 82.0, 4.0), np.arange(-60.0, 61.0, 10.0)))
    ds = pbrdf.make_dataset(
        np.deg2rad(theta_i), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0), quantity="brdf", I=1.0
    )
    figure = data_figure(ds, "x")
    assert figure.axes[0].get_title().startswith("Plane of incidence (10 of ")
    assert len(legend(figure)) == 10
