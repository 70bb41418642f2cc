"""Meshes before a camera: a plane is a panel, many triangles a ball, and what is rendered is what was said."""

import math

import numpy as np
import pytest
import xarray as xr
from scene_helpers import unit

import pbrdf
import pbrdf.rendering
from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp, PixelCamera
from pbrdf.instruments.pixel_geometry.geometries import as_geometries
from pbrdf.instruments.pixel_geometry.map_dataset import map_dataset
from pbrdf.instruments.pixel_geometry.panel import Panel
from pbrdf.instruments.pixel_geometry.sphere import Sphere
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.rendering.mesh_geometry import MeshGeometry
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera
from pbrdf.rendering.virtual_camera import exposure_for, picture_frames

PAINT = pbrdf.DoubleGauss(sigma=0.15, n=1.6, a=0.4, k=1.2, b=0.3, t=0.6)
FOV = math.radians(20.0)
ORIGIN = (1.5, -3.0, 1.0)
DISTANCE = math.sqrt(1.5**2 + 3.0**2 + 1.0)


def write_ply(path, vertices, faces, normals=None):
    columns = vertices if normals is None else np.hstack([vertices, normals])
    names = "xyz" if normals is None else ("x", "y", "z", "nx", "ny", "nz")
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(f"{value:.9g}" for value in row) for row in columns]
    rows += [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join([*head, *rows]) + "\n")


def write_ball(path, radius, columns=160, rows=80):
    polar, turn = np.meshgrid(np.linspace(0.0, np.pi, rows + 1), np.linspace(0.0, 2.0 * np.pi, columns + 1))
    normals = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    index = np.arange(len(normals)).reshape(columns + 1, rows + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    write_ply(path, radius * normals, faces, normals)


def blank(rows, columns, series=("one",)):
    return xr.Dataset(coords={"series": list(series), "y": np.arange(rows), "x": np.arange(columns)})


@pytest.mark.slow
@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("distance", [math.inf, 2.0])
def test_a_ball_of_many_triangles_is_a_ball(mitsuba, tmp_path, perspective, distance):
    write_ball(tmp_path / "ball.ply", 0.4)
    lamps = [Lamp(0.9, 2.0, distance)]
    camera = PixelCamera(field_of_view=FOV) if perspective else PixelCamera()
    radius = 24.0 / math.tan(0.5 * FOV) * math.tan(math.asin(0.4 / DISTANCE)) if perspective else 0.4 / 0.02
    mesh = MeshGeometry(
        mesh=tmp_path / "ball.ply",
        origin=ORIGIN,
        lamps=lamps,
        camera=camera,
        pixel=None if perspective else 0.02,
    )
    found = mesh.of(blank(40, 48))
    ball = Sphere(x=24.0, y=20.0, r=radius, lamps=lamps, camera=camera, size=0.4).of(blank(40, 48))
    both = found.mask.values & ball.mask.values
    assert both.sum() > 0.98 * (found.mask.values | ball.mask.values).sum() > 300
    for name, close in (("theta_i", 3e-3), ("theta_r", 3e-3), ("irradiance", 3e-3)):
        if name in ball:
            assert found[name].values[both] == pytest.approx(ball[name].values[both], abs=close)
    for name in ("phi", "rotation"):
        # at the mirror's own normal the two have no direction
        away = both & (np.minimum(ball.theta_i, ball.theta_r).values > 0.15)
        off = found[name].values[away] - ball[name].values[away]
        assert np.abs(np.sin(0.5 * off)).max() < 0.01
    part = mesh.located(blank(40, 48)).pixels(np.arange(7, 30), np.arange(15, 20))
    np.testing.assert_allclose(part.theta_i, found.theta_i.isel(y=slice(15, 20), x=slice(7, 30)), atol=1e-12)


def test_a_plane_is_a_panel(mitsuba, tmp_path):
    """A square on the ground, seen by perspective from 60° above it, with a lamp to the side."""
    corners = np.array([[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]])
    write_ply(tmp_path / "plane.ply", corners, [[0, 1, 2], [0, 2, 3]])
    camera = PixelCamera(field_of_view=FOV)
    theta_r = math.radians(30.0)
    origin = (0.0, -3.0 * math.sin(theta_r), 3.0 * math.cos(theta_r))
    # the lamp in space, and in the camera's axes: x, y = up in the picture, z to the camera
    lamp = unit(np.array([0.5, 0.4, 0.9]))
    z = np.array(origin) / 3.0
    axes = np.stack([np.array([1.0, 0.0, 0.0]), np.cross(z, [1.0, 0.0, 0.0]), z])
    theta_i = math.acos(lamp[2])
    # φ of the viewer from the forward direction, which is away from the lamp
    forward = math.atan2(-lamp[1], -lamp[0])
    phi = (math.atan2(origin[1], origin[0]) - forward) % (2.0 * math.pi)
    mesh = MeshGeometry(
        mesh=tmp_path / "plane.ply",
        origin=origin,
        smooth=False,
        lamps=[Lamp.towards(axes @ lamp, 5.0)],
        camera=camera,
    )
    panel = Panel(theta_i, theta_r, phi, -0.5 * math.pi, camera=camera, distance=3.0, lamp_distance=5.0)
    found, expected = mesh.of(blank(31, 41)), panel.of(blank(31, 41))
    assert found.mask.values.all()
    for name in ("theta_i", "theta_r", "phi", "rotation", "irradiance"):
        np.testing.assert_allclose(found[name], expected[name], atol=2e-5)


def test_a_mesh_casts_its_shadow_on_itself(mitsuba, tmp_path):
    """Two plates over each other with a lamp above: seen from the side, the lower one is dark under the upper."""
    plate = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    both = np.concatenate([2.0 * plate, 0.5 * plate + [0.0, 0.0, 1.5]])
    write_ply(tmp_path / "two.ply", both, np.concatenate([faces, faces + 4]))
    # the camera looks from the right at 45°; straight above is 45° from its axis, upwards
    for lamp, dark in ((Lamp(math.radians(45.0), 0.5 * math.pi), True), (Lamp(0.0), False)):
        mesh = MeshGeometry(
            mesh=tmp_path / "two.ply",
            origin=(6.0, 0.0, 6.0),
            smooth=False,
            lamps=[lamp],
            camera=PixelCamera(field_of_view=FOV),
        )
        geometry = mesh.located(blank(60, 60))
        place = geometry.camera.view(*np.meshgrid(np.arange(60) + 0.5, np.arange(60) + 0.5))
        ray = -place @ geometry._axes
        ground = np.array([6.0, 0.0, 6.0]) - 6.0 * ray / ray[..., 2:]
        upper = np.array([6.0, 0.0, 6.0]) - 4.5 * ray / ray[..., 2:]
        hidden = (np.abs(upper[..., :2]) < 0.5).all(axis=-1)
        under = (np.abs(ground[..., :2]) < 0.45).all(axis=-1) & ~hidden
        beside = (np.abs(ground[..., :2]) < 1.9).all(axis=-1) & (np.abs(ground[..., 1]) > 0.55) & ~hidden
        mask = geometry.pixels(np.arange(60), np.arange(60)).mask.values
        assert under.sum() > 20 and beside.sum() > 100
        assert mask[beside].all()
        assert mask[under].any() != dark


def test_what_cannot_be_is_said(mitsuba, tmp_path):
    lamps = [Lamp(0.3)]
    camera = PixelCamera(field_of_view=FOV)
    (tmp_path / "broken.ply").write_text("ply\nnonsense")
    for make, words in (
        (lambda: MeshGeometry(mesh="a.ply", origin=(0.0, 0.0, 3.0), lamps=lamps, camera=camera), "one line"),
        (lambda: MeshGeometry(mesh="a.ply", origin=ORIGIN, lamps=lamps), "size of a pixel"),
        (
            lambda: MeshGeometry(mesh="a.stl", origin=ORIGIN, lamps=lamps, camera=camera).of(blank(2, 2)),
            ".ply, .obj",
        ),
        (
            lambda: MeshGeometry(mesh="a.ply", origin=ORIGIN, lamps=lamps, camera=camera).of(blank(2, 2)),
            "no such",
        ),
        (
            lambda: MeshGeometry(mesh=tmp_path / "broken.ply", origin=ORIGIN, lamps=lamps, camera=camera).of(
                blank(2, 2)
            ),
            "cannot read",
        ),
    ):
        with pytest.raises(DataError, match=words):
            make()


# from paint to pixels to paint

SIZE = (120, 120)
RADIUS, INTENSITY, AWAY = 0.5, 40.0, 5.0
LAMPS = {
    "right": Lamp(math.radians(50.0), math.radians(20.0), AWAY),
    "left": Lamp(math.radians(75.0), math.radians(160.0), AWAY),
}
IMAGER = Instrument(lcvr(retardance_set("tetrahedron")), Detector(bits=12))
CAMERA = Camera(ORIGIN, (0.0, 0.0, 0.0), math.radians(19.0))


@pytest.fixture(scope="module")
def pictures():
    """A painted ball under two lamps in turn."""
    pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    from pbrdf.rendering.variant import start_mitsuba

    mi = start_mitsuba()
    z = unit(np.array(ORIGIN))
    x = unit(np.cross([0.0, 0.0, 1.0], z))
    axes = np.stack([x, np.cross(z, x), z])
    found = {}
    for name, lamp in LAMPS.items():
        scene = mi.load_dict(
            {
                "type": "scene",
                "sensor": CAMERA.to_dict(*SIZE),
                "ball": {"type": "sphere", "radius": RADIUS, "bsdf": pbrdf.rendering.bsdf_dict(PAINT)},
                "lamp": {
                    "type": "point",
                    "position": (lamp.distance * lamp.direction @ axes).tolist(),
                    "intensity": {"type": "uniform", "value": INTENSITY},
                },
            }
        )
        found[name] = render_stokes(scene, spp=64, depth=2)
    return found


@pytest.fixture(scope="module")
def stokes(pictures, tmp_path_factory):
    """The pictures through a 12-bit camera behind two variable retarders, as ``pbrdf reduce`` writes them."""
    exposure = exposure_for(list(pictures.values()), IMAGER)
    frames = picture_frames(pictures, IMAGER, exposure, seed=3)
    path = tmp_path_factory.mktemp("maps") / "stokes.nc"
    reduce(frames, IMAGER, [MapWriter(path, frames, IMAGER)])
    with xr.open_dataset(path, engine="h5netcdf") as file:
        return file.load(), exposure


def ball(**place):
    return Sphere(
        lamps=tuple(LAMPS.values()),
        camera=PixelCamera(field_of_view=CAMERA.field_of_view),
        size=RADIUS,
        max_zenith=math.radians(72.0),
        **place,
    )


def outline():
    """Radius of the ball in the picture, pixels."""
    focal = 0.5 * SIZE[0] / math.tan(0.5 * CAMERA.field_of_view)
    return focal * math.tan(math.asin(RADIUS / DISTANCE))


@pytest.mark.slow
def test_the_ball_is_found_in_a_rendered_picture(stokes):
    found = ball().located(stokes[0])
    assert (found.x, found.y) == pytest.approx((60.0, 60.0), abs=0.15)
    assert found.r == pytest.approx(outline(), abs=0.25)


@pytest.mark.slow
def test_rendered_pixels_are_the_models_stokes_vectors(pictures):
    """Turned from the picture's axes to (p, s) and divided by the irradiance they are the model's within the render's
    noise and what the curvature over a pixel does; both signs of Q and of U are there to be told apart."""
    names = list(pictures)
    rendered = xr.Dataset(
        {
            name: (("series", "y", "x"), np.stack([pictures[p].stokes[k] for p in names]))
            for k, name in enumerate("IQUV")
        },
        coords={"series": names, "y": np.arange(SIZE[1]), "x": np.arange(SIZE[0])},
    )
    geometry = ball(x=60.0, y=60.0, r=outline())
    found = map_dataset(rendered, geometry, scale=INTENSITY / AWAY**2)
    good = np.isfinite(found.I.values)
    assert good.sum() > 4000
    expected = PAINT.stokes(*(found[n].values[good] for n in ("theta_i", "theta_r", "phi")))
    values = np.stack([found[name].values[good] for name in "IQUV"], axis=-1)
    off = np.abs(values - expected) / expected[:, :1]
    assert np.median(off[:, 0]) < 0.01
    assert np.median(off[:, 1:]) < 0.001
    assert np.quantile(off[:, 1:], 0.98) < 0.012
    for k in (1, 2):
        assert (expected[:, k] / expected[:, 0]).max() > 0.03
        assert (expected[:, k] / expected[:, 0]).min() < -0.03


@pytest.mark.slow
def test_from_paint_to_pixels_to_paint(stokes):
    """Found in the picture, turned, its directions put into bins and fitted: every parameter comes back within five
    standard errors, or within 1 %."""
    pictures, exposure = stokes
    data = map_dataset(pictures, ball(), scale=exposure * INTENSITY / AWAY**2)
    table = as_geometries(data, bins=math.radians(8.0))["sample"]
    pbrdf.validate(table)
    assert 300 < table.sizes["geometry"] < 0.5 * int(np.isfinite(data.I).sum())
    result = pbrdf.fit(table, starts=8)
    for name in ("sigma", "n", "a", "k", "b", "t"):
        estimate, truth = result.estimates[name], PAINT.values[name]
        assert estimate.verdict == "determined"
        assert estimate.value == pytest.approx(truth, abs=max(5.0 * estimate.std, 0.01 * abs(truth))), name
        assert estimate.std < 0.1 * truth
