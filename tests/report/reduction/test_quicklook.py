"""What a quick look shows: means over blocks, masked pixels marked, angles in their own colour."""

import itertools

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from pbrdf.instruments.reduction.regions import Ellipse, Rectangle
from pbrdf.instruments.reduction.stokes_image import PixelFlag, StokesImage
from pbrdf.report.reduction.picture_sums import Picture, PictureSum, block_sums
from pbrdf.report.reduction.quicklook import overview_figure, quicklook_figure
from pbrdf.report.style import save_figure


def image_of(rows, columns, seed=0):
    draw = np.random.default_rng(seed)
    stokes = np.stack(
        [
            draw.uniform(500, 1000, (rows, columns)),
            draw.uniform(-200, 200, (rows, columns)),
            draw.uniform(-200, 200, (rows, columns)),
            np.full((rows, columns), np.nan),
        ]
    )
    covariance = np.full((4, 4, rows, columns), np.nan)
    covariance[:3, :3] = np.eye(3)[:, :, None, None] * draw.uniform(1, 4, (rows, columns))
    flags = np.where(draw.random((rows, columns)) < 0.2, np.uint8(PixelFlag.SATURATED), np.uint8(0))
    stokes[:, flags != 0] = np.nan
    covariance[:, :, flags != 0] = np.nan
    return StokesImage(stokes, covariance, flags)


def rows_of_image(image, first, last):
    return StokesImage(
        image.stokes[:, first:last], image.covariance[:, :, first:last], image.flags[first:last]
    )


@pytest.mark.parametrize("cuts", [(0, 100), (0, 1, 2, 50, 99, 100), (0, 33, 100)])
def test_blocks_are_means_of_good_pixels(cuts, monkeypatch):
    """However the rows come: blocks hold the mean over their good pixels, the last row and column of blocks too."""
    monkeypatch.setattr("pbrdf.report.reduction.picture_sums._BLOCKS", 20)
    rows, columns = 100, 83
    image = image_of(rows, columns)
    total = PictureSum(rows, columns)
    size = total.size
    assert size == 5
    for first, last in itertools.pairwise(cuts):
        total.add(block_sums(rows_of_image(image, first, last), first, size))
    picture = total.picture()
    assert picture.intensity.shape == (20, 17)
    for y in range(20):
        for x in range(17):
            part = image.stokes[:, 5 * y : 5 * y + 5, 5 * x : 5 * x + 5]
            i, q, u = np.nanmean(part[:3], axis=(1, 2))
            assert picture.intensity[y, x] == pytest.approx(i)
            assert picture.dolp[y, x] == pytest.approx(np.hypot(q, u) / i)
            assert picture.aolp[y, x] == pytest.approx(np.rad2deg(0.5 * np.arctan2(u, q)))
            # the angle of the mean, from the covariance of the mean: σ/(2 √(Q² + U²)) radians for equal variances
            variance = np.nansum(image.covariance[1, 1, 5 * y : 5 * y + 5, 5 * x : 5 * x + 5])
            error = np.sqrt(variance) / np.isfinite(part[0]).sum() / (2.0 * np.hypot(q, u))
            assert np.deg2rad(picture.aolp_std[y, x]) == pytest.approx(
                min(error, np.pi / np.sqrt(12.0)), rel=1e-6
            )


def test_a_block_shows_a_mask_where_few_pixels_are_good(monkeypatch):
    monkeypatch.setattr("pbrdf.report.reduction.picture_sums._BLOCKS", 2)
    image = image_of(8, 8)
    image.flags[:] = 0
    image.stokes[:3] = 1.0
    image.covariance[:3, :3] = 1.0
    image.flags[:4, :4].ravel()[:] = 0
    image.flags[0, :3] = PixelFlag.DEAD  # 3 of 16: not marked
    image.flags[4:, :4] = PixelFlag.DARK
    image.flags[4:7, 4:] = PixelFlag.SATURATED
    total = PictureSum(8, 8)
    total.add(block_sums(image, 0, total.size))
    assert total.picture().mask.tolist() == [[0, 0], [3, 1]]


def picture_of(aolp, mask=None):
    shape = aolp.shape
    return Picture(
        intensity=np.full(shape, 100.0),
        dolp=np.full(shape, 0.15),
        aolp=aolp,
        aolp_std=np.zeros(shape),
        mask=np.zeros(shape, int) if mask is None else mask,
        shape=shape,
        size=1,
    )


def colours_at(figure, axes, places):
    """Colours that the figure shows at places (x, y) of some axes."""
    drawn = np.asarray(figure.canvas.buffer_rgba())[..., :3] / 255.0
    return [
        drawn[round(drawn.shape[0] - up), round(across)] for across, up in axes.transData.transform(places)
    ]


def panels(figure):
    return [ax for ax in figure.axes if ax.get_title()]


@pytest.mark.slow
def test_angles_half_a_turn_apart_have_one_colour_and_others_not():
    """The colours are cyclic: −90° and 90° are the same light and look the same, 0° does not."""
    figure = quicklook_figure(picture_of(np.array([[-89.9, 89.9], [0.0, 45.0]])), "angles")
    ax = panels(figure)[2]
    figure.canvas.draw()
    minus, plus, zero, between = colours_at(figure, ax, [(0.8, 0.2), (1.8, 0.2), (0.8, 1.2), (1.5, 1.5)])
    np.testing.assert_allclose(minus, plus, atol=0.02)
    assert np.abs(minus - zero).max() > 0.3
    np.testing.assert_allclose(between, colormaps["twilight"](0.75)[:3], atol=0.02)


@pytest.mark.slow
def test_the_compass_shows_each_angle_in_its_own_direction():
    """Light polarised along a direction in the picture has the colour that the disc shows there, y upwards."""
    figure = quicklook_figure(picture_of(np.array([[40.0]])), "angles")
    figure.canvas.draw()
    (compass,) = [ax for ax in panels(figure)[2].child_axes if not ax.axison]
    angles = np.array([0.0, 40.0, 90.0, 135.0])
    directions = 0.7 * np.stack([np.cos(np.deg2rad(angles)), np.sin(np.deg2rad(angles))], axis=-1)
    expected = colormaps["twilight"](np.mod(angles + 90.0, 180.0) / 180.0)[:, :3]
    np.testing.assert_allclose(colours_at(figure, compass, directions), expected, atol=0.06)


@pytest.mark.slow
def test_masked_pixels_are_marked_in_every_panel_and_named():
    mask = np.array([[0, 1], [2, 3]])
    figure = quicklook_figure(picture_of(np.zeros((2, 2)), mask), "masked")
    figure.canvas.draw()
    expected = [to_rgb(colour) for colour in ("#FF5A00", "#00A878", "#56B4E9")]
    for ax in panels(figure):
        # away from the compass in the lower left corner
        shown = colours_at(figure, ax, [(1.5, 0.5), (0.7, 1.3), (1.5, 1.5)])
        np.testing.assert_allclose(shown, expected, atol=0.02)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["saturated", "dead", "dark"]


@pytest.mark.slow
def test_uncertain_angles_are_grey():
    picture = picture_of(np.full((2, 2), 45.0))
    picture.aolp_std[0, 1] = 25.0
    figure = quicklook_figure(picture, "noise")
    ax = panels(figure)[2]
    figure.canvas.draw()
    ((red, green, blue),) = colours_at(figure, ax, [(1.5, 0.5)])
    assert red == green == blue
    assert figure.legends[0].get_texts()[0].get_text() == "angle uncertain by more than 10°"


def test_scales_are_stated_and_regions_named():
    figure = quicklook_figure(
        picture_of(np.zeros((30, 40))),
        "a sample",
        {"paint": Rectangle(5, 10, 5, 20), "disc": Ellipse(30, 20, 5, 4)},
    )
    intensity, dolp, aolp = panels(figure)
    assert dolp.get_title() == "Degree of linear polarisation, scale 0 to 0.2"
    assert [text.get_text() for text in intensity.texts] == ["paint", "disc"]
    labels = [ax.get_ylabel() for ax in figure.axes] + [
        child.get_ylabel() for ax in figure.axes for child in ax.child_axes
    ]
    assert "digital numbers" in labels
    assert any("degrees" in label for label in labels)
    # row 0 is at the top
    assert intensity.get_ylim() == (30.0, 0.0)
    assert aolp.get_xlim() == (0.0, 40.0)


@pytest.mark.slow
def test_an_overview_has_a_column_for_each_series(tmp_path):
    pictures = [picture_of(np.full((6, 8), angle)) for angle in np.linspace(-80.0, 80.0, 11)]
    figure = overview_figure(pictures, [f"s{k}" for k in range(11)], "all")
    assert [ax.get_title() for ax in figure.axes if ax.get_title()] == [f"s{k}" for k in range(11)]
    assert sum(ax.get_visible() for ax in figure.axes) == 33
    save_figure(figure, tmp_path / "overview.png")
    assert (tmp_path / "overview.png").stat().st_size > 1000


@pytest.mark.slow
def test_a_picture_without_a_good_pixel_can_be_drawn(tmp_path):
    nothing = np.full((4, 5), np.nan)
    picture = Picture(nothing, nothing, nothing, nothing, np.ones((4, 5), int), (4, 5), 1)
    figures = {
        "white.png": quicklook_figure(picture, "white"),
        "all.png": overview_figure([picture], ["1"], "white"),
    }
    for name, figure in figures.items():
        save_figure(figure, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000
        assert [text.get_text() for text in figure.legends[0].get_texts()] == ["saturated"]
    figure = figures["white.png"]
    figure.canvas.draw()
    for ax in panels(figure):
        shown = colours_at(figure, ax, [(1.5, 0.5), (4.5, 0.5), (2.5, 2.5), (4.5, 3.5)])
        np.testing.assert_allclose(shown, [to_rgb("#FF5A00")] * 4, atol=0.02)
