"""Lamps behind polarisers: axes and signs in words, against flat mirrors and against Mitsuba's own sheets."""

import math

import numpy as np
import pytest
from scene_helpers import sees

from pbrdf.errors import PbrdfError
from pbrdf.instruments.polarimeter.polarimeter import rotating_retarder
from pbrdf.rendering.lights import light_dict
from pbrdf.rendering.polarized_lamp import LampPolarization, polarized_dict
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera

DEG = math.radians(1.0)
ZENITH = math.atan(1.5)
#: Towards the lamp, which is 5 extents away, and to where a level plate mirrors it.
TO_LAMP = np.array([math.sin(ZENITH), 0.0, math.cos(ZENITH)])
MIRRORED = Camera((-2.0 * TO_LAMP[0], 0.0, 2.0 * TO_LAMP[2]), (0.0, 0.0, 0.0), 0.1 * DEG)
INTO_LAMP = Camera((0.0, 0.0, 0.0), tuple(5.0 * TO_LAMP), 0.1 * DEG)


def number(value):
    return {"type": "uniform", "value": value}


def lamp(*degrees, name="area"):
    before = LampPolarization(*(a * DEG for a in degrees)) if degrees else None
    return {"lamp": light_dict(name, zenith=ZENITH, azimuth=0.0, polarization=before)}


def plate(bsdf):
    return {"plate": {"type": "disk", "bsdf": bsdf}}


def sheet(mi, turn, distance, bsdf):
    """A sheet before the lamp, turned counterclockwise for an observer who looks into the lamp (degrees)."""
    T = mi.ScalarTransform4f
    place = T().look_at(list(distance * TO_LAMP), [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    return {
        "type": "rectangle",
        "to_world": place @ T().rotate([0, 0, 1], turn) @ T().scale(0.9),
        "bsdf": bsdf,
    }


def middle(picture):
    return picture.stokes[:, 0, 0]


@pytest.mark.parametrize(
    ("degrees", "q", "u", "v"),
    [
        ((0.0,), 1.0, 0.0, 0.0),
        ((45.0,), 0.0, 1.0, 0.0),
        ((90.0,), -1.0, 0.0, 0.0),
        ((45.0, 0.0, 90.0), 0.0, 0.0, 1.0),
        ((0.0, -45.0, 90.0), 0.0, 0.0, 1.0),
        ((0.0, 45.0, 90.0), 0.0, 0.0, -1.0),
    ],
)
def test_who_looks_into_the_lamp_sees_what_was_asked_for(mitsuba, degrees, q, u, v):
    """0° is level, 45° rises to the right. Light along 45° whose level component is ahead by 90° turns
    counterclockwise for the observer, left circular, V > 0: a level fast axis behind a polariser at 45°."""
    bare, stokes = (middle(sees(lamp(*d), INTO_LAMP)) for d in ((), degrees))
    assert stokes[0] == pytest.approx(0.5 * bare[0], rel=1e-5)
    assert stokes[1:] / stokes[0] == pytest.approx([q, u, v], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("retardance", [30.0, 90.0, 180.0])
def test_one_angle_means_one_sense_for_polariser_and_retarder(mitsuba, retardance):
    """Light that a polariser at 30° has passed lies along the fast axis of a retarder at 30°, which then does nothing:
    in the lamp, in the picture's view through a polariser, and in an instrument before it. Mitsuba's own `polarizer`
    and `retarder` turn by their `theta` in opposite senses: there the retarder at −30° does nothing, and it is the
    polariser whose `theta` is the reverse of our angle, as seen against the light."""
    with_plate, without = (sees(lamp(*d), INTO_LAMP) for d in ((30.0, 30.0, retardance), (30.0,)))
    assert middle(with_plate) == pytest.approx(middle(without), rel=1e-5)
    assert without.through_polarizer(30.0 * DEG)[0, 0] == pytest.approx(without.stokes[0, 0, 0], rel=1e-5)
    assert without.through_polarizer(120.0 * DEG)[0, 0] == pytest.approx(0.0, abs=1e-5)

    instrument = rotating_retarder(30.0 * DEG, retardance * DEG, analyzer=30.0 * DEG)
    assert instrument.intensities(without.stokes)[0, 0, 0] == pytest.approx(without.stokes[0, 0, 0], rel=1e-5)

    def behind_sheets(polarizer, retarder):
        first = {"type": "polarizer", "theta": number(polarizer)}
        second = {"type": "retarder", "theta": number(retarder), "delta": number(retardance)}
        sheets = {"first": sheet(mitsuba, 0.0, 4.5, first), "second": sheet(mitsuba, 0.0, 4.0, second)}
        return middle(sees({**lamp(), **sheets}, INTO_LAMP))

    assert behind_sheets(-30.0, 30.0) == pytest.approx(middle(without), rel=2e-3, abs=2e-3)
    wrong = behind_sheets(30.0, 30.0)
    assert abs(wrong[1:] - middle(without)[1:]).max() > 0.2 * wrong[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["point", "area"])
def test_a_plate_that_scatters_gets_half_the_light(mitsuba, name):
    white = plate({"type": "diffuse", "reflectance": number(1.0)})
    bare, stokes = (
        middle(sees({**white, **lamp(*degrees, name=name)}, MIRRORED, spp=4096, depth=2))
        for degrees in ((), (20.0,))
    )
    assert stokes[0] == pytest.approx(0.5 * bare[0], rel=1e-3)
    assert stokes[1:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-5)


@pytest.mark.slow
def test_at_brewsters_angle_light_in_the_plane_of_incidence_is_not_reflected(mitsuba):
    glass = plate({"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
    across, along = (
        middle(sees({**glass, **lamp(angle)}, MIRRORED, spp=1 << 16, depth=2)) for angle in (0.0, 90.0)
    )
    radiance = middle(sees(lamp(), INTO_LAMP))[0]
    r_s = ((1.0 - 1.5**2) / (1.0 + 1.5**2)) ** 2
    assert across[0] == pytest.approx(0.5 * r_s * radiance, rel=0.03)
    assert across[1] == pytest.approx(across[0], rel=1e-3)
    assert abs(along).max() < 1e-3 * across[0]


@pytest.mark.parametrize("degrees", [(30.0,), (0.0, -45.0, 90.0), (20.0, 70.0, 50.0)])
def test_its_image_in_a_metal_is_the_fresnel_reflection(mitsuba, degrees):
    """All four components. x of lamp and picture is −s, y is p, so that Q and U change their signs between (x, y) and
    (p, s); with the index n − iκ M34 = −Im(r_p r_s*)."""
    n, kappa = 0.8, 2.2
    metal = plate({"type": "conductor", "eta": number(n), "k": number(kappa)})
    found = middle(sees({**metal, **lamp(*degrees)}, MIRRORED, depth=2))
    c, index = math.cos(ZENITH), n - 1j * kappa
    below = np.sqrt(1.0 - (math.sin(ZENITH) / index) ** 2)
    r_p, r_s = (index * c - below) / (index * c + below), (c - index * below) / (c + index * below)
    mean, half = 0.5 * (abs(r_p) ** 2 + abs(r_s) ** 2), 0.5 * (abs(r_p) ** 2 - abs(r_s) ** 2)
    both = r_p * np.conj(r_s)
    reflection = np.array(
        [
            [mean, half, 0.0, 0.0],
            [half, mean, 0.0, 0.0],
            [0.0, 0.0, both.real, -both.imag],
            [0.0, 0.0, both.imag, both.real],
        ]
    )
    to_ps = np.diag([1.0, -1.0, -1.0, 1.0])
    radiance = middle(sees(lamp(), INTO_LAMP))[0]
    light = LampPolarization(*(a * DEG for a in degrees)).stokes
    expected = radiance * to_ps @ reflection @ to_ps @ light
    assert found == pytest.approx(expected, abs=2e-3 * expected[0])


@pytest.mark.slow
def test_its_light_goes_on_through_sheets(mitsuba):
    """On a rough metal: polarised as it leaves the lamp and then retarded by a sheet, as by both before the lamp."""
    rough = plate({"type": "roughconductor", "alpha": 0.1, "eta": number(0.8), "k": number(2.2)})
    quarter = {"sheet": sheet(mitsuba, 0.0, 3.0, {"type": "retarder", "delta": number(90.0)})}
    point = {"name": "point"}
    one = sees({**rough, **lamp(45.0, 0.0, 90.0, **point)}, MIRRORED, spp=256, depth=2)
    two = sees({**rough, **lamp(45.0, **point), **quarter}, MIRRORED, spp=256, depth=2)
    assert abs(middle(one)[3]) > 0.1 * middle(one)[0]
    assert middle(two) == pytest.approx(middle(one), abs=5e-3 * middle(one)[0])


@pytest.mark.slow
def test_every_wavelength_of_a_spectral_variant_is_polarised_alike():
    pytest.importorskip("mitsuba")
    from pbrdf.rendering.variant import start_mitsuba

    start_mitsuba("llvm_ad_spectral_polarized")
    stokes = middle(sees(lamp(30.0, 60.0, 40.0), INTO_LAMP, spp=64))
    start_mitsuba()
    expected = LampPolarization(30.0 * DEG, 60.0 * DEG, 40.0 * DEG).stokes
    assert stokes / stokes[0] == pytest.approx(expected / expected[0], abs=1e-4)


def test_another_angle_is_not_another_kernel(mitsuba):
    import drjit as dr

    def compiled(angle):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            scene = mitsuba.load_dict(
                {"type": "scene", "sensor": MIRRORED.to_dict(3, 3), **lamp(angle, name="point"),
                 **plate({"type": "diffuse"})}
            )  # fmt: skip
            render_stokes(scene, spp=2, depth=2)
            return {k["hash"] for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT}

    first, second = compiled(11.0), compiled(67.0)
    assert second <= first


@pytest.mark.parametrize("light", ["sky", "constant", "envmap:any.exr"])
def test_only_a_lamp_has_a_polariser_before_it(mitsuba, light):
    with pytest.raises(PbrdfError, match="only a lamp, point or area"):
        light_dict(light, zenith=0.5, azimuth=0.0, polarization=LampPolarization(0.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: {**d, "lamp": {"type": "constant"}}, "light from all around"),
        (lambda d: {k: v for k, v in d.items() if k != "lamp"}, "it takes one emitter, not 0"),
        (lambda d: {k: v for k, v in d.items() if k != "polarizer"}, "give the angle of its polarizer"),
        (lambda d: {**d, "theta": 3.0}, "theta"),
    ],
)
def test_a_plugin_that_is_described_wrongly_is_refused(mitsuba, change, message):
    entry = polarized_dict({"type": "point"}, LampPolarization(0.0), mitsuba.ScalarTransform4f())
    with pytest.raises(RuntimeError, match=message):
        mitsuba.load_dict(change(entry))


def test_an_angle_that_is_none_is_refused():
    with pytest.raises(PbrdfError, match="retardance is nan"):
        LampPolarization(0.0, 0.0, math.nan)
