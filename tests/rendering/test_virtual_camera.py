"""A polarimeter before a rendered scene: geometry of the pixels, frames, and the way from paint to pixels to paint."""

import math

import numpy as np
import pytest
from scene_helpers import pixel_axes, unit

import pbrdf
import pbrdf.rendering
from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.stokes_image import reduce_frames
from pbrdf.optics.elements import rotate_frame
from pbrdf.rendering.picture import StokesPicture
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera
from pbrdf.rendering.variant import start_mitsuba
from pbrdf.rendering.virtual_camera import exposure_for, picture_frames, pixel_dataset, pixel_geometry

pytestmark = pytest.mark.slow

PAINT = pbrdf.DoubleGauss(sigma=0.12, n=1.6, a=0.4, k=1.2, b=0.3, t=0.6)
CAMERA = Camera((0.0, -3.0, 0.4), (0.0, 0.0, 0.0), math.radians(21.0))
SIZE = (48, 48)
RADIUS, INTENSITY = 0.5, 10.0
LAMPS = {"right": (2.0, -3.0, 1.5), "left": (-3.5, -1.0, 0.8)}
IMAGER = Instrument(lcvr(retardance_set("tetrahedron")), Detector(bits=12))


def ball(mi, lamp):
    return mi.load_dict(
        {
            "type": "scene",
            "sensor": CAMERA.to_dict(*SIZE),
            "ball": {"type": "sphere", "radius": RADIUS, "bsdf": pbrdf.rendering.bsdf_dict(PAINT)},
            "lamp": {
                "type": "point",
                "position": lamp,
                "intensity": {"type": "uniform", "value": INTENSITY},
            },
        }
    )


@pytest.fixture(scope="module")
def measured():
    """Pictures and geometry by lamp."""
    pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    mi = start_mitsuba()
    scenes = {name: ball(mi, list(lamp)) for name, lamp in LAMPS.items()}
    pictures = {name: render_stokes(scene, spp=144, depth=2) for name, scene in scenes.items()}
    return pictures, {name: pixel_geometry(scene, LAMPS[name]) for name, scene in scenes.items()}


def test_geometry_of_the_pixels_is_that_of_a_sphere(mitsuba):
    lamp = np.array(LAMPS["left"])
    found = pixel_geometry(ball(mitsuba, lamp.tolist()), lamp)
    d, x, y = pixel_axes(CAMERA, *SIZE)
    origin = np.array(CAMERA.origin)
    along = -(d @ origin)
    depth = along**2 - (origin @ origin - RADIUS**2)
    hit = depth > 0.0
    point = origin + (along - np.sqrt(np.maximum(depth, 0.0)))[..., None] * d
    normal = unit(point)
    to_lamp = lamp - point
    light, view = unit(to_lamp), -d
    lit = hit & ((normal * light).sum(-1) > 1e-3)
    seen = np.isfinite(found.theta_i)
    assert (seen & lit).sum() > 0.98 * (seen | lit).sum()
    both = seen & lit
    assert np.cos(found.theta_i)[both] == pytest.approx((normal * light).sum(-1)[both], abs=1e-5)
    assert np.cos(found.theta_r)[both] == pytest.approx((normal * view).sum(-1)[both], abs=1e-5)
    assert found.distance[both] == pytest.approx(np.linalg.norm(to_lamp, axis=-1)[both], rel=1e-5)
    # the scattering angle holds the azimuth: cos ω = −light · view
    i, r, phi = found.theta_i[both], found.theta_r[both], found.phi[both]
    scattering = np.sin(i) * np.sin(r) * np.cos(phi) - np.cos(i) * np.cos(r)
    assert scattering == pytest.approx(-(light * view).sum(-1)[both], abs=1e-5)
    # p lies in the plane of the normal and the ray
    c, s = np.cos(found.plane_angle)[..., None], np.sin(found.plane_angle)[..., None]
    p = (c * x + s * y)[both]
    across = np.cross(normal, view)[both]
    assert np.abs((p * across).sum(-1)).max() < 1e-4
    assert set(np.unique(found.shape)) == {"", "ball"}


def test_the_plane_of_view_runs_through_the_middle_of_a_ball(mitsuba):
    """Seen from afar, the surface's p direction points towards (or away from) the middle of a ball: on its right side
    it is level (0° or 180°), at its top upright (±90°)."""
    found = pixel_geometry(ball(mitsuba, [0.0, -3.0, 0.5]), (0.0, -3.0, 0.5))
    middle = SIZE[1] // 2
    columns = np.flatnonzero(np.isfinite(found.plane_angle[middle]))
    assert abs(math.sin(found.plane_angle[middle, columns[-2]])) < 0.15
    rows = np.flatnonzero(np.isfinite(found.plane_angle[:, middle]))
    assert abs(math.cos(found.plane_angle[rows[1], middle])) < 0.15


def test_a_shadow_is_not_lit(mitsuba):
    """Behind a screen between lamp and ball no pixel has a geometry."""
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "sensor": CAMERA.to_dict(*SIZE),
            "ball": {"type": "sphere", "radius": RADIUS},
            "screen": {"type": "sphere", "radius": 0.6, "center": [0.0, -1.0, 5.0]},
        }
    )
    assert np.isnan(pixel_geometry(scene, (0.0, -1.0, 6.0)).theta_i).all()
    assert np.isfinite(pixel_geometry(scene, (0.0, -1.0, 3.0)).theta_i).any()


def test_rendered_pixels_are_the_models_stokes_vectors(measured):
    """Turned from the picture's axes to (p, s) and divided by the irradiance they are the model's, signs included."""
    pictures, geometries = measured
    for name, picture in pictures.items():
        g = geometries[name]
        inside = (g.theta_i < math.radians(70.0)) & (g.theta_r < math.radians(70.0))
        scale = INTENSITY * np.cos(g.theta_i[inside]) / g.distance[inside] ** 2
        turned = np.einsum("pij,jp->pi", rotate_frame(g.plane_angle[inside]), picture.stokes[:, inside])
        expected = PAINT.stokes(g.theta_i[inside], g.theta_r[inside], g.phi[inside])
        # the middle of a pixel stands for its average, but for the curvature over a pixel
        off = np.abs(turned / scale[:, None] - expected) / expected[:, :1]
        assert np.median(off[:, 0]) < 0.005
        assert np.quantile(off[:, 1:], 0.98) < 0.01
        assert np.median(off[:, 1:]) < 0.001
        # both signs of Q and of U are there to be told apart
        for k in (1, 2):
            assert (expected[:, k] / expected[:, 0]).max() > 0.03
            assert (expected[:, k] / expected[:, 0]).min() < -0.03


def test_from_paint_to_pixels_to_paint(measured):
    """A painted ball under two lamps, seen by a 12-bit camera behind two variable retarders, reduced and fitted.

    Every parameter comes back within five standard errors, or within 2 %: the middle of a pixel stands for what the
    pixel sees, and the path tracer leaves some noise that the stated errors do not know of.
    """
    pictures, geometries = measured
    exposure = exposure_for(list(pictures.values()), IMAGER)
    frames = picture_frames(pictures, IMAGER, exposure, seed=3)
    assert frames.states == 4
    datasets = []
    for i, name in enumerate(frames.names):
        image = reduce_frames(frames.read(i, 0, frames.rows), IMAGER.polarimeter, IMAGER.detector)
        assert image.counts()["saturated"] == 0
        datasets.append(
            pixel_dataset(
                image,
                geometries[name],
                exposure=exposure,
                intensity=INTENSITY,
                shape="ball",
                max_zenith=math.radians(72.0),
                every=2,
            )
        )
    import xarray as xr

    both = xr.concat(datasets, dim="geometry", data_vars="minimal", combine_attrs="override")
    assert both.sizes["geometry"] > 300
    result = pbrdf.fit(both, starts=8)
    for name in ("sigma", "n", "a", "k", "b", "t"):
        estimate, truth = result.estimates[name], PAINT.values[name]
        assert estimate.verdict == "determined"
        assert estimate.value == pytest.approx(truth, abs=max(5.0 * estimate.std, 0.02 * truth)), name
        # and it was measured well enough for that to mean something
        assert estimate.std < 0.1 * truth


def test_a_division_of_focal_plane_sees_the_same_light(mitsuba):
    """Each pixel behind its own polariser: cells of 2 × 2 pixels give I, Q, U of an even picture, and no V."""
    polarimeter = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))
    camera = Instrument(polarimeter, Detector(bits=16, gain=1e3, read_noise=0.0))
    stokes = np.broadcast_to(np.array([1.0, 0.3, -0.2, 0.1])[:, None, None], (4, 8, 12)).copy()
    picture = StokesPicture(stokes, np.zeros_like(stokes))
    exposure = exposure_for([picture], camera)
    frames = picture_frames({"one": picture}, camera, exposure)
    assert (frames.rows, frames.columns) == (4, 6)
    image = reduce_frames(frames.read(0, 0, 4), polarimeter, camera.detector)
    assert np.nanmean(image.stokes[:3], axis=(1, 2)) / exposure == pytest.approx([1.0, 0.3, -0.2], abs=2e-3)
    assert np.isnan(image.stokes[3]).all()


def test_the_exposure_fills_the_range(measured):
    pictures, _ = measured
    exposure = exposure_for(list(pictures.values()), IMAGER, 0.5)
    frames = picture_frames(pictures, IMAGER, exposure, seed=1)
    highest = max(frames.read(i, 0, frames.rows).max() for i in range(2))
    assert highest == pytest.approx(0.5 * 4095, rel=0.1)


def test_what_does_not_fit_together_is_refused(measured):
    pictures, geometries = measured
    dark = StokesPicture(np.zeros((4, 2, 2)), np.zeros((4, 2, 2)))
    with pytest.raises(DataError, match="pictures are dark"):
        exposure_for([dark], IMAGER)
    with pytest.raises(DataError, match="pictures of one size"):
        picture_frames({"a": dark, "b": pictures["left"]}, IMAGER, 1.0)
    frames = picture_frames({"a": dark}, IMAGER, 1.0)
    image = reduce_frames(frames.read(0, 0, 2), IMAGER.polarimeter, IMAGER.detector)
    with pytest.raises(DataError, match=r"the frames have \(2, 2\) pixels"):
        pixel_dataset(image, geometries["left"], exposure=1.0, intensity=1.0)
    frames = picture_frames(pictures, IMAGER, 100.0)
    image = reduce_frames(frames.read(0, 0, SIZE[1]), IMAGER.polarimeter, IMAGER.detector)
    with pytest.raises(DataError, match="no pixel sees the surface"):
        pixel_dataset(image, geometries["left"], exposure=1.0, intensity=1.0, shape="teapot")
