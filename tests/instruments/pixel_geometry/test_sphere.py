"""A ball in the picture, given or found."""

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.rays import angles_of
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pixel_helpers import blank, seen, shaded

SIDE = Lamp(math.radians(50.0), math.radians(30.0))
TWO = [Lamp(0.8, 1.0), Lamp(0.8, 4.2)]
PERSPECTIVE = PixelCamera(field_of_view=math.radians(30.0))


def test_parallel_lines_of_sight():
    """sin θ_r = distance from the centre / radius; the p direction runs away from the centre."""
    found = Sphere(x=52.3, y=40.7, r=33.0, lamps=[SIDE], max_zenith=0.5 * math.pi).of(blank(90, 110))
    right, up = np.meshgrid(found.x + 0.5 - 52.3, 40.7 - found.y - 0.5)
    mask = found.mask.values
    away = np.hypot(right, up)
    assert np.sin(found.theta_r.values[mask]) == pytest.approx(away[mask] / 33.0, abs=1e-12)
    turn = found.rotation.values - np.arctan2(up, right)
    assert np.cos(turn[mask]) == pytest.approx(np.ones(mask.sum()), abs=1e-9)
    normal = np.stack([right, up, np.sqrt(np.maximum(33.0**2 - away**2, 0.0))], axis=-1) / 33.0
    cosine = normal @ SIDE.direction
    assert np.cos(found.theta_i.values[mask]) == pytest.approx(cosine[mask], abs=1e-12)
    assert (mask == ((away < 33.0) & (cosine > 0.0))).all()
    assert np.isnan(found.theta_r.values[~mask]).all()


def test_perspective():
    """Against rays that meet a ball in space, worked out apart from the module."""
    camera = PERSPECTIVE.sized(80, 100)
    centre = np.array([0.35, -0.2, -4.0])
    place = camera.place(-centre / np.linalg.norm(centre))
    alpha = math.asin(1.0 / np.linalg.norm(centre))
    lamp = Lamp(0.9, 2.0, 5.0)
    ball = Sphere(
        x=place[0], y=place[1], r=camera.focal * math.tan(alpha), lamps=[lamp], camera=PERSPECTIVE, size=1.0
    )
    found = ball.of(blank(80, 100))
    for row, column in ((40, 60), (30, 70), (50, 55)):
        ray = np.array([column + 0.5 - 50.0, 40.0 - row - 0.5, -camera.focal])
        ray /= np.linalg.norm(ray)
        along = ray @ centre
        point = ray * (along - math.sqrt(along**2 - centre @ centre + 1.0))
        normal = point - centre
        to_lamp = centre + 5.0 * lamp.direction - point
        distance = np.linalg.norm(to_lamp)
        expected = angles_of(normal, to_lamp / distance, -ray)
        here = found.isel(y=row, x=column)
        assert [float(here[n]) for n in ("theta_i", "theta_r", "phi")] == pytest.approx(expected, abs=1e-9)
        assert float(here.irradiance) == pytest.approx(25.0 / distance**2)


def test_size_and_distance_have_one_unit():
    near = Sphere(x=30.0, y=30.0, r=20.0, lamps=[Lamp(0.5, 0.0, 3.0)]).of(blank(60, 60))
    scaled = Sphere(x=30.0, y=30.0, r=20.0, lamps=[Lamp(0.5, 0.0, 0.15)], size=0.05).of(blank(60, 60))
    np.testing.assert_allclose(scaled.theta_i, near.theta_i, rtol=1e-12)
    np.testing.assert_allclose(scaled.irradiance, near.irradiance, rtol=1e-12)


def test_only_lamps_that_are_near_have_an_irradiance():
    ball = {"x": 30.0, "y": 30.0, "r": 20.0}
    assert "irradiance" not in Sphere(**ball, lamps=[Lamp(0.5)]).of(blank(60, 60))
    both = Sphere(**ball, lamps=[Lamp(0.5), Lamp(0.5, 0.0, 3.0)]).of(blank(60, 60, 2))
    assert (
        float(both.irradiance.isel(geometry=0).max()) == 1.0 < float(both.irradiance.isel(geometry=1).max())
    )


@pytest.mark.parametrize("camera", [PixelCamera(), PERSPECTIVE], ids=["orthographic", "perspective"])
@pytest.mark.parametrize(("lamps", "close"), [(TWO, 0.05), ([SIDE], 0.1), ([Lamp(1.3, 2.0)], 0.1)])
def test_it_is_found(camera, lamps, close):
    """Wholly lit by two lamps in turn to a twentieth of a pixel; from one side, where only a part of the outline is to
    be seen, to a tenth."""
    true = Sphere(
        x=80.3, y=56.8, r=40.4, lamps=lamps, camera=camera.sized(120, 150), max_zenith=0.5 * math.pi
    )
    found = Sphere(lamps=lamps, camera=camera).located(shaded(true, 120, 150))
    assert (found.x, found.y, found.r) == pytest.approx((80.3, 56.8, 40.4), abs=close)
    about = found.pixels(np.arange(4), np.arange(4)).attrs
    assert about["found"] == 1 and about["r"] == found.r
    assert about["found_residual_pixels"] < 0.3
    assert about["found_arc_share"] > (0.9 if len(lamps) == 2 else 0.4)


def test_a_dark_ball_before_a_bright_wall_and_bad_pixels():
    """Darker than what is behind it, with a saturated spot on it, which is NaN, and dead pixels."""
    lamps = [Lamp(0.0)]
    true = Sphere(x=100.2, y=70.6, r=45.0, lamps=lamps, camera=PixelCamera().sized(150, 200), max_zenith=1.57)
    pictures = shaded(true, 150, 200, background=0.9)
    values, flags = pictures.I.values.copy(), np.zeros(pictures.I.shape, np.uint8)
    values[:, 60:66, 95:103], flags[:, 60:66, 95:103] = np.nan, 1
    rng = np.random.default_rng(3)
    dead = rng.random(values.shape[1:]) < 0.002
    values[:, dead], flags[:, dead] = np.nan, 2
    pictures = pictures.assign(I=(pictures.I.dims, values), flags=(pictures.I.dims, flags))
    found = Sphere(lamps=lamps).located(pictures)
    assert (found.x, found.y, found.r) == pytest.approx((100.2, 70.6, 45.0), abs=0.3)


@pytest.mark.parametrize("amplitude", [0.3, 0.02])
def test_a_glossy_ball_is_not_its_highlight(amplitude):
    """White or nearly black, with highlights a hundred times brighter: to a fifth of a pixel."""
    paint = pbrdf.DoubleGauss(sigma=0.03, n=1.6, a=amplitude, k=1.2, b=0.2, t=0.6)
    true = Sphere(x=60.3, y=46.8, r=35.4, lamps=TWO, camera=PixelCamera().sized(100, 120), max_zenith=1.57)
    found = Sphere(lamps=TWO).located(seen(paint, true, 100, 120))
    assert (found.x, found.y, found.r) == pytest.approx((60.3, 46.8, 35.4), abs=0.2)


def test_nothing_round_is_said():
    rng = np.random.default_rng(0)
    noise = blank(80, 90).assign(I=(("series", "y", "x"), rng.normal(1.0, 0.1, (1, 80, 90))))
    square = np.zeros((1, 80, 90))
    square[:, 20:60, 30:70] = 1.0
    for pictures in (noise, blank(80, 90).assign(I=(("series", "y", "x"), square)), blank(80, 90)):
        with pytest.raises(DataError, match="no round outline was found"):
            Sphere(lamps=[SIDE]).of(pictures)
    with pytest.raises(DataError, match="no pixel was measured"):
        Sphere(lamps=[SIDE]).of(blank(8, 9).assign(I=(("series", "y", "x"), np.full((1, 8, 9), np.nan))))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere(x=1.0, y=2.0, lamps=[SIDE]), "all three or none"),
        (lambda: Sphere(x=1.0, y=2.0, r=0.0, lamps=[SIDE]), "more than 0"),
        (lambda: Sphere(lamps=[]), "direction of the lamp"),
        (lambda: Sphere(lamps=[SIDE], max_zenith=2.0), "give one up to 90"),
        (lambda: Sphere(x=1.0, y=2.0, r=3.0, lamps=TWO).of(blank(4, 4, 3)), "2 lamps for 3 series"),
        (lambda: Sphere(lamps=[SIDE]).pixels(np.arange(2), np.arange(2)), "not been looked for"),
    ],
)
def test_what_cannot_be_is_said(make, words):
    with pytest.raises(DataError, match=words):
        make()
