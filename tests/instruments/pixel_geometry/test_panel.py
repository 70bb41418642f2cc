"""A flat sample: its stated angles in the middle, those of perspective elsewhere."""

import math

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import PixelCamera
from pbrdf.instruments.pixel_geometry.panel import Panel
from pixel_helpers import blank

ANGLES = (math.radians(35.0), math.radians(50.0), math.radians(70.0), math.radians(80.0))


def test_without_perspective_all_pixels_share_the_angles():
    found = Panel(*ANGLES).of(blank(4, 6))
    assert found.theta_i.dims == ()
    for name, angle in zip(("theta_i", "theta_r", "phi"), ANGLES, strict=False):
        assert float(found[name]) == pytest.approx(angle, abs=1e-12)
    assert float(found.rotation) == pytest.approx(-ANGLES[3])
    assert bool(found.mask)


@pytest.mark.parametrize("theta_r", [0.0, 0.3, 1.2])
@pytest.mark.parametrize("phi", [0.0, 0.5, math.pi, 5.0])
def test_the_middle_has_the_stated_angles(theta_r, phi):
    """And so has any other place where they are said to hold."""
    at = (4.5, 2.5)
    for camera in (PixelCamera(), PixelCamera(focal=30.0)):
        panel = Panel(0.6, theta_r, phi, 1.1, at=at, camera=camera)
        here = panel.of(blank(7, 9))
        if camera.focal:
            here = here.isel(y=2, x=4)
        assert float(here.theta_i) == pytest.approx(0.6, abs=1e-9)
        assert float(here.theta_r) == pytest.approx(theta_r, abs=1e-9)
        if theta_r:
            assert math.cos(float(here.phi) - phi) == pytest.approx(1.0, abs=1e-12)
            assert math.cos(float(here.rotation) + 1.1) == pytest.approx(1.0, abs=1e-12)
        else:
            # seen along the normal φ is 0, and p has turned with it
            assert math.cos(float(here.rotation) + 1.1 - phi) == pytest.approx(1.0, abs=1e-12) or math.cos(
                float(here.rotation) + 1.1 + phi
            ) == pytest.approx(1.0, abs=1e-12)


def test_perspective_changes_the_angle_of_view():
    """A panel tilted back, seen with p upright in the picture (reference −90°): its normal leans upwards by θ_r. Pixels
    lower by the angle δ are seen by rays that run down more steeply: θ_r − δ. A far lamp stands at the same θ_i
    everywhere."""
    camera = PixelCamera(focal=100.0)
    found = Panel(0.5, 0.8, 0.0, -0.5 * math.pi, camera=camera).of(blank(101, 3))
    delta = np.arctan((found.y.values + 0.5 - 50.5) / 100.0)
    assert found.theta_r.isel(x=1).values == pytest.approx(0.8 - delta, abs=1e-12)
    assert found.theta_i.values == pytest.approx(np.full((101, 3), 0.5), abs=1e-12)
    assert found.rotation.isel(x=1).values == pytest.approx(np.full(101, 0.5 * math.pi), abs=1e-12)


def test_a_near_lamp_by_hand():
    """Seen straight on by an orthographic camera, pixels of 2 mm, a lamp 100 mm away at 40° above: a pixel 10 above the
    middle lies 20 mm nearer to the foot of the lamp."""
    panel = Panel(math.radians(40.0), 0.0, 0.0, 0.5 * math.pi, pixel=2.0, lamp_distance=100.0)
    found = panel.of(blank(21, 21))
    c, s = 100.0 * math.cos(math.radians(40.0)), 100.0 * math.sin(math.radians(40.0))
    # θ_r = 0 with p across the picture downwards (reference 90°): the source is where p points
    ups = [float(found.theta_i.isel(x=10, y=y)) for y in (0, 10, 20)]
    assert sorted(ups) == pytest.approx([math.atan2(s - 20.0, c), math.atan2(s, c), math.atan2(s + 20.0, c)])
    side = found.isel(x=0, y=10)
    assert float(side.theta_i) == pytest.approx(math.atan2(math.hypot(s, 20.0), c))
    assert float(side.irradiance) == pytest.approx(100.0**2 / (100.0**2 + 20.0**2))
    assert float(found.irradiance.isel(x=10, y=10)) == pytest.approx(1.0)


def test_a_near_lamp_in_perspective_stands_in_one_place():
    """Each pixel's angles and irradiance, put onto the line of sight and the panel's normal, lead to the same lamp."""
    panel = Panel(*ANGLES, camera=PixelCamera(focal=40.0), distance=3.0, lamp_distance=1.5)
    found = panel.of(blank(21, 31))
    # the camera at the origin, the place in the middle at (0, 0, −3)
    k, rotation = np.array([0.0, 0.0, 1.0]), -ANGLES[3]
    p = np.array([math.cos(rotation), math.sin(rotation), 0.0])
    normal = math.cos(ANGLES[1]) * k + math.sin(ANGLES[1]) * p
    foot = np.array([0.0, 0.0, -3.0])
    lamps = []
    for row, column in ((10, 15), (0, 0), (5, 28), (20, 13)):
        ray = np.array([column + 0.5 - 15.5, 10.5 - row - 0.5, -40.0])
        point = ray * (foot @ normal) / (ray @ normal)
        view = -ray / np.linalg.norm(ray)
        here = found.isel(y=row, x=column)
        i, r, phi = (float(here[name]) for name in ("theta_i", "theta_r", "phi"))
        assert r == pytest.approx(math.acos(view @ normal))
        tangent = (view - math.cos(r) * normal) / math.sin(r)
        forward = math.cos(phi) * tangent - math.sin(phi) * np.cross(normal, tangent)
        source = math.cos(i) * normal - math.sin(i) * forward
        lamps.append(point + 1.5 / math.sqrt(float(here.irradiance)) * source)
    assert np.ptp(lamps, axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    middle = found.isel(y=10, x=15)
    assert [float(middle[n]) for n in ("theta_i", "theta_r", "phi")] == pytest.approx(ANGLES[:3])


def test_what_is_left_out_stands_in_the_pictures():
    """Angles of ``pbrdf reduce --angles``, degrees, one for each series."""
    angles = {
        "theta_i": ("series", [30.0, 40.0]),
        "theta_r": ("series", [50.0, 50.0]),
        "phi": ("series", [0.0, 180.0]),
    }
    pictures = blank(4, 6, 2, **angles).assign_attrs(reference_angle_degree=90.0)
    found = Panel().of(pictures)
    assert found.theta_i.dims == ("geometry",)
    assert np.rad2deg(found.theta_i.values) == pytest.approx([30.0, 40.0])
    assert np.rad2deg(found.theta_r.values) == pytest.approx([50.0, 50.0])
    assert np.rad2deg(found.phi.values) == pytest.approx([0.0, 180.0])
    assert np.rad2deg(found.rotation.values) == pytest.approx([-90.0, -90.0])
    assert Panel().of(pictures.isel(series=[0, 0])).theta_i.dims == ()


@pytest.mark.parametrize(
    ("panel", "words"),
    [
        (Panel(), "theta_i is not known"),
        (Panel(0.3, 0.4, 0.0), "reference_angle is not known"),
        (Panel(0.3, 1.6, 0.0, 0.0), "less than 90"),
        (Panel((0.3, 0.4), 0.5, 0.0, 0.0), "2 angles of the panel for 1 series"),
        (Panel((0.3, 0.4), (0.5, 0.6, 0.7), 0.0, 0.0), "give one of each"),
        (Panel(0.3, 0.4, 0.0, 0.0, lamp_distance=1.0), "size of a pixel"),
        (Panel(0.3, 0.4, 0.0, 0.0, lamp_distance=1.0, camera=PixelCamera(focal=9.0)), "camera's distance"),
    ],
)
def test_what_is_missing_is_said(panel, words):
    with pytest.raises(DataError, match=words):
        panel.of(blank(4, 6))


def test_blocks_are_parts_of_the_whole():
    panel = Panel(*ANGLES, camera=PixelCamera(focal=30.0)).located(blank(20, 30))
    whole = panel.pixels(np.arange(30), np.arange(20))
    part = panel.pixels(np.arange(7, 19), np.arange(3, 5))
    assert part.identical(whole.isel(y=slice(3, 5), x=slice(7, 19)))
    assert panel.located(blank(20, 30)) == panel


def test_angles_that_pictures_have_are_not_replaced():
    """Stated ones must be theirs; a turn more of an azimuth is none."""
    angles = {"theta_i": [10.0, 20.0], "theta_r": [5.0, 5.0], "phi": [0.0, 180.0]}
    pictures = blank(3, 4, series=2).assign_coords({name: ("series", v) for name, v in angles.items()})
    rest = {"reference_angle": 0.1}
    with pytest.raises(
        DataError, match=r"say themselves that theta_i is 10° … 20°, and 30° is stated: leave"
    ):
        Panel(theta_i=math.radians(30.0), **rest).located(pictures)
    with pytest.raises(DataError, match="theta_i is 10° … 20°, and 10° is stated"):
        Panel(theta_i=math.radians(10.0), **rest).located(pictures)
    same = Panel(
        theta_i=np.deg2rad([10.0, 20.0]), theta_r=math.radians(5.0), phi=np.deg2rad([360.0, -180.0]), **rest
    )
    assert len(same.located(pictures).theta_i) == 2
    unknown = pictures.assign_coords(theta_i=("series", [math.nan, math.nan]))
    assert Panel(theta_i=0.5, **rest).located(unknown).theta_i == (0.5,)
