"""Figures of rendered pictures."""

import math

import numpy as np
import pytest

from pbrdf.rendering.picture import StokesPicture
from pbrdf.report.rendering.figure import channel_figure, colour_figure, polarizer_figure, stokes_figure
from pbrdf.report.style import save_figure


@pytest.fixture
def picture():
    """Level, rising, upright and falling polarisation in the four quarters; the lower right one is lost in noise."""
    rows, columns = 20, 30
    stokes = np.zeros((4, rows, columns))
    stokes[0] = np.linspace(0.2, 1.0, columns)
    angle = np.zeros((rows, columns))
    angle[:10, 15:], angle[10:, :15], angle[10:, 15:] = math.pi / 4, math.pi / 2, -math.pi / 4
    stokes[1], stokes[2] = 0.4 * stokes[0] * np.cos(2 * angle), 0.4 * stokes[0] * np.sin(2 * angle)
    stokes[3] = 0.05 * stokes[0]
    std = np.full_like(stokes, 1e-3)
    std[:, 10:, 15:] = 1.0
    return StokesPicture(stokes, std)


def image_of(axes):
    return axes.get_images()[0]


def test_all_channels_are_labelled(picture):
    figure = stokes_figure(picture, "a title")
    titles = [ax.get_title() for ax in figure.axes]
    for wanted in ("intensity", "DoLP", "AoLP: 0° horizontal, counterclockwise", "left circular +"):
        assert any(wanted in title for title in titles)
    labels = {ax.get_ylabel() for ax in figure.axes}
    assert {
        "radiance S0",
        "degree of linear polarisation",
        "angle of linear polarisation (°)",
        "S1 / S0",
        "S2 / S0",
        "S3 / S0",
    } <= labels
    assert figure.get_suptitle() == "a title"


def test_the_colours_of_aolp_are_cyclic(picture):
    """−90° and 90° are one direction, and have one colour; perpendicular directions have different ones."""
    shown = image_of(channel_figure(picture, "aolp", "").axes[0])
    assert shown.get_clim() == (-90.0, 90.0)
    colour = {angle: np.array(shown.cmap(shown.norm(angle))) for angle in (-90.0, 90.0, 0.0, -45.0, 45.0)}
    assert colour[-90.0] == pytest.approx(colour[90.0], abs=0.02)
    assert np.abs(colour[0.0] - colour[90.0]).max() > 0.3
    assert np.abs(colour[45.0] - colour[-45.0]).max() > 0.3


def test_angles_within_the_noise_are_not_shown(picture):
    values = np.ma.filled(image_of(channel_figure(picture, "aolp", "").axes[0]).get_array(), np.nan)
    assert values[:10, :15] == pytest.approx(0.0)
    assert values[:10, 15:] == pytest.approx(45.0)
    assert values[10:, :15] == pytest.approx(90.0)
    assert np.isnan(values[10:, 15:]).all()


def test_without_errors_every_angle_is_shown(picture):
    unknown = StokesPicture(picture.stokes, np.full_like(picture.std, np.nan))
    values = np.ma.filled(image_of(channel_figure(unknown, "aolp", "").axes[0]).get_array(), np.nan)
    assert values[10:, 15:] == pytest.approx(-45.0)


def test_the_scale_of_dolp_begins_at_0_and_holds_the_values(picture):
    low, high = image_of(channel_figure(picture, "dolp", "").axes[0]).get_clim()
    assert low == 0.0
    assert 0.4 <= high <= 0.5


def test_the_scale_is_that_of_the_surfaces_and_not_of_the_sky(picture):
    """A sky of 80 % in the upper half, a paint of 10 % below it."""
    stokes = picture.stokes.copy()
    stokes[1], stokes[2] = 0.1 * stokes[0], 0.02 * stokes[0]
    stokes[1, :10] = 0.8 * stokes[0, :10]
    below = np.zeros(picture.shape, dtype=bool)
    below[10:] = True
    seen = StokesPicture(stokes, np.full_like(stokes, 1e-3), surface=below)
    assert image_of(channel_figure(seen, "dolp", "").axes[0]).get_clim()[1] <= 0.15
    assert image_of(channel_figure(seen, "s1", "").axes[0]).get_clim()[1] == pytest.approx(0.1)
    for surface in (None, np.zeros_like(below)):
        whole = StokesPicture(stokes, seen.std, surface=surface)
        assert image_of(channel_figure(whole, "dolp", "").axes[0]).get_clim()[1] >= 0.8


def test_circular_polarisation_within_the_noise_is_not_shown(picture):
    noise = np.random.default_rng(0).standard_normal(picture.shape) * picture.std[3]
    stokes = picture.stokes.copy()
    stokes[3] = noise
    axes = channel_figure(StokesPicture(stokes, picture.std), "s3", "").axes[0]
    assert (
        "none beyond the noise" in axes.get_title() and np.ma.getmaskarray(image_of(axes).get_array()).all()
    )
    stokes[3, 5:8] = 0.1 * stokes[0, 5:8]
    axes = channel_figure(StokesPicture(stokes, picture.std), "s3", "").axes[0]
    assert "left circular +" in axes.get_title() and not np.ma.getmaskarray(image_of(axes).get_array()).any()


def test_views_through_polarisers_share_a_scale(picture):
    """Crossed polarisers: what one lets through the other stops; both pictures have the same brightness scale."""
    level, upright = (image_of(polarizer_figure(picture, a, "").axes[0]) for a in (0.0, math.pi / 2))
    assert level.get_clim() == upright.get_clim()
    assert level.get_array()[0, 0] > 2.0 * upright.get_array()[0, 0]
    both = np.asarray(level.get_array()) + np.asarray(upright.get_array())
    assert both == pytest.approx(picture.stokes[0])


@pytest.mark.slow
@pytest.mark.parametrize("channel", ["s0", "dolp", "aolp", "s1", "s2", "s3"])
def test_a_dark_picture_can_be_drawn(channel, tmp_path):
    dark = StokesPicture(np.zeros((4, 5, 6)), np.zeros((4, 5, 6)))
    save_figure(channel_figure(dark, channel, "nothing"), tmp_path / "dark.png")
    assert (tmp_path / "dark.png").stat().st_size > 2000


def test_the_longest_wavelength_is_red():
    pictures = []
    for nm, brightness in ((450.0, 0.1), (650.0, 1.0), (550.0, 0.5)):
        stokes = np.zeros((4, 6, 8))
        stokes[0] = brightness
        pictures.append(StokesPicture(stokes, np.zeros_like(stokes), {"wavelength": nm}))
    ax = colour_figure(pictures, "a title").axes[0]
    red, green, blue = np.asarray(image_of(ax).get_array())[0, 0]
    assert red == 1.0 and red > green > blue
    assert "650 nm, 550 nm, 450 nm as red, green, blue" in ax.get_title()
