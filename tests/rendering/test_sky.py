"""The polarised sky: its closed form, what a camera sees of it, and its mirror images."""

import math

import numpy as np
import pytest
from scene_helpers import pixel_axes, sees, unit

from pbrdf.errors import PbrdfError
from pbrdf.rendering.scenes import Camera
from pbrdf.rendering.sky import Sky, direction_of

DEG = math.radians(1.0)


def frame(d):
    """Some axes (x, y) with x × y = −d."""
    other = np.where(np.abs(d[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = unit(np.cross(d, other))
    return x, np.cross(-d, x)


def hemisphere(count=20_000, seed=1):
    z = np.random.default_rng(seed).uniform(1e-3, 1.0, count)
    phi = np.random.default_rng(seed + 1).uniform(0.0, 2.0 * np.pi, count)
    s = np.sqrt(1.0 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], -1)


def closed_form(d, x, y, sky):
    """Stokes vectors of single Rayleigh scattering, with the textbook's angles; written apart from the package."""
    sun = np.array(
        [
            math.sin(sky.sun_zenith) * math.cos(sky.sun_azimuth),
            math.sin(sky.sun_zenith) * math.sin(sky.sun_azimuth),
            math.cos(sky.sun_zenith),
        ]
    )
    gamma = np.arccos(np.clip(d @ sun, -1.0, 1.0))
    # depolarisation factor of Hansen and Travis from the largest degree of polarisation, then their matrix
    delta = (1.0 - sky.max_dolp) / (1.0 + sky.max_dolp)
    share = (1.0 - delta) / (1.0 + 0.5 * delta)
    p11 = share * 0.75 * (1.0 + np.cos(gamma) ** 2) + (1.0 - share)
    p12 = share * 0.75 * np.sin(gamma) ** 2
    mu, mu0, tau = d[..., 2], math.cos(sky.sun_zenith), sky.optical_depth
    path = mu0 / (mu0 - mu) * (np.exp(-tau / mu0) - np.exp(-tau / mu)) / (4.0 * np.pi)
    across = unit(np.cross(d, sun))
    psi = np.arctan2((across * y).sum(-1), (across * x).sum(-1))
    stokes = [p11, p12 * np.cos(2.0 * psi), p12 * np.sin(2.0 * psi), 0.0 * p11]
    return np.where((mu > 0.0)[..., None], np.stack(stokes, -1) * path[..., None], 0.0)


@pytest.mark.parametrize("max_dolp", [0.0, 0.6, 0.94, 1.0])
def test_the_sky_is_the_closed_form_of_single_rayleigh_scattering(max_dolp):
    sky = Sky(40.0 * DEG, 250.0 * DEG, optical_depth=0.3, max_dolp=max_dolp)
    d = hemisphere()
    x, y = frame(d)
    expected = closed_form(d, x, y, sky)
    assert np.abs(sky.stokes(d, x, y) - expected).max() < 1e-10 * expected[:, 0].max()


def test_the_radiance_is_smooth_at_the_height_of_the_sun():
    """At the sun's height 0/0 stands in the formula; its limit is L = p/4π · (τ/μ0) e^{−τ/μ0}."""
    sky = Sky(50.0 * DEG, 0.0, optical_depth=0.4, max_dolp=0.0)
    around = np.array([direction_of(50.0 * DEG + e, math.pi) for e in (-1e-4, -1e-9, 0.0, 1e-9, 1e-4)])
    radiance = sky.stokes(around, *frame(around))[:, 0]
    depth = 0.4 / math.cos(50.0 * DEG)
    assert radiance == pytest.approx(depth * math.exp(-depth) / (4.0 * math.pi), rel=2e-4)
    assert radiance[1:4] == pytest.approx(radiance[2], rel=1e-8)


def test_thin_air_sends_half_of_what_it_scatters_down():
    """Of the sun's light a thin layer scatters τ per unit area, whatever the sun's height, half of it downwards."""
    for zenith in (0.0, 60.0 * DEG):
        tau = 1e-6
        sky = Sky(zenith, 0.0, optical_depth=tau)
        mu, phi = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(240) + 0.5) * math.pi / 120)
        s = np.sqrt(1.0 - mu**2)
        d = np.stack([s * np.cos(phi), s * np.sin(phi), mu], -1)
        irradiance = 2.0 * math.pi * (sky.stokes(d, *frame(d))[..., 0] * mu).mean()
        assert irradiance == pytest.approx(0.5 * tau, rel=1e-3)


def test_a_camera_that_looks_at_the_sky_sees_it(mitsuba):
    sky = Sky(50.0 * DEG, 60.0 * DEG, optical_depth=0.2, max_dolp=0.85)
    camera = Camera((1.0, 2.0, 3.0), (1.5, 3.0, 3.6), 100.0 * DEG)
    from pbrdf.rendering.sky_emitter import sky_dict

    size = (41, 31)
    d, x, y = pixel_axes(camera, *size)
    expected = np.moveaxis(closed_form(d, x, y, sky), -1, 0)
    picture = sees({"sky": sky_dict(sky, 10.0)}, camera, size, spp=256, depth=2)
    # the middle of a pixel stands for its average where the sky changes little across it
    smooth = (d[..., 2] > 0.25) & (d @ np.array(sky.sun) < math.cos(5.0 * DEG))
    assert smooth.mean() > 0.4
    off = np.abs(picture.stokes - expected) - 5.0 * picture.std
    assert off[:, smooth].max() < 1e-3 * expected[0, smooth].max()
    dolp = picture.dolp[smooth]
    gamma = np.arccos(d @ np.array(sky.sun))[smooth]
    assert dolp == pytest.approx(0.85 * np.sin(gamma) ** 2 / (1.0 + 0.85 * np.cos(gamma) ** 2), abs=5e-3)


def test_the_polarisation_runs_around_the_sun(mitsuba):
    """In a picture with the sun in its middle the field is tangential: right of the sun it is upright, above the sun
    level, and up to the right it falls to the right (AoLP −45°)."""
    sky = Sky(45.0 * DEG, 90.0 * DEG)
    camera = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 1.0), 16.0 * DEG)
    from pbrdf.rendering.sky_emitter import sky_dict

    picture = sees({"sky": sky_dict(sky, 1.0)}, camera, (21, 21), spp=64, depth=2)
    angle = np.rad2deg(picture.aolp)
    assert abs(angle[10, 20]) == pytest.approx(90.0, abs=1.0)
    assert abs(angle[10, 0]) == pytest.approx(90.0, abs=1.0)
    assert angle[0, 10] == pytest.approx(0.0, abs=1.0)
    assert angle[0, 20] == pytest.approx(-45.0, abs=1.0)
    assert angle[20, 20] == pytest.approx(45.0, abs=1.0)


def test_under_a_high_sun_the_horizon_is_polarised_level_and_most(mitsuba):
    sky = Sky(0.0, 0.0, max_dolp=0.7)
    from pbrdf.rendering.sky_emitter import sky_dict

    for azimuth in (0.0, 1.0, 4.0):
        target = (math.cos(azimuth), math.sin(azimuth), 0.02)
        picture = sees({"sky": sky_dict(sky, 1.0)}, Camera((0.0, 0.0, 0.0), target, 1.0 * DEG), spp=64)
        assert picture.dolp[0, 0] == pytest.approx(0.7, abs=2e-3)
        assert picture.aolp[0, 0] == pytest.approx(0.0, abs=1e-3)


def test_sun_and_sky_light_a_plate_with_their_irradiance(mitsuba):
    """A white diffuse plate shows irradiance/π: sun (1 above the air, weakened on its way) and sky add up."""
    from pbrdf.rendering.sky_emitter import sky_dict

    sky = Sky(55.0 * DEG, 10.0 * DEG, optical_depth=0.5, sun_radius=1.0 * DEG)
    plate = {"type": "disk", "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 1.0}}}
    camera = Camera((0.0, -0.3, 1.0), (0.0, 0.0, 0.0), 5.0 * DEG)
    picture = sees({"plate": plate, "sky": sky_dict(sky, 10.0)}, camera, (32, 32), spp=512, depth=2)
    mu, phi = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(240) + 0.5) * math.pi / 120)
    s = np.sqrt(1.0 - mu**2)
    d = np.stack([s * np.cos(phi), s * np.sin(phi), mu], -1)
    from_sky = 2.0 * math.pi * (closed_form(d, *frame(d), sky)[..., 0] * mu).mean()
    cosine = math.cos(55.0 * DEG)
    from_sun = math.exp(-0.5 / cosine) * cosine
    assert math.pi * picture.stokes[0].mean() == pytest.approx(from_sky + from_sun, rel=2e-3)


@pytest.mark.parametrize("material", ["dielectric", "conductor"])
def test_the_sky_mirrored_in_a_smooth_plate_is_its_fresnel_reflection(mitsuba, material, jit, plain):
    """Every component: of a metal also V, whose sign is this project's (left circular positive)."""
    from pbrdf.optics.fresnel import mueller_reflection
    from pbrdf.rendering.sky_emitter import sky_dict

    sky = Sky(62.0 * DEG, 25.0 * DEG, max_dolp=0.9)
    n, kappa = (1.5, None) if material == "dielectric" else (0.8, 2.2)
    bsdf = {"type": "dielectric", "int_ior": n, "ext_ior": 1.0}
    if material == "conductor":
        bsdf = {
            "type": "conductor",
            "eta": {"type": "uniform", "value": n},
            "k": {"type": "uniform", "value": kappa},
        }
    camera = Camera((0.0, -2.0, 1.3), (0.1, 0.0, 0.0), 20.0 * DEG)
    size = (9, 9)
    picture = sees(
        {"plate": {"type": "disk", "to_world": mitsuba.ScalarTransform4f().scale(5.0), "bsdf": bsdf},
         "sky": sky_dict(sky, 10.0)},
        camera, size, spp=16_384, depth=2,
    )  # fmt: skip
    d, x, _ = pixel_axes(camera, *size)
    up = np.array([0.0, 0.0, 1.0])
    mirrored = d - 2.0 * d[..., 2:] * up
    # light falls in along −mirrored and leaves along −d; s = k × ẑ, p = s × k for both
    s_in = unit(np.cross(-mirrored, up))
    p_in = np.cross(s_in, -mirrored)
    falling = closed_form(mirrored, p_in, s_in, sky)
    r = mueller_reflection(jit(-d[..., 2].ravel()), n, kappa)
    zero = np.zeros(d.shape[:2])
    mean, difference, real = (plain(v, zero.size).reshape(zero.shape) for v in r[:3])
    imaginary = zero if r.imaginary is None else plain(r.imaginary, zero.size).reshape(zero.shape)
    I, Q, U, V = np.moveaxis(falling, -1, 0)  # noqa: E741
    reflected = [
        mean * I + difference * Q,
        difference * I + mean * Q,
        real * U - imaginary * V,
        imaginary * U + real * V,
    ]
    s_out = unit(np.cross(-d, up))
    p_out = np.cross(s_out, -d)
    a = np.arctan2((x * s_out).sum(-1), (x * p_out).sum(-1))
    c, s = np.cos(2.0 * a), np.sin(2.0 * a)
    expected = np.stack(
        [
            reflected[0],
            c * reflected[1] + s * reflected[2],
            -s * reflected[1] + c * reflected[2],
            reflected[3],
        ]
    )
    assert (np.abs(picture.stokes - expected) - 5.0 * picture.std).max() < 1e-3 * expected[0].max()
    assert np.median(picture.std[0]) < 0.05 * expected[0].max()
    if kappa is not None:
        assert np.abs(expected[3]).max() > 0.1 * expected[0].max()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"sun_zenith": 89.0 * DEG}, "sun zenith is 89°"),
        ({"max_dolp": 1.2}, "max dolp is 1.2"),
        ({"optical_depth": -0.1}, "optical depth is -0.1"),
        ({"sun_radius": float("nan")}, "sun radius is nan"),
    ],
)
def test_a_sky_that_cannot_be_is_refused(changes, named):
    with pytest.raises(PbrdfError, match=named):
        Sky(**changes)
