"""The average over a region and its covariance."""

import math

import numpy as np
import pytest

from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.region_averages import RegionSum
from pbrdf.instruments.reduction.stokes_image import PixelFlag, StokesImage, reduce_frames


def image_of(stokes, flags=None, covariance=None):
    stokes = np.array(stokes, dtype=float)
    shape = stokes.shape[1:]
    if covariance is None:
        covariance = np.broadcast_to(np.eye(4).reshape(4, 4, *[1] * len(shape)), (4, 4, *shape)).copy()
    return StokesImage(stokes, covariance, np.zeros(shape, np.uint8) if flags is None else flags)


PLAIN = Instrument(lcvr(retardance_set("tetrahedron")), Detector())


def average(image, mask=None, instrument=PLAIN):
    total = RegionSum()
    total.add(image, mask)
    return total.average(instrument)


@pytest.mark.parametrize("poison", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("flag", [PixelFlag.SATURATED, PixelFlag.DEAD, PixelFlag.DARK])
def test_masked_pixels_never_enter(poison, flag):
    """Whatever a masked pixel holds, mean, covariance and scatter are those of the good pixels alone."""
    draw = np.random.default_rng(6)
    stokes = draw.normal(1000.0, 10.0, (4, 12, 15))
    flags = np.where(draw.random((12, 15)) < 0.3, np.uint8(flag), np.uint8(0))
    covariance = np.einsum("ab,yx->abyx", np.eye(4), draw.uniform(1.0, 2.0, (12, 15)))
    good = flags == 0
    expected = average(image_of(stokes[:, good], covariance=covariance[:, :, good]))
    stokes[:, ~good] = poison
    covariance[:, :, ~good] = poison
    found = average(image_of(stokes, flags, covariance))
    np.testing.assert_allclose(found.stokes, stokes[:, good].mean(axis=1), rtol=1e-13)
    np.testing.assert_array_equal(found.stokes, expected.stokes)
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    np.testing.assert_allclose(found.scatter, stokes[:, good].std(axis=1, ddof=1), rtol=1e-9)
    assert found.pixels == 180
    assert found.counts["good"] == good.sum()
    assert found.counts[flag.name.lower()] == 180 - good.sum()


def test_saturated_pixels_of_frames_never_enter():
    """Through the whole reduction: pixels driven into saturation leave the mean of the others as it was."""
    detector = Detector(bits=12, gain=3.0, read_noise=5.0)
    polarimeter = rotating_polarizer(np.deg2rad([0.0, 45.0, 90.0, 135.0]))
    light = polarimeter.intensities(np.broadcast_to([[2000.0], [500.0], [100.0], [0.0]], (4, 400)))
    frames = detector.expose(light, np.random.default_rng(7))
    spoilt = frames.copy()
    spoilt[2, ::5] = 4095
    instrument = Instrument(polarimeter, detector)
    found = average(reduce_frames(spoilt, polarimeter, detector), instrument=instrument)
    rest = np.arange(400) % 5 != 0
    expected = average(reduce_frames(frames[:, rest], polarimeter, detector), instrument=instrument)
    np.testing.assert_allclose(found.stokes[:3], expected.stokes[:3], rtol=1e-12)
    np.testing.assert_allclose(found.covariance[:3, :3], expected.covariance[:3, :3], rtol=1e-12)
    assert found.counts == {"good": 320, "saturated": 80, "dead": 0, "dark": 0}


def test_a_dim_region_keeps_the_pixels_that_noise_has_made_dark():
    """Light of a fifth of the noise: nearly half of the pixels are dark, and the mean is right only with them."""
    detector = Detector(bits=12, gain=2.0, read_noise=8.0, offset=100.0)
    instrument = Instrument(PLAIN.polarimeter, detector)
    truth = np.array([0.8, 0.2, -0.1, 0.1])
    light = PLAIN.polarimeter.intensities(np.repeat(truth[:, None], 20_000, axis=1))
    image = reduce_frames(detector.expose(light, np.random.default_rng(3)), PLAIN.polarimeter, detector)
    assert image.counts()["dark"] > 6000
    found = average(image, instrument=instrument)
    assert found.counts == {"good": 20_000, "saturated": 0, "dead": 0, "dark": 0}
    assert np.abs((found.stokes - truth) / np.sqrt(np.diag(found.covariance))).max() < 4.0
    # the bright pixels alone are far off
    assert average(image, image.flags == 0, instrument).stokes[0] > 3.0 * truth[0]


def test_shadows_in_a_bright_region_are_left_out():
    detector = Detector(bits=12, gain=2.0, read_noise=8.0, offset=100.0)
    light = PLAIN.polarimeter.intensities(np.repeat([[400.0], [20.0], [0.0], [0.0]], 1000, axis=1))
    light[:, ::4] = 0.0
    image = reduce_frames(detector.expose(light, np.random.default_rng(3)), PLAIN.polarimeter, detector)
    shadow = image.flags == PixelFlag.DARK
    assert 80 < shadow.sum() < 250
    # shadows that noise has made brighter than black cannot be told from dim light: a dark level leaves them out
    level = reduce_frames(
        detector.expose(light, np.random.default_rng(3)), PLAIN.polarimeter, detector, dark_level=40.0
    )
    found = average(level, instrument=Instrument(PLAIN.polarimeter, detector))
    assert found.counts == {"good": 750, "saturated": 0, "dead": 0, "dark": 250}
    assert found.stokes[0] == pytest.approx(400.0, abs=2.0)


def test_added_in_parts_it_is_the_same():
    draw = np.random.default_rng(8)
    stokes = draw.normal(5000.0, 1.0, (4, 30, 20))
    image = image_of(stokes)
    total = RegionSum()
    for first, last in ((0, 1), (1, 17), (17, 30)):
        total.add(
            StokesImage(stokes[:, first:last], image.covariance[:, :, first:last], image.flags[first:last])
        )
    found, expected = total.average(PLAIN), average(image)
    for name in ("stokes", "covariance", "scatter"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-10)


def test_without_a_good_pixel_nothing_is_known():
    found = average(image_of(np.ones((4, 3)), np.full(3, PixelFlag.DEAD, np.uint8)))
    assert np.isnan(found.stokes).all() and np.isnan(found.covariance).all()
    assert found.counts == {"good": 0, "saturated": 0, "dead": 3, "dark": 0}


@pytest.mark.slow
def test_covariance_of_the_mean_is_that_of_many_measurements():
    """4000 measurements of a region of 60 pixels: their means scatter as each of them says it does."""
    detector = Detector(bits=12, gain=2.0, read_noise=8.0, offset=100.0)
    polarimeter = lcvr(retardance_set("tetrahedron"))
    instrument = Instrument(polarimeter, detector)
    truth = np.array([1500.0, 300.0, -250.0, 120.0])
    light = polarimeter.intensities(np.broadcast_to(truth[:, None], (4, 4000 * 60)))
    image = reduce_frames(detector.expose(light, np.random.default_rng(9)), polarimeter, detector)
    means, stated = [], []
    for k in range(4000):
        part = slice(60 * k, 60 * (k + 1))
        one = average(
            StokesImage(image.stokes[:, part], image.covariance[:, :, part], image.flags[part]),
            instrument=instrument,
        )
        means.append(one.stokes)
        stated.append(one.covariance)
    expected = np.mean(stated, axis=0)
    whitening = np.linalg.inv(np.linalg.cholesky(expected))
    away = (np.array(means) - truth) @ whitening.T
    # the sample covariance of 4000 standard normal vectors: standard errors √(2/4000) and √(1/4000)
    np.testing.assert_allclose(np.cov(away.T), np.eye(4), atol=4.5 * math.sqrt(2 / 4000))
    np.testing.assert_allclose(away.mean(axis=0), 0.0, atol=4.5 / math.sqrt(4000))


def test_calibration_and_stability_do_not_average_away():
    """However many pixels: for fully polarised light 1 % of I remains in Q and U, 5 % in V, and 0.1 % of the vector."""
    instrument = Instrument(PLAIN.polarimeter.with_accuracy(0.01, 0.05), Detector(), stability=0.001)
    stokes = np.array([2000.0, 1600.0, -1200.0, 0.0])
    image = image_of(np.broadcast_to(stokes[:, None], (4, 10**5)))
    found = average(image, instrument=instrument)
    np.testing.assert_allclose(found.noise, np.eye(4) / 10**5, rtol=1e-12)
    remaining = np.diag([0.0, 20.0**2, 20.0**2, 100.0**2]) + 1e-6 * np.outer(stokes, stokes)
    np.testing.assert_allclose(found.covariance, remaining + np.eye(4) / 10**5, rtol=1e-9)
