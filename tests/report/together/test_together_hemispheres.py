"""Discs and polar surfaces of several sources."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.report.together.hemispheres import hemispheres_figure, surfaces_figure
from pbrdf.report.together.source import Source, incidence_of

PAINT = pbrdf.DoubleGauss(sigma=0.15, n=1.5, a=0.5, k=1.1, b=0.2, t=0.5)


def discs(figure):
    return [ax for ax in figure.axes if ax.name == "polar"]


def test_data_and_model_share_one_scale(hemisphere):
    figure = hemispheres_figure([Source("data", dataset=hemisphere), Source("paint", PAINT)], 58.0)
    measured, modelled, *_ = discs(figure)
    assert figure.get_suptitle().startswith("θi = 60°")
    assert measured.collections[0].get_clim() == modelled.collections[0].get_clim()
    chosen = np.isclose(hemisphere["theta_i"].values, np.deg2rad(60.0))
    np.testing.assert_allclose(
        np.sort(measured.collections[0].get_array()), np.sort(hemisphere["I"].values[chosen])
    )


@pytest.mark.parametrize("draw", [hemispheres_figure, surfaces_figure])
def test_elements_alone_are_neither_intensity_nor_dolp(draw):
    M = np.full((3, 4, 4), np.nan)
    M[:, 2, 2] = 0.5
    dataset = pbrdf.make_dataset([0.1, 0.2, 0.3], 0.2, 0.5, mueller_over_m00=M)
    with pytest.raises(DataError, match="--kind curves or mueller"):
        draw([Source("data", dataset=dataset)])


def test_the_map_of_a_model_is_the_model():
    figure = hemispheres_figure([Source("paint", PAINT)], 40.0)
    mesh = discs(figure)[0].collections[0]
    corners = mesh.get_coordinates()
    phi, theta_r = corners[..., 0], np.deg2rad(corners[..., 1])
    expected = PAINT.stokes(np.deg2rad(40.0), theta_r, phi)[..., 0]
    np.testing.assert_allclose(np.asarray(mesh.get_array()).reshape(expected.shape), expected, rtol=1e-9)


def test_a_fit_has_a_disc_measured_and_a_disc_modelled(hemisphere):
    figure = hemispheres_figure([Source("fit", PAINT, hemisphere)])
    assert [ax.get_title() for ax in discs(figure)][:2] == ["fit: measured", "fit: model"]
    # the data hold no polarisation
    assert any(text.get_text() == "not measured" for text in discs(figure)[2].texts)


def test_without_a_wish_the_middle_incidence_is_drawn(hemisphere):
    sources = [Source("data", dataset=hemisphere)]
    assert incidence_of(sources, None) == 40.0
    assert incidence_of(sources, 10.0) == 20.0
    assert incidence_of([Source("paint", PAINT)], None) == 35.0
    assert incidence_of([Source("paint", PAINT)], 51.0) == 51.0


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.15, 0.004])
def test_measured_points_lie_on_the_polar_surface(hemisphere, sigma):
    """The data are the model with 2 % scatter: their distances from the origin are those of the surface."""
    model = PAINT.replace(sigma=sigma)
    figure = surfaces_figure([Source("data", dataset=hemisphere), Source("paint", model)], 40.0)
    points, surface = figure.axes[:2]
    assert points.name == surface.name == "3d"
    x, y, z = (np.asarray(a) for a in points.collections[0]._offsets3d)
    distance = np.sqrt(x**2 + y**2 + z**2)
    assert 0.0 < distance.max() <= 1.0 + 1e-12
    chosen = np.isclose(hemisphere["theta_i"].values, np.deg2rad(40.0))
    order = np.argsort(hemisphere["I"].values[chosen])
    assert (np.diff(distance[order]) >= -1e-12).all()
    # the height is that of the direction
    theta_r = hemisphere["theta_r"].values[chosen]
    np.testing.assert_allclose(z, distance * np.cos(theta_r), atol=1e-12)
    assert ("logarithmic" in surface.get_title()) == (sigma < 0.1)
