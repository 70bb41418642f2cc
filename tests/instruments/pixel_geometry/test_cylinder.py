"""A cylinder in the picture, given or found."""

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.rays import angles_of
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.cylinder import Cylinder
from pixel_helpers import blank, seen, shaded

LAMPS = [Lamp(1.0, 0.0), Lamp(1.0, math.pi)]
PERSPECTIVE = PixelCamera(field_of_view=math.radians(30.0))


def test_an_upright_cylinder_by_hand():
    """Normals lie in the horizontal plane: sin θ_r = distance from the axis / radius, p across the axis."""
    found = Cylinder(x=30.5, y=20.0, r=20.0, angle=0.5 * math.pi, lamps=[Lamp(0.0)], max_zenith=1.5).of(
        blank(40, 61)
    )
    off = found.x.values + 0.5 - 30.5
    mask = found.mask.values
    assert (mask == mask[:1]).all()
    assert np.sin(found.theta_r.values[7])[mask[7]] == pytest.approx(np.abs(off)[mask[7]] / 20.0)
    beside = mask[7] & (off != 0.0)
    assert np.cos(found.rotation.values[7])[beside] == pytest.approx(np.sign(off)[beside])
    # in the middle line the camera looks along the normal, from where the lamp is, too
    assert float(found.rotation.isel(y=7, x=30)) == 0.0


@pytest.mark.parametrize("camera", [PixelCamera(), PERSPECTIVE], ids=["orthographic", "perspective"])
def test_a_tilted_cylinder_against_points_on_it(camera):
    """Points on a cylinder in space, seen where they project to, have the angles of their own vectors."""
    sized = camera.sized(120, 160)
    angle, tilt = 0.7, 0.35
    axis = np.array([math.cos(tilt) * math.cos(angle), math.cos(tilt) * math.sin(angle), math.sin(tilt)])
    lamp = Lamp(0.8, 2.5)
    if sized.focal is None:
        scale, middle = 25.0, np.array([0.4, -0.3, 0.0])
        x, y = 80.0 + scale * middle[0], 60.0 - scale * middle[1]
        r = scale
    else:
        middle = np.array([0.4, -0.3, -9.0])
        x, y = sized.place(-middle / np.linalg.norm(middle))
        # the axis' distance from the camera
        distance = np.linalg.norm(middle - (middle @ axis) * axis)
        r = sized.focal * math.tan(math.asin(1.0 / distance))
    geometry = Cylinder(
        x=x, y=y, r=r, angle=angle, tilt=tilt, lamps=[lamp], camera=camera, max_zenith=1.57
    ).located(blank(120, 160))
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    front = np.cross(side, axis)
    checked = 0
    for along in (-1.0, 0.0, 0.8):
        for turn in (-0.9, -0.2, 0.5, 1.1):
            normal = math.cos(turn) * front + math.sin(turn) * side
            point = middle + along * axis + normal
            if sized.focal is None:
                view = np.array([0.0, 0.0, 1.0])
                px, py = 80.0 + r * point[0], 60.0 - r * point[1]
            else:
                view = -point / np.linalg.norm(point)
                px, py = sized.place(view)
            if normal @ view < 0.05 or normal @ lamp.direction < 0.05:
                continue
            found = geometry.pixels(np.array([px - 0.5]), np.array([py - 0.5])).isel(x=0, y=0)
            expected = angles_of(normal, lamp.direction, view)
            assert [float(found[n]) for n in ("theta_i", "theta_r", "phi")] == pytest.approx(
                [float(a) for a in expected], abs=1e-6
            )
            checked += 1
    assert checked >= 6


@pytest.mark.parametrize("camera", [PixelCamera(), PERSPECTIVE], ids=["orthographic", "perspective"])
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_it_is_found(camera, tilt):
    """Axis and half width to a twentieth of a pixel, direction to a tenth of a degree, its ends; its tilt, which only
    perspective shows, to a third of a degree."""
    true = Cylinder(
        x=80.3,
        y=56.8,
        r=22.4,
        angle=1.2,
        tilt=tilt,
        length=70.0,
        lamps=LAMPS,
        camera=camera.sized(120, 150),
        max_zenith=0.5 * math.pi,
    )
    found = Cylinder(lamps=LAMPS, camera=camera).located(shaded(true, 120, 150))
    off = np.array([found.x - 80.3, 56.8 - found.y])
    assert off @ [-math.sin(1.2), math.cos(1.2)] == pytest.approx(0.0, abs=0.05)
    assert off @ [math.cos(1.2), math.sin(1.2)] == pytest.approx(0.0, abs=1.0)
    assert found.r == pytest.approx(22.4, abs=0.05)
    assert found.angle == pytest.approx(1.2, abs=2e-3)
    assert found.tilt == pytest.approx(0.0 if camera.field_of_view is None else tilt, abs=6e-3)
    assert found.length == pytest.approx(70.0, abs=2.0)
    assert found.pixels(np.arange(3), np.arange(3)).attrs["found"] == 1


@pytest.mark.parametrize("amplitude", [0.3, 0.02])
def test_a_glossy_cylinder_is_not_its_highlight(amplitude):
    """White or nearly black, with a bright stripe along it: to a fifth of a pixel."""
    paint = pbrdf.DoubleGauss(sigma=0.03, n=1.6, a=amplitude, k=1.2, b=0.2, t=0.6)
    true = Cylinder(
        x=60.3,
        y=46.8,
        r=18.4,
        angle=1.5,
        length=70.0,
        lamps=LAMPS,
        camera=PixelCamera().sized(100, 120),
        max_zenith=1.57,
    )
    found = Cylinder(lamps=LAMPS).located(seen(paint, true, 100, 120))
    assert found.x + (found.y - 46.8) / math.tan(1.5) == pytest.approx(60.3, abs=0.2)
    assert found.r == pytest.approx(18.4, abs=0.2)
    assert found.angle == pytest.approx(1.5, abs=3e-3)


def test_it_may_leave_the_picture():
    true = Cylinder(
        x=60.0, y=50.0, r=25.0, angle=1.5, lamps=LAMPS, camera=PixelCamera().sized(100, 120), max_zenith=1.57
    )
    found = Cylinder(lamps=LAMPS).located(shaded(true, 100, 120))
    assert found.length is None
    assert found.r == pytest.approx(25.0, abs=0.2)
    assert found.angle == pytest.approx(1.5, abs=3e-3)


def test_a_shadow_is_not_taken_for_an_edge():
    """Lit from one side a cylinder fades away on the other: half of it would pass for the whole."""
    lamps = [Lamp(1.0, 0.0)]
    true = Cylinder(
        x=60.0, y=50.0, r=25.0, angle=1.5, lamps=lamps, camera=PixelCamera().sized(100, 120), max_zenith=1.57
    )
    with pytest.raises(DataError, match="not sharp, as where its shadow begins"):
        Cylinder(lamps=lamps).of(shaded(true, 100, 120))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Cylinder(x=1.0, y=2.0, r=3.0, lamps=LAMPS), "give all or none"),
        (lambda: Cylinder(x=1.0, y=2.0, r=3.0, angle=0.0, tilt=1.6, lamps=LAMPS), "less than 90"),
        (lambda: Cylinder(size=0.0, lamps=LAMPS), "more than 0"),
        (lambda: Cylinder(lamps=LAMPS).of(blank(30, 30, 2)), "no two straight edges"),
    ],
)
def test_what_cannot_be_is_said(make, words):
    with pytest.raises(DataError, match=words):
        make()
