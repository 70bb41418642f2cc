"""Rendered pictures: axes and signs in words, polarisers, standard errors, passes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scene_helpers import sees

from pbrdf.errors import BackendError, PbrdfError
from pbrdf.rendering.render import _has_sheets, _pass_sizes, render_stokes
from pbrdf.rendering.scenes import Camera, make_scene, subject
from pbrdf.rendering.variant import start_mitsuba

DEG = math.radians(1.0)
CAMERA = Camera((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), 10.0 * DEG)
#: One of Mitsuba's own materials: what is tested here is the picture, not the paint.
COAT = {
    "type": "pplastic",
    "alpha": 0.1,
    "int_ior": 1.6,
    "diffuse_reflectance": {"type": "uniform", "value": 0.2},
}


def sheet(mi, y, turn, bsdf):
    """A sheet across the camera's view, turned counterclockwise as the camera sees it (degrees)."""
    T = mi.ScalarTransform4f
    place = (
        T().translate([0.0, y, 0.0])
        @ T().rotate([1, 0, 0], 90.0)
        @ T().rotate([0, 0, 1], turn)
        @ T().scale(0.9)
    )
    return {"type": "rectangle", "to_world": place, "bsdf": bsdf}


def number(value):
    return {"type": "uniform", "value": value}


LAMP = {"lamp": {"type": "constant"}}


def middle(picture):
    rows, columns = picture.shape
    return picture.stokes[:, rows // 2, columns // 2]


@pytest.mark.parametrize(
    ("turn", "q", "u"), [(0.0, 1.0, 0.0), (45.0, 0.0, 1.0), (90.0, -1.0, 0.0), (135.0, 0.0, -1.0)]
)
def test_the_light_behind_a_polariser_is_polarised_along_its_axis(mitsuba, turn, q, u):
    """A level axis gives Q > 0; an axis turned counterclockwise from there by 45°, as the camera sees it, U > 0."""
    stokes = middle(sees({**LAMP, "sheet": sheet(mitsuba, 0.0, turn, {"type": "polarizer"})}, CAMERA))
    assert stokes[1:] / stokes[0] == pytest.approx([q, u, 0.0], abs=2e-3)


@pytest.mark.parametrize(("fast", "v"), [(0.0, 1.0), (90.0, -1.0)])
def test_v_is_positive_for_left_circular_light(mitsuba, fast, v):
    """Light polarised at +45° meets a quarter-wave plate. If its fast axis is level, the level component is ahead by
    90°: when the field is upright it is about to turn to the left, counterclockwise for the camera. That is left
    circular light, V > 0. With the fast axis upright it is the reverse."""
    sheets = {
        "polarizer": sheet(mitsuba, 0.0, 45.0, {"type": "polarizer"}),
        "plate": sheet(mitsuba, -1.0, fast, {"type": "retarder", "delta": number(90.0)}),
    }
    stokes = middle(sees({**LAMP, **sheets}, CAMERA, depth=6))
    assert stokes[1:] / stokes[0] == pytest.approx([0.0, 0.0, v], abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 30.0, 75.0, 120.0])
def test_the_view_through_a_polariser_is_that_of_a_sheet_before_the_camera(mitsuba, angle):
    """½ (S0 + S1 cos2α + S2 sin2α) of the picture without a polariser, against a rendered one with Mitsuba's own sheet.

    The sheet is turned, not given Mitsuba's `theta`, which turns clockwise as seen from in front.
    """
    ball = {
        "lamp": {"type": "point", "position": [1.5, -3.0, 2.0], "intensity": number(10.0)},
        "ball": {"type": "sphere", "radius": 0.2, "bsdf": COAT},
    }
    size = (24, 24)
    plain = sees(ball, CAMERA, size, spp=256, depth=2)
    behind = sees(
        {**ball, "sheet": sheet(mitsuba, -2.5, angle, {"type": "polarizer"})}, CAMERA, size, spp=256, depth=3
    )
    expected = plain.through_polarizer(angle * DEG)
    error = np.hypot(behind.std[0], np.sqrt((plain.std**2).sum(0)))
    assert behind.stokes[0].max() > 0.02
    assert np.abs(behind.stokes[0] - expected).max() < 1e-3 * expected.max() + 5.0 * error.max()
    # the comparison could tell another angle
    wrong = plain.through_polarizer((angle + 20.0) * DEG)
    assert np.abs(behind.stokes[0] - wrong).max() > 0.01 * expected.max()


def test_angles_that_differ_by_half_a_turn_are_the_same_polariser(mitsuba):
    picture = sees({**LAMP, "sheet": sheet(mitsuba, 0.0, 20.0, {"type": "polarizer"})}, CAMERA)
    assert picture.through_polarizer(0.3) == pytest.approx(picture.through_polarizer(0.3 + math.pi))
    assert picture.through_polarizer(20.0 * DEG) == pytest.approx(picture.stokes[0], rel=1e-3)


def behind_sheets(mi, bsdf, turn=None):
    """A level plate, seen at Brewster's angle of n = 1.5, where it mirrors a lamp behind a polariser that is turned
    counterclockwise for an observer who looks into the lamp; irradiance across the light 1 without it."""
    zenith = math.atan(1.5)
    toward = np.array([math.sin(zenith), 0.0, math.cos(zenith)])
    T = mi.ScalarTransform4f
    place = T().look_at(list(1.5 * toward), [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    entries = {
        "plate": {"type": "rectangle", "bsdf": bsdf},
        "lamp": {"type": "point", "position": list(3.0 * toward), "intensity": number(9.0)},
    }
    if turn is not None:
        place = place @ T().rotate([0, 0, 1], turn) @ T().scale(2.0)
        entries["sheet"] = {"type": "rectangle", "to_world": place, "bsdf": {"type": "polarizer"}}
    camera = Camera((-3.0 * toward[0], 0.0, 3.0 * toward[2]), (0.0, 0.0, 0.0), 0.1 * DEG)
    return middle(sees(entries, camera, spp=64, depth=2))


def test_a_lamp_behind_a_polariser_lights_a_plate_with_half_its_irradiance(mitsuba):
    """Mitsuba's `path` shows it black."""
    white = {"type": "diffuse", "reflectance": number(1.0)}
    radiance = math.cos(math.atan(1.5)) / math.pi
    assert behind_sheets(mitsuba, white)[0] == pytest.approx(radiance, rel=1e-3)
    for turn in (0.0, 25.0):
        assert behind_sheets(mitsuba, white, turn) == pytest.approx(
            [0.5 * radiance, 0, 0, 0], abs=1e-3 * radiance
        )


@pytest.mark.slow
def test_its_light_is_polarised_where_it_falls(mitsuba):
    """A coating at Brewster's angle sends back what is polarised across the plane of incidence alone: all that the bare
    lamp's light gives, and nothing of light in that plane."""
    coating = {"type": "pplastic", "alpha": 0.05, "int_ior": 1.5, "diffuse_reflectance": number(0.0)}
    bare, level, upright, between = (
        behind_sheets(mitsuba, coating, turn) for turn in (None, 0.0, 90.0, 30.0)
    )
    assert level == pytest.approx(bare, rel=1e-2, abs=1e-2 * bare[0])
    assert abs(upright).max() < 1e-3 * bare[0]
    assert between[0] == pytest.approx(math.cos(30.0 * DEG) ** 2 * level[0], rel=1e-2)


@pytest.mark.parametrize(
    ("bsdf", "straight"),
    [
        ({"type": "polarizer"}, True),
        ({"type": "retarder"}, True),
        ({"type": "circular"}, True),
        ({"type": "null"}, True),
        ({"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}}, True),
        ({"type": "thindielectric"}, True),
        ({"type": "dielectric"}, False),
        ({"type": "twosided", "bsdf": COAT}, False),
    ],
)
def test_sheets_that_light_passes_straight_are_told_from_others(mitsuba, bsdf, straight):
    """The others need no search for lamps behind them, which takes longer."""
    shapes = {"ball": {"type": "sphere", "bsdf": COAT}, "sheet": {"type": "rectangle", "bsdf": bsdf}}
    assert _has_sheets(mitsuba.load_dict({"type": "scene", **shapes})) == straight


@pytest.mark.slow
def test_a_lamp_behind_a_polariser_of_a_group_lights_as_behind_one_of_its_own(mitsuba):
    """Shapes of a group are not among those of the scene; a polariser takes half of natural light."""
    place = mitsuba.ScalarTransform4f
    floor = {"type": "rectangle", "bsdf": {"type": "diffuse"}}
    sheet = {
        "type": "rectangle",
        "to_world": place().translate([0.0, 2.0, 2.0]).scale(5.0),
        "bsdf": {"type": "polarizer"},
    }
    group = {"type": "shapegroup", "sheet": sheet}
    instance = {"type": "instance", "of": {"type": "ref", "id": "group"}}
    lamp = {"type": "point", "position": [0.0, 2.0, 3.0]}
    camera = {
        "type": "perspective",
        "fov": 10.0,
        "to_world": place().look_at([0.0, -1.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        "film": {"type": "hdrfilm", "width": 6, "height": 6, "pixel_format": "luminance"},
    }

    def seen(**more):
        scene = mitsuba.load_dict({"type": "scene", "floor": floor, "lamp": lamp, "camera": camera, **more})
        return render_stokes(scene, spp=64, depth=2).stokes[0].mean()

    behind_one = seen(sheet=sheet)
    assert behind_one == pytest.approx(0.5 * seen(), rel=1e-3)
    assert seen(group=group, instance=instance) == pytest.approx(behind_one, rel=1e-3)


@pytest.mark.slow
def test_standard_errors_are_those_of_independent_pictures(mitsuba):
    """Pictures with other seeds scatter by the stated standard errors, in every component."""
    what = subject("sphere", [COAT])
    scene = make_scene(what, "sky", (32, 32))
    first, second = (render_stokes(scene, spp=64, seed=seed) for seed in (1, 2))
    error = np.hypot(first.std, second.std)
    seen = (error[0] > 1e-3 * first.stokes[0]) & (error[1:3] > 0.0).all(axis=0)
    pull = (first.stokes - second.stokes)[:3, seen] / error[:3, seen]
    # sixteen passes give a standard error to 18 %, hence the slightly wider pulls than 1
    assert 0.9 < np.sqrt(np.mean(np.minimum(np.abs(pull), 5.0) ** 2)) < 1.25
    assert np.abs(np.mean(pull, axis=1)).max() < 0.15


@pytest.mark.slow
def test_standard_errors_fall_with_the_root_of_the_samples(mitsuba):
    scene = make_scene(subject("sphere", [COAT]), "constant", (32, 32))
    few, many = (render_stokes(scene, spp=spp, seed=3) for spp in (32, 512))
    lit = few.std[0] > 0.0
    assert np.sqrt(np.mean(few.std[0, lit] ** 2) / np.mean(many.std[0, lit] ** 2)) == pytest.approx(
        4.0, rel=0.15
    )


def test_the_same_seed_gives_the_same_picture(mitsuba):
    scene = make_scene(subject("plate", [COAT]), "point", (16, 16))
    a, b, c = (render_stokes(scene, spp=8, seed=seed) for seed in (5, 5, 6))
    assert (a.stokes == b.stokes).all()
    assert (a.stokes != c.stokes).any()


def test_one_pass_tells_no_errors(mitsuba):
    scene = make_scene(subject("plate", [COAT]), "constant", (4, 4))
    assert np.isnan(render_stokes(scene, spp=1).std).all()


@pytest.mark.slow
def test_a_spectral_variant_gives_the_luminance():
    """Of grey things in even light the luminance is what one wavelength gives."""
    found = {}
    for variant in ("llvm_ad_mono_polarized", "llvm_ad_spectral_polarized"):
        pytest.importorskip("mitsuba")
        start_mitsuba(variant)
        scene = make_scene(subject("sphere", [COAT]), "point", (8, 8))
        found[variant] = render_stokes(scene, spp=512, depth=2)
    start_mitsuba()
    mono, spectral = found.values()
    error = np.hypot(mono.std, spectral.std)
    assert np.abs(mono.stokes - spectral.stokes).max() < 0.02 * mono.stokes[0].max() + 5.0 * error.max()
    assert np.abs(spectral.stokes[1]).max() > 0.0


def test_progress_counts_the_passes(mitsuba):
    scene = make_scene(subject("plate", [COAT]), "constant", (4, 4))
    calls = []
    render_stokes(scene, spp=40, progress=lambda *call: calls.append(call))
    total = calls[0][1]
    assert calls == [(i, total) for i in range(total + 1)]


@given(spp=st.integers(4, 5000), pixels=st.integers(1, 1 << 24))
def test_passes_take_all_samples_and_are_small(spp, pixels):
    sizes = _pass_sizes(spp, pixels)
    assert sum(sizes) == spp
    assert max(sizes) * pixels <= max(1 << 22, pixels)
    assert min(sizes) * pixels >= 4
    assert spp < 16 or len(sizes) >= min(8, spp * pixels // 8)


@pytest.mark.parametrize("numbers", [{"spp": 0}, {"depth": 0}, {"depth": -2}, {"seed": -1}])
def test_numbers_out_of_range_are_refused(mitsuba, numbers):
    scene = make_scene(subject("plate", [COAT]), "constant", (4, 4))
    with pytest.raises(PbrdfError, match="use 1 or more"):
        render_stokes(scene, **numbers)


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "scalar_spectral_polarized", "nonsense"])
def test_a_variant_without_polarisation_is_refused(mitsuba, variant):
    with pytest.raises(BackendError, match="llvm_ad_mono_polarized"):
        start_mitsuba(variant)


def test_pixels_of_surfaces_are_told_from_those_of_the_sky(mitsuba):
    """A sphere on a ground of finite size: the upper edge of the picture is sky, the middle is not."""
    picture = render_stokes(make_scene(subject("sphere", [COAT]), "sky", (24, 24)), spp=4, depth=2)
    assert picture.surface.shape == picture.shape
    assert not picture.surface[0].any() and picture.surface[12:].all()
