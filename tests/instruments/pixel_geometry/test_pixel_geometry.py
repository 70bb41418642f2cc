"""Angles and axes from vectors: signs by physics, and where a plane is not defined."""

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.instruments.goniometer.rays import ray_vectors
from pbrdf.instruments.pixel_geometry.camera import Lamp
from pbrdf.instruments.pixel_geometry.geometry import plane_rotation
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pbrdf.optics.elements import rotate_frame
from pixel_helpers import blank

GLASS = pbrdf.DoubleGauss(sigma=0.3, n=1.5, a=0.0, k=1.0, b=0.0, t=0.0)
MATT = pbrdf.DoubleGauss(sigma=0.05, n=1.5, a=1.0, k=1.0, b=0.0, t=1.0)


def ball(lamp, radius=40.0, size=101):
    sphere = Sphere(x=0.5 * size, y=0.5 * size, r=radius, lamps=[lamp])
    return sphere.of(blank(size, size))


def seen_aolp(model, geometry, row, column):
    """AoLP in the picture, degrees from the horizontal counterclockwise, of a paint seen at a pixel."""
    here = geometry.isel(y=row, x=column)
    stokes = model.stokes(*(np.array([float(here[name])]) for name in ("theta_i", "theta_r", "phi")))
    seen = rotate_frame(-float(here.rotation)) @ stokes[0]
    return math.degrees(0.5 * math.atan2(seen[2], seen[1]))


@pytest.mark.parametrize("turn", [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0])
def test_reflection_on_a_ball_is_tangential_and_body_light_radial(turn):
    """A glass ball lit from the side mirrors the lamp at a place between its middle and the lamp. Near Brewster's angle
    light reflected there vibrates across the plane of incidence, which holds the ball's middle: tangentially. Above the
    middle that is horizontal (0°), beside it upright (90°), to the upper right 135°. Light out of a coating, far from
    the mirror direction (the lamp beside the camera), leaves polarised in the plane of view: radially."""
    geometry = ball(Lamp(math.radians(112.0), math.radians(turn)))
    away = 40.0 * math.sin(math.radians(56.0))
    column = int(50.5 + away * math.cos(math.radians(turn)))
    row = int(50.5 - away * math.sin(math.radians(turn)))
    here = geometry.isel(y=row, x=column)
    assert math.degrees(float(here.theta_i)) == pytest.approx(56.0, abs=2.0)
    assert math.degrees(float(here.theta_r)) == pytest.approx(56.0, abs=2.0)
    off = (seen_aolp(GLASS, geometry, row, column) - (turn + 90.0) + 90.0) % 180.0 - 90.0
    assert abs(off) < 2.0
    geometry = ball(Lamp(math.radians(5.0), math.radians(turn)))
    off = (seen_aolp(MATT, geometry, row, column) - turn + 90.0) % 180.0 - 90.0
    assert abs(off) < 2.0


def test_u_changes_its_sign_across_the_plane_of_incidence():
    """Left and right of the plane through lamp and camera the picture of a ball is its own mirror image: the AoLP there
    are mirror images too."""
    geometry = ball(Lamp(math.radians(60.0), math.radians(90.0)))
    for row, column in ((30, 35), (40, 25), (60, 40)):
        left = seen_aolp(pbrdf.load_paint("white"), geometry, row, column)
        right = seen_aolp(pbrdf.load_paint("white"), geometry, row, 100 - column)
        assert (left + right + 90.0) % 180.0 == pytest.approx(90.0, abs=1e-6)
        assert abs(left) > 1.0


def test_angles_and_rotation_are_those_of_the_projects_vectors():
    """Vectors of a geometry, put anywhere in space, give back its angles, and p there is the project's p."""
    rng = np.random.default_rng(1)
    theta_i, theta_r = rng.uniform(0.05, 1.4, (2, 50))
    phi = rng.uniform(0.0, 2.0 * np.pi, 50)
    rays = ray_vectors(theta_i, theta_r, phi)
    turn = np.linalg.qr(rng.normal(size=(50, 3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))[:, None, None]

    def moved(v):
        return np.einsum("nij,nj->ni", turn, np.broadcast_to(v, (50, 3)))

    normal, view, source = moved([0.0, 0.0, 1.0]), moved(rays["omega_r"]), moved(rays["omega_i"])
    rotation = plane_rotation(normal, view, source)
    x = np.cross([0.0, 1.0, 0.0], view)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    p = np.cos(rotation)[:, None] * x + np.sin(rotation)[:, None] * np.cross(view, x)
    assert p == pytest.approx(moved(rays["p_r"]), abs=1e-12)


def test_where_no_plane_is_defined():
    """The very middle of the ball is seen along its normal: φ is 0, and p points to the side of the lamp; with the lamp
    beside the camera it is the x axis. Lamp and camera in one direction elsewhere is backscatter, φ = π."""
    up = ball(Lamp(math.radians(40.0), math.radians(90.0))).isel(y=50, x=50)
    assert float(up.theta_r) == pytest.approx(0.0, abs=1e-12)
    assert float(up.phi) == 0.0
    assert math.degrees(float(up.rotation)) == pytest.approx(90.0)
    geometry = ball(Lamp(0.0, 0.0))
    middle = geometry.isel(y=50, x=50)
    assert (float(middle.theta_i), float(middle.phi), float(middle.rotation)) == (0.0, 0.0, 0.0)
    assert np.isfinite(geometry.rotation.values[geometry.mask.values]).all()
    assert float(geometry.phi.isel(y=30, x=60)) == pytest.approx(np.pi)
    # nothing jumps: the light seen just beside the middle is that of the middle
    geometry = ball(Lamp(math.radians(40.0), math.radians(90.0)), radius=1e6)
    angles = {seen_aolp(GLASS, geometry, 50 + i, 50 + j) for i in (-1, 0, 1) for j in (-1, 0, 1)}
    assert max(angles) - min(angles) < 1e-3
