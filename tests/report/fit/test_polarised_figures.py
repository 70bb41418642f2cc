"""Figures of Q/I, U/I, the angle of polarisation and Mueller elements, and of residuals over the hemisphere."""

import numpy as np
import pytest
from figure_helpers import lines, numbers_drawn

import pbrdf
from pbrdf.report.fit.hemisphere_figure import hemisphere_figure
from pbrdf.report.fit.polarisation_figure import polarisation_figure
from pbrdf.report.fit.subject import Report


@pytest.fixture(scope="module")
def mueller_report():
    """All 16 elements of a paint in the plane of incidence at two angles of incidence."""
    theta_i, s = (np.deg2rad(a.ravel()) for a in np.meshgrid([20.0, 50.0], np.arange(-75.0, 76.0, 10.0)))
    theta_r, phi = np.abs(s), np.where(s < 0.0, np.pi, 0.0)
    paint = pbrdf.DoubleGauss(sigma=0.2, n=1.5, a=0.5, k=1.1, b=0.2, t=0.5)
    dataset = pbrdf.make_dataset(
        theta_i, theta_r, phi, quantity="brdf", mueller=paint.mueller(theta_i, theta_r, phi)
    )
    return Report(pbrdf.fit(dataset, starts=2), dataset, "mueller", {})


def test_stokes_vectors_have_four_panels(report):
    figure = polarisation_figure(report)
    q, u, v, angle = figure.axes
    assert [ax.get_ylabel() for ax in (q, u, v)] == ["Q/I", "U/I", "V/I"]
    assert "angle of linear polarisation" in angle.get_ylabel()
    assert numbers_drawn(lines(q, "measured")) == 42 and numbers_drawn(lines(q, "held out")) == 21
    ds = report.dataset
    drawn = np.concatenate([line.get_ydata() for line in lines(q, "measured") + lines(q, "held out")])
    np.testing.assert_allclose(np.sort(drawn), np.sort(ds["Q"].values / ds["I"].values), rtol=1e-12)


@pytest.mark.slow
def test_curves_of_polarised_light_are_the_model(report):
    figure = polarisation_figure(report)
    curve = lines(figure.axes[0], "model")[0]
    x, y = curve.get_xdata(), curve.get_ydata()
    stokes = report.result.model.stokes(
        np.deg2rad(60.0 - x), np.deg2rad(np.abs(x)), np.where(x < 0.0, np.pi, 0.0)
    )
    np.testing.assert_allclose(y, stokes[:, 1] / stokes[:, 0], atol=1e-9)
    angle = lines(figure.axes[3], "model")[0].get_ydata()
    seen = np.isfinite(angle)
    assert seen.any()
    np.testing.assert_allclose(angle[seen], np.where(stokes[seen, 1] > 0.0, 0.0, 90.0), atol=1e-5)


@pytest.mark.slow
def test_a_fit_of_sixteen_elements_draws_sixteen_panels(mueller_report):
    figure = polarisation_figure(mueller_report)
    assert len(figure.axes) == 16
    M = mueller_report.dataset["mueller"].values
    for i, ax in enumerate(figure.axes):
        row, column = divmod(i, 4)
        assert ax.get_title() == ("m00" if i == 0 else f"m{row}{column}/m00")
        drawn = np.concatenate([line.get_ydata() for line in lines(ax, "measured")])
        expected = M[:, row, column] / (1.0 if i == 0 else M[:, 0, 0])
        np.testing.assert_allclose(np.sort(drawn), np.sort(expected), atol=1e-12)
        assert len(lines(ax, "model")) == 2
    # simulated without noise: the curves run through the points
    curve, points = lines(figure.axes[5], "model")[0], lines(figure.axes[5], "measured")[0]
    at = np.interp(points.get_xdata(), curve.get_xdata(), curve.get_ydata())
    np.testing.assert_allclose(at, points.get_ydata(), atol=1e-3)


def test_intensities_alone_have_no_such_figure(hemisphere_report):
    assert polarisation_figure(hemisphere_report) is None


def test_residuals_over_the_hemisphere_are_those_of_the_comparison(hemisphere_report):
    figure = hemisphere_figure(hemisphere_report)
    discs = [ax for ax in figure.axes if ax.name == "polar"]
    assert [ax.get_title() for ax in discs] == ["group 20", "group 40", "group 60 (held out)"]
    table = hemisphere_report.result.comparison
    for ax, group in zip(discs, (20, 40, 60), strict=True):
        chosen = table["group"].values == group
        expected = 100.0 * (table["I_residual"] / table["I_measured"]).values[chosen]
        (drawn,) = ax.collections
        np.testing.assert_allclose(np.sort(drawn.get_array()), np.sort(expected))
        low, high = drawn.get_clim()
        assert low == -high


def test_data_in_the_plane_of_incidence_have_no_hemisphere(report):
    assert hemisphere_figure(report) is None
