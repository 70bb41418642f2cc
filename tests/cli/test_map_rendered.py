"""From paint to pixels to paint with rendered frames: a painted ball under three lamps, through ``pbrdf map``."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import pbrdf
import pbrdf.rendering
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera
from pbrdf.rendering.variant import start_mitsuba
from pbrdf.rendering.virtual_camera import exposure_for, picture_frames

pytestmark = pytest.mark.slow

PAINT = pbrdf.DoubleGauss(sigma=0.12, n=1.6, a=0.4, k=1.2, b=0.3, t=0.6)
FIELD = 21.0
CAMERA = Camera((0.0, -3.0, 0.4), (0.0, 0.0, 0.0), math.radians(FIELD))
SIZE = (96, 96)
RADIUS, INTENSITY = 0.5, 10.0
#: Equally far from the ball, so that one exposure means one irradiance.
FAR = 4.0
LAMPS = {
    name: tuple(FAR * np.array(place) / np.linalg.norm(place))
    for name, place in {
        "right": (2.0, -3.0, 1.5),
        "left": (-3.5, -1.5, 0.8),
        "above": (0.4, -1.8, 3.0),
    }.items()
}
IMAGER = Instrument(lcvr(retardance_set("tetrahedron")), Detector(bits=12))


def light(place):
    """``POLAR@AZIMUTH`` of a lamp, worked out from the camera's place alone."""
    back = np.subtract(CAMERA.origin, CAMERA.target)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    towards = np.array(place) / np.linalg.norm(place)
    polar = math.degrees(math.acos(towards @ back))
    azimuth = math.degrees(math.atan2(towards @ np.cross(back, right), towards @ right))
    return f"{polar:.6f}@{azimuth:.6f}"


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Stokes pictures of the reduced frames, and digital numbers of a BRDF · cosθ_i of 1/sr."""
    pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    mi = start_mitsuba()
    rendered = {}
    for name, place in LAMPS.items():
        lamp = {
            "type": "point",
            "position": list(place),
            "intensity": {"type": "uniform", "value": INTENSITY},
        }
        ball = {"type": "sphere", "radius": RADIUS, "bsdf": pbrdf.rendering.bsdf_dict(PAINT)}
        scene = mi.load_dict({"type": "scene", "sensor": CAMERA.to_dict(*SIZE), "ball": ball, "lamp": lamp})
        rendered[name] = render_stokes(scene, spp=64, depth=2)
    exposure = exposure_for(list(rendered.values()), IMAGER)
    frames = picture_frames(rendered, IMAGER, exposure, seed=3)
    path = tmp_path_factory.mktemp("ball") / "stokes.nc"
    pbrdf.reduce(frames, IMAGER, [MapWriter(path, frames, IMAGER)])
    return path, exposure * INTENSITY / FAR**2


@pytest.mark.parametrize(("mode", "close"), [("found in the picture", 0.05), ("a mesh", 0.02)])
def test_a_rendered_ball_gives_its_paint_back(run, tmp_path, pictures, mode, close):
    """Every parameter within five standard errors, or what the middle of a pixel standing for all of it costs, and an
    outline that is found to a tenth of a pixel."""
    path, scale = pictures
    lights = f"light={';'.join(map(light, LAMPS.values()))},lamp={FAR},max=70"
    geometry = f"sphere:{lights},fov={FIELD},size={RADIUS}"
    if mode == "a mesh":
        write_ball(tmp_path / "ball.ply")
        geometry = f"mesh:ball.ply,camera=0/-3/0.4,target=0/0/0,up=0/0/1,{lights},fov={FIELD}"
    shared = [word for name in ("sigma", "n", "k", "b", "t") for word in ("--share", name)]
    run(
        "map", path, "-g", geometry, "--counts-per-brdf", scale, *shared, "--starts", 16, "-o", "ball.zarr",
        "--no-figures",
    )  # fmt: skip
    with xr.open_zarr(tmp_path / "ball.zarr", consolidated=False) as opened:
        found = opened.load()
    good = found["status"].values == 0
    assert good.sum() > 2000
    for name in ("sigma", "n", "k", "b", "t"):
        one = found.sel(parameter=name)
        value, error = float(one["estimate"].values[good][0]), float(one["standard_error"].values[good][0])
        truth = PAINT.values[name]
        assert value == pytest.approx(truth, abs=max(5.0 * error, close * truth)), name
        assert error < 0.1 * truth, name
    a = found.sel(parameter="a")["estimate"].values[good]
    assert np.median(a) == pytest.approx(PAINT.values["a"], rel=0.02)


def write_ball(path, rows=181, columns=361):
    """A ball of triangles, its normals those of a ball."""
    theta, phi = np.meshgrid(
        np.linspace(0.0, np.pi, rows), np.linspace(0.0, 2.0 * np.pi, columns), indexing="ij"
    )
    normals = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    ).reshape(-1, 3)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (corner.ravel() for corner in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(normals)}\n"
        + "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
        + f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with path.open("w", encoding="ascii") as file:
        file.write(head)
        np.savetxt(file, np.concatenate([RADIUS * normals, normals], axis=1), fmt="%.7f")
        np.savetxt(file, np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1), fmt="%d")
