"""Cameras of a batch, each in its own axes; sensors that are no cameras."""

import math

import numpy as np
import pytest

from pbrdf.errors import PbrdfError
from pbrdf.optics.elements import rotate_frame
from pbrdf.rendering.cameras import camera_scenes
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import load_scene_file
from pbrdf.rendering.virtual_camera import pixel_geometry

COAT = {
    "type": "pplastic",
    "alpha": 0.1,
    "int_ior": 1.6,
    "diffuse_reflectance": {"type": "uniform", "value": 0.2},
}


def camera(mi, origin, roll=0.0, **more):
    """A camera that looks at the origin, its up turned by `roll` degrees."""
    view = mi.ScalarTransform4f().look_at(list(origin), [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    return {
        "type": "perspective",
        "fov": 20.0,
        "to_world": view @ mi.ScalarTransform4f().rotate([0, 0, 1], roll),
        **more,
    }


def film(columns, rows, **more):
    return {
        "type": "hdrfilm",
        "width": columns,
        "height": rows,
        "pixel_format": "luminance",
        "rfilter": {"type": "box"},
        **more,
    }


def scene(mi, **sensor):
    return mi.load_dict(
        {
            "type": "scene",
            **sensor,
            "ball": {"type": "sphere", "radius": 0.4, "bsdf": COAT, "id": "ball"},
            "wall": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0.0, 0.0, -0.5]),
                "bsdf": COAT,
            },
            "lamp": {"type": "point", "position": [1.5, -3.0, 2.0]},
            "window": {
                "type": "sphere",
                "center": [-3.0, 0.0, 2.0],
                "radius": 0.5,
                "emitter": {"type": "area"},
            },
            "sky": {"type": "constant", "radiance": {"type": "uniform", "value": 0.1}},
        }
    )


PLACES = {
    "front": ((0.0, -3.0, 1.0), 0.0),
    "rolled": ((0.0, -3.0, 1.0), 40.0),
    "side": ((2.5, -1.0, 2.0), -15.0),
}


@pytest.mark.slow
def test_each_camera_of_a_batch_has_its_own_axes(mitsuba):
    """Side by side as in the batch's film, and the same as the cameras one by one, whose horizontals differ."""
    cameras = {name: camera(mitsuba, *place) for name, place in PLACES.items()}
    together = render_stokes(
        scene(mitsuba, batch={"type": "batch", "film": film(36, 12), **cameras}), spp=256, depth=3
    )
    assert together.shape == together.surface.shape == (12, 36)
    for i, one in enumerate(cameras.values()):
        alone = render_stokes(scene(mitsuba, one={**one, "film": film(12, 12)}), spp=256, depth=3, seed=9)
        part = np.s_[..., 12 * i : 12 * (i + 1)]
        error = np.hypot(together.std[part], alone.std)[1:3]
        seen = error.min(axis=0) > 0.0
        turned = np.einsum("ij,jrc->irc", rotate_frame(0.25), alone.stokes)
        right, wrong = (
            np.sqrt(
                np.mean(
                    np.minimum(np.abs(together.stokes[part] - other)[1:3, seen] / error[:, seen], 5.0) ** 2
                )
            )
            for other in (alone.stokes, turned)
        )
        # in standard errors, of the picture and of one in axes turned by 14°
        assert right < 1.3 < 2.5 < wrong
        assert (together.surface[part] == alone.surface).all()


@pytest.mark.slow
def test_a_camera_that_is_rolled_sees_the_angle_turned_the_other_way(mitsuba):
    """Light behind a polariser at 20° by the horizon is at 20° − 30° for a camera rolled counterclockwise by 30°."""
    T = mitsuba.ScalarTransform4f
    sheet = T().rotate([1, 0, 0], 90.0) @ T().rotate([0, 0, 1], 20.0) @ T().scale(5.0)
    # a look_at's z is the line of sight, about which a positive angle is clockwise for who looks along it
    views = {f"view{i}": camera(mitsuba, (0.0, -3.0, 0.0), -roll) for i, roll in enumerate((0.0, 30.0))}
    stage = mitsuba.load_dict(
        {
            "type": "scene",
            "batch": {"type": "batch", "film": film(2, 1), **views},
            "sheet": {"type": "rectangle", "to_world": sheet, "bsdf": {"type": "polarizer"}},
            "lamp": {"type": "constant"},
        }
    )
    assert np.rad2deg(render_stokes(stage, spp=16).aolp[0]) == pytest.approx([20.0, -10.0], abs=0.5)


@pytest.mark.slow
def test_progress_counts_the_passes_of_all_cameras(mitsuba):
    calls = []
    cameras = {name: camera(mitsuba, *place) for name, place in PLACES.items()}
    batch = {"type": "batch", "film": film(12, 4), **cameras}
    render_stokes(scene(mitsuba, batch=batch), spp=40, progress=lambda *call: calls.append(call))
    total = calls[0][1]
    assert calls == [(i, total) for i in range(total + 1)]


@pytest.mark.slow
def test_geometry_of_a_batch_is_that_of_its_cameras(mitsuba):
    cameras = {name: camera(mitsuba, *place) for name, place in PLACES.items()}
    lamp = (1.5, -3.0, 2.0)
    together = pixel_geometry(scene(mitsuba, batch={"type": "batch", "film": film(30, 10), **cameras}), lamp)
    for i, one in enumerate(cameras.values()):
        alone = pixel_geometry(scene(mitsuba, one={**one, "film": film(10, 10)}), lamp)
        part = np.s_[:, 10 * i : 10 * (i + 1)]
        for name in ("theta_i", "theta_r", "phi", "plane_angle", "distance"):
            np.testing.assert_allclose(getattr(together, name)[part], getattr(alone, name), atol=1e-5)
        assert (together.shape[part] == alone.shape).all()
        assert "ball" in alone.shape


BATCH = """<scene version="3.0.0">
  <sensor type="batch">
    <sensor type="perspective"><film type="hdrfilm"/>
      <transform name="to_world"><lookat origin="0, -3, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
    <sensor type="perspective">
      <transform name="to_world"><lookat origin="0, -3, 0" target="0, 0, 0" up="1, 0, 1"/></transform></sensor>
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/></film>
  </sensor>
  <shape type="sphere"><bsdf type="diffuse" id="paint"/></shape>
  <emitter type="point"><point name="position" value="1, -3, 1"/></emitter>
</scene>"""


@pytest.mark.slow
def test_instances_of_a_group_are_seen_by_every_camera_of_a_batch(mitsuba):
    views = [camera(mitsuba, origin, film=film(12, 12)) for origin in ((0.0, -3.0, 1.0), (2.0, -2.0, 1.5))]
    rest = {
        "group": {"type": "shapegroup", "ball": {"type": "sphere", "radius": 0.4, "bsdf": COAT}},
        "instance": {"type": "instance", "of": {"type": "ref", "id": "group"}},
        "lamp": {"type": "point", "position": [1.5, -3.0, 2.0]},
    }
    batch = {"type": "batch", "one": views[0], "two": views[1], "film": film(24, 12)}
    both = render_stokes(mitsuba.load_dict({"type": "scene", "eyes": batch, **rest}), spp=64, depth=2).stokes
    for i, view in enumerate(views):
        alone = render_stokes(
            mitsuba.load_dict({"type": "scene", "eye": view, **rest}), spp=64, depth=2
        ).stokes
        seen = both[:, :, 12 * i : 12 * (i + 1)]
        np.testing.assert_allclose(seen.sum(axis=(1, 2)), alone.sum(axis=(1, 2)), atol=0.02 * alone[0].sum())


@pytest.mark.slow
def test_a_scene_file_with_a_batch(mitsuba, tmp_path):
    file = tmp_path / "batch.xml"
    file.write_text(BATCH)
    first, second = np.split(render_stokes(load_scene_file(file, [COAT]), spp=64, depth=2).stokes, 2, axis=-1)
    assert first.shape == (4, 8, 6)
    # the second camera is the first, rolled clockwise by 45°: angles are 45° larger in its picture, its Q is −U of the
    # first, its U is Q; the four pixels in the middle of both cover nearly the same piece of the sphere
    middle = np.s_[:, 3:5, 2:4]
    a, b = first[middle].mean((1, 2)), second[middle].mean((1, 2))
    assert b[0] == pytest.approx(a[0], rel=0.05)
    assert (b[1], b[2]) == pytest.approx((-a[2], a[1]), abs=0.1 * math.hypot(a[1], a[2]))
    larger = load_scene_file(file, [COAT], (16, 4))
    assert render_stokes(larger, spp=4, depth=2).shape == (4, 16)


@pytest.mark.parametrize("kind", ["perspective", "thinlens", "orthographic", "radiancemeter"])
def test_cameras_of_all_kinds_show_the_radiance(mitsuba, kind):
    """1 in even light of radiance 1."""
    lens = {"aperture_radius": 0.01, "focus_distance": 3.0} if kind == "thinlens" else {}
    size = (1, 1) if kind == "radiancemeter" else (4, 3)
    one = {**camera(mitsuba, (0.0, -3.0, 0.0)), **lens, "type": kind, "film": film(*size)}
    if kind in ("orthographic", "radiancemeter"):
        del one["fov"]
    stage = mitsuba.load_dict({"type": "scene", "camera": one, "sky": {"type": "constant"}})
    assert render_stokes(stage, spp=4).stokes[0] == pytest.approx(1.0, rel=1e-6)


def test_an_irradiance_meter_is_refused(mitsuba):
    """Mitsuba's S0 of one is the irradiance over π, and light from a hemisphere has no common horizontal."""
    meter = {
        "type": "rectangle",
        "sensor": {"type": "irradiancemeter", "film": film(1, 1)},
    }
    sky = {"type": "constant"}
    for sensor in ({"plate": meter}, {"batch": {"type": "batch", "film": film(2, 1), "plate": meter}}):
        stage = mitsuba.load_dict({"type": "scene", "sky": sky, **sensor})
        with pytest.raises(
            PbrdfError, match=r"IrradianceMeter weights its rays by 3\.14159.* give the scene a camera"
        ):
            render_stokes(stage)


def test_scenes_without_a_camera_and_cropped_batches_are_refused(mitsuba):
    with pytest.raises(PbrdfError, match="no camera"):
        camera_scenes(mitsuba.load_dict({"type": "scene", "sky": {"type": "constant"}}))
    cropped = film(8, 4, crop_width=4, crop_height=4)
    batch = {"type": "batch", "film": cropped, "one": camera(mitsuba, (0.0, -3.0, 0.0))}
    with pytest.raises(PbrdfError, match="leave the film's crop out"):
        render_stokes(scene(mitsuba, batch=batch))


@pytest.mark.slow
def test_a_sensor_with_a_spectral_response_is_refused():
    """Its wavelengths are drawn by the response, Mitsuba's Stokes vectors suppose that they are not."""
    mi = pytest.importorskip("mitsuba")
    from pbrdf.rendering.variant import start_mitsuba

    start_mitsuba("llvm_ad_spectral_polarized")
    plain = camera(mi, (0.0, -3.0, 0.0), film=film(2, 2))
    for more, refused in (({}, False), ({"srf": {"type": "uniform", "value": 0.5}}, True)):
        stage = scene(mi, one={**plain, **more})
        if refused:
            with pytest.raises(PbrdfError, match="no response of its own"):
                camera_scenes(stage)
        else:
            assert camera_scenes(stage) == [stage]
    start_mitsuba()
