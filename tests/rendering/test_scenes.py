"""Scenes with their lights, and scenes of other people's."""

import math

import numpy as np
import pytest
from scene_helpers import sees

import pbrdf
import pbrdf.rendering
from pbrdf.errors import PbrdfError
from pbrdf.rendering.lights import light_dict
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera, load_scene_file, make_scene, subject

COAT = {
    "type": "pplastic",
    "alpha": 0.1,
    "int_ior": 1.6,
    "diffuse_reflectance": {"type": "uniform", "value": 0.2},
}
PAINT = pbrdf.DoubleGauss(sigma=0.08, n=1.6, a=0.3, k=1.1, b=0.2, t=0.6)


@pytest.fixture
def environment(mitsuba, tmp_path):
    """A picture in latitude and longitude: light from the upper half alone, brighter on one side."""
    picture = np.zeros((16, 32, 3), dtype=np.float32)
    picture[:8] = 0.3
    picture[:8, 8:16] = 1.0
    file = tmp_path / "environment.exr"
    mitsuba.Bitmap(picture).write(str(file))
    return file


@pytest.mark.parametrize("light", ["point", "area", "sky", "constant", "envmap"])
@pytest.mark.parametrize("name", ["sphere", "plate"])
def test_every_scene_is_lit_by_every_light(mitsuba, environment, name, light):
    scene = make_scene(
        subject(name, [COAT]), f"envmap:{environment}" if light == "envmap" else light, (24, 24)
    )
    picture = render_stokes(scene, spp=16, depth=4)
    assert np.isfinite(picture.stokes).all()
    assert (picture.stokes[0] > 0.0).mean() > 0.5
    # no light is more than fully polarised
    assert (np.hypot(picture.stokes[1], picture.stokes[2]) <= picture.stokes[0] * (1.0 + 1e-5) + 1e-9).all()
    assert np.hypot(picture.stokes[1], picture.stokes[2]).max() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_the_fender_is_painted_piece_by_piece(mitsuba, count):
    what = subject("fender", [{**COAT, "alpha": 0.05 * (i + 1)} for i in range(count)], 1.5)
    assert sorted(name for name in what.entries if name.startswith("body")) == [
        f"body{i + 1}" for i in range(count)
    ]
    picture = render_stokes(make_scene(what, "sky", (36, 24)), spp=16, depth=4)
    assert np.isfinite(picture.stokes).all()
    assert np.hypot(picture.stokes[1], picture.stokes[2]).max() > 0.05 * picture.stokes[0].max()


def test_models_stand_side_by_side_from_left_to_right(mitsuba):
    """The first model is on the left of the picture: there a black ball, on the right a white one."""
    coats = [{"type": "diffuse", "reflectance": {"type": "uniform", "value": v}} for v in (0.0, 0.9)]
    picture = render_stokes(make_scene(subject("sphere", coats), "constant", (40, 40)), spp=32, depth=2)
    rows = slice(18, 23)
    assert picture.stokes[0][rows, 8:14].max() < 1e-3
    assert np.median(picture.stokes[0][rows, 26:32]) > 0.1


@pytest.mark.parametrize("name", ["sphere", "plate"])
@pytest.mark.parametrize("aspect", [0.6, 1.0, 2.0])
def test_what_is_painted_fits_into_the_picture(mitsuba, name, aspect):
    """Black paint on all objects of the row: none is cut off by the picture's edge (the fender is, on purpose)."""
    coats = [{"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}] * 2
    size = (round(60 * aspect), 60) if aspect < 1.0 else (60, round(60 / aspect))
    what = subject(name, coats, aspect)
    picture = render_stokes(make_scene(what, "constant", size), spp=32, depth=2)
    black = picture.stokes[0] < 0.02
    assert black.mean() > 0.05
    # the ground and the light beyond are at every edge
    assert not (black[0].any() or black[-1].any() or black[:, 0].any() or black[:, -1].any())


def test_a_lamp_gives_the_irradiance_1_to_a_surface_that_faces_it(mitsuba):
    """A white plate in the scene's middle that faces the lamp shows the radiance 1/π, and so it does in the constant
    light. Parts of an area light are a little farther away and seen at an angle: its irradiance is that much less."""
    zenith, azimuth = math.radians(40.0), math.radians(200.0)
    s = math.sin(zenith)
    to_lamp = [s * math.cos(azimuth), s * math.sin(azimuth), math.cos(zenith)]
    T = mitsuba.ScalarTransform4f
    plate = {
        "type": "disk",
        "to_world": T().look_at([0.0, 0.0, 0.0], to_lamp, [0.0, 1.0, 0.0]) @ T().scale(0.05),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 1.0}},
    }
    camera = Camera((0.0, -1.0, 0.5), (0.0, 0.0, 0.0), math.radians(1.0))
    # the lamp is 5 extents away, and a square of a quarter of that
    u, v = np.meshgrid(*[(np.arange(100) - 49.5) / 100 * 0.25] * 2)
    square = np.mean((1.0 + u**2 + v**2) ** -2)
    for name, irradiance in (("point", 1.0), ("area", square), ("constant", 1.0)):
        lamp = light_dict(name, zenith=zenith, azimuth=azimuth, extent=1.0)
        picture = sees({"plate": plate, "lamp": lamp}, camera, (8, 8), spp=1024, depth=2)
        error = math.sqrt(np.mean(picture.std[0] ** 2)) / 8.0
        assert math.pi * picture.stokes[0].mean() == pytest.approx(irradiance, abs=5.0 * error + 1e-3)
        assert error < 5e-3


def test_an_environment_map_stands_upright(mitsuba, environment):
    """The upper half of the picture is above the horizon."""
    lamp = light_dict(f"envmap:{environment}", zenith=0.0, azimuth=0.0)
    for target, bright in (((0.0, 0.0, 1.0), True), ((0.0, 1.0, 0.5), True), ((0.0, 1.0, -0.5), False)):
        camera = Camera((0.0, -0.01, 0.0), target, math.radians(5.0))
        assert (sees({"lamp": lamp}, camera, (2, 2)).stokes[0].min() > 0.1) == bright


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ("moon", "choose one of point, area"),
        ("envmap:missing.exr", r"there is no file missing\.exr"),
    ],
)
def test_unknown_lights_are_refused(mitsuba, light, message):
    with pytest.raises(PbrdfError, match=message):
        light_dict(light, zenith=0.0, azimuth=0.0)


def test_an_environment_map_of_another_kind_is_refused(mitsuba, tmp_path):
    (tmp_path / "notes.txt").write_text("no picture")
    with pytest.raises(PbrdfError, match="an environment map is one of"):
        light_dict(f"envmap:{tmp_path / 'notes.txt'}", zenith=0.0, azimuth=0.0)


def test_unknown_scenes_and_too_many_models_are_refused(mitsuba):
    with pytest.raises(PbrdfError, match="choose sphere, plate, fender"):
        subject("teapot", [COAT])
    with pytest.raises(PbrdfError, match="1 to 12 models, not 13"):
        subject("sphere", [COAT] * 13)
    with pytest.raises(PbrdfError, match="1 to 12 models, not 0"):
        subject("plate", [])


SCENE = """<scene version="3.0.0">
  <sensor type="perspective">
    <float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="0, -3, 0" target="0, 0, 0" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/>
      <string name="pixel_format" value="luminance"/></film>
  </sensor>
  <bsdf type="diffuse" id="paint"/>
  <shape type="sphere"><float name="radius" value="0.5"/><ref id="paint"/></shape>
  <emitter type="point"><point name="position" value="1, -3, 1"/></emitter>
</scene>"""


def test_a_scene_file_is_painted_with_the_model(mitsuba, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(SCENE)
    scene = load_scene_file(file, [pbrdf.rendering.bsdf_dict(PAINT)])
    picture = render_stokes(scene, spp=64, depth=2)
    assert picture.shape == (8, 12)
    # the model's own polarisation, not that of the diffuse material which stood in its place
    assert np.hypot(picture.stokes[1], picture.stokes[2]).max() > 0.01 * picture.stokes[0].max()
    larger = load_scene_file(file, [pbrdf.rendering.bsdf_dict(PAINT)], (24, 16))
    assert render_stokes(larger, spp=4, depth=2).shape == (16, 24)


def test_a_scene_file_may_ask_for_several_models(mitsuba, tmp_path):
    """paint1 goes to the first model, paint2 to the second, wherever they stand in the file."""
    two = SCENE.replace(
        '<bsdf type="diffuse" id="paint"/>',
        '<bsdf type="diffuse" id="paint2"/><bsdf type="diffuse" id="paint1"/>',
    ).replace(
        '<ref id="paint"/></shape>',
        '<point name="center" x="-0.6" y="0" z="0"/><ref id="paint1"/></shape>'
        '<shape type="sphere"><float name="radius" value="0.5"/><point name="center" x="0.6" y="0" z="0"/>'
        '<ref id="paint2"/></shape>',
    )
    file = tmp_path / "two.xml"
    file.write_text(two)
    coats = [{"type": "diffuse", "reflectance": {"type": "uniform", "value": v}} for v in (0.0, 0.9)]
    stokes = render_stokes(load_scene_file(file, coats, (24, 16)), spp=16, depth=2).stokes[0]
    assert stokes[:, :10].max() < 1e-6 < stokes[:, 14:].max()


@pytest.mark.parametrize(
    ("change", "coats", "message"),
    [
        (lambda s: s, 2, "2 models for the BSDFs of this scene"),
        (lambda s: s.replace('id="paint"', 'id="grey"'), 1, "none|Mitsuba cannot read this scene"),
        (lambda s: s[: s.index("<sensor")] + s[s.index("</sensor>") + 9 :], 1, "no camera"),
        (lambda s: s.replace("</scene>", ""), 1, "Mitsuba cannot read this scene"),
        (lambda s: s.replace('type="point"', 'type="lantern"'), 1, "Mitsuba cannot read this scene"),
        (
            lambda s: s.replace('type="point"', 'type="pbrdf_polarized"'),
            1,
            "Mitsuba cannot read this scene: pbrdf_polarized: ",
        ),
    ],
)
def test_scene_files_that_cannot_be_used_are_refused(mitsuba, tmp_path, change, coats, message):
    file = tmp_path / "scene.xml"
    file.write_text(change(SCENE))
    with pytest.raises(PbrdfError, match=message) as error:
        load_scene_file(file, [COAT] * coats)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_scene_file_is_named(mitsuba, tmp_path):
    with pytest.raises(PbrdfError, match=r"nothing\.xml"):
        load_scene_file(tmp_path / "nothing.xml", [COAT])
