"""From raw frames to Stokes parameters: noise, weights, bad pixels, mosaics."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.frames.mosaic import split_mosaic
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.polarimeter import (
    division_of_focal_plane,
    lcvr,
    measured,
    rotating_polarizer,
)
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.polarimeter.stokes_solution import solve_stokes
from pbrdf.instruments.reduction.stokes_image import PixelFlag, flag_pixels, reduce_frames

SIX = lcvr(retardance_set("six_states"))
FOUR = lcvr(retardance_set("tetrahedron"))
DETECTOR = Detector(bits=14, gain=2.0, read_noise=4.0, offset=50.0, dark=10.0)
LIGHT = np.array([1500.0, 400.0, -300.0, 200.0])


def frames_of(polarimeter, light, shape, detector=DETECTOR, seed=0):
    signal = polarimeter.intensities(light).reshape(-1, *[1] * len(shape)) * np.ones(shape)
    return detector.expose(signal, np.random.default_rng(seed))


@pytest.mark.parametrize("weighted", [True, False])
@pytest.mark.parametrize("polarimeter", [SIX, FOUR], ids=["six", "four"])
def test_mean_and_covariance_of_many_pixels(polarimeter, weighted):
    """Over 100 000 pixels the mean is the light, and the scatter is the covariance that each pixel states. Bounds are 5
    standard errors."""
    n = 100_000
    image = reduce_frames(frames_of(polarimeter, LIGHT, (n,)), polarimeter, DETECTOR, weighted=weighted)
    stated = image.covariance.mean(axis=-1)
    scatter = np.cov(image.stokes)
    sigma = np.sqrt(np.diag(stated))
    assert (abs(image.stokes.mean(axis=1) - LIGHT) < 5 * sigma / np.sqrt(n)).all()
    np.testing.assert_allclose(scatter, stated, atol=5 * np.sqrt(2 / n) * np.outer(sigma, sigma).max())
    assert image.counts() == {"good": n, "saturated": 0, "dead": 0, "dark": 0}


def test_weights_do_not_bias_dim_light():
    """At 15 electrons a state: weights from the noisy intensities themselves make I 0.7 electrons too small. Here I is
    right within 5 standard errors and Q, U, V within half an electron; without weights all four are right."""
    n, light = 100_000, np.array([30.0, 15.0, 0.0, -15.0])
    detector = Detector(bits=12, gain=1.0, read_noise=1.0, offset=20.0)
    frames = frames_of(SIX, light, (n,), detector)
    naive, _ = solve_stokes(detector.signal(frames), detector.variance(frames), SIX.analyzer)
    assert naive[0].mean() < light[0] - 0.5
    for weighted, allowed in ((True, [0.0, 0.5, 0.5, 0.5]), (False, np.zeros(4))):
        image = reduce_frames(frames, SIX, detector, weighted=weighted)
        sigma = np.sqrt(np.einsum("iip->ip", image.covariance).mean(axis=1))
        assert (abs(image.stokes.mean(axis=1) - light) < allowed + 5 * sigma / np.sqrt(n)).all()


def test_weights_pay_where_light_is_highly_polarised():
    """Light nearly along x: the crossed state is dark and almost without noise. The weighted Q scatters less than half
    as much (in variance), as its stated variance says."""
    light = np.array([3000.0, 2900.0, 0.0, 0.0])
    frames = frames_of(SIX, light, (20_000,))
    image, plain = (reduce_frames(frames, SIX, DETECTOR, weighted=w) for w in (True, False))
    assert image.stokes[1].var() < 0.5 * plain.stokes[1].var()
    assert image.stokes[1].var() == pytest.approx(image.covariance[1, 1].mean(), rel=5 * np.sqrt(2 / 20_000))


def test_a_component_that_is_not_seen_is_nan():
    """Linear polarisers do not see V; I, Q and U are as good as ever."""
    linear = rotating_polarizer(np.deg2rad([0, 45, 90, 135]))
    image = reduce_frames(frames_of(linear, LIGHT, (1000,)), linear, DETECTOR)
    assert np.isnan(image.stokes[3]).all() and np.isnan(image.covariance[3]).all()
    np.testing.assert_allclose(image.stokes[:3].mean(axis=1), LIGHT[:3], atol=5)
    assert (image.flags == 0).all()


def test_bad_pixels_are_left_out_and_counted():
    """Saturated in any state, dead in any state, dark on the mean of the states: counted, and NaN but for the dark one,
    whose noise about zero a dim region needs; the neighbours not."""
    frames = frames_of(SIX, LIGHT, (4, 5))
    frames[2, 0, 0] = 2**14 - 1
    frames[:, 1, 1] = 20
    frames[1:, 2, 2] = 20  # crossed in all states but one: not dark
    dead = np.zeros((4, 5), dtype=bool)
    dead[3, 3] = True
    by_state = np.zeros((6, 4, 5), dtype=bool)
    by_state[4, 3, 3] = True
    for known in (dead, by_state):
        image = reduce_frames(frames, SIX, DETECTOR, dead=known)
        assert image.flags[0, 0] == PixelFlag.SATURATED
        assert image.flags[1, 1] == PixelFlag.DARK
        assert image.flags[3, 3] == PixelFlag.DEAD
        assert image.flags[2, 2] == PixelFlag.GOOD
        assert image.counts() == {"good": 17, "saturated": 1, "dead": 1, "dark": 1}
        bad = (image.flags & (PixelFlag.SATURATED | PixelFlag.DEAD)) != 0
        assert np.isnan(image.stokes[:, bad]).all() and np.isnan(image.covariance[:, :, bad]).all()
        assert np.isfinite(image.stokes[:, ~bad]).all() and np.isfinite(image.covariance[:, :, ~bad]).all()
    alone = reduce_frames(frames[:, ~bad], SIX, DETECTOR)
    np.testing.assert_array_equal(image.stokes[:, ~bad], alone.stokes)


def test_frames_that_are_not_numbers_are_dead():
    frames = frames_of(SIX, LIGHT, (3,)).astype(float)
    frames[1, 1] = np.nan
    np.testing.assert_array_equal(flag_pixels(frames, DETECTOR), [0, PixelFlag.DEAD, 0])
    assert np.isnan(reduce_frames(frames, SIX, DETECTOR).stokes[:, 1]).all()


@pytest.mark.parametrize("weighted", [True, False])
def test_dark_subtracted_float_mosaics_keep_their_mean(weighted):
    """Noise about 0 is neither clipped at 0 nor cut into steps, and a highlight far away changes nothing."""
    camera = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]]))
    detector = Detector(bits=16, gain=1.0, read_noise=1.0)
    noise = np.random.default_rng(0).normal(0.0, 1.0, (200, 200))
    noise -= noise.mean()
    image = reduce_frames(split_mosaic(noise, camera), camera, detector, weighted=weighted)
    seen = image.stokes[:3]
    # unweighted I = ½ ΣI has exactly twice the mean of the mosaic's pixels; Q and U are differences of 10 000 pairs
    assert abs(seen[0].mean()) < (5 / 100 if weighted else 1e-12)
    assert (abs(seen[1:].mean(axis=(1, 2))) < 5 * np.sqrt(2.0) / 100).all()
    assert (seen[0] < 0.0).mean() == pytest.approx(0.5, abs=0.03)
    paint = np.full((8, 8), 0.9)
    alone = reduce_frames(split_mosaic(paint, camera), camera, detector, weighted=weighted).stokes
    paint[0, 0] = 60000.0
    beside = reduce_frames(split_mosaic(paint, camera), camera, detector, weighted=weighted).stokes
    np.testing.assert_array_equal(beside[:3, 1:, 1:], alone[:3, 1:, 1:])
    np.testing.assert_allclose(alone[0], 1.8, rtol=1e-12)


def test_dark_level():
    """A pixel is dark up to the level, on the mean over the states."""
    frames = np.tile([DETECTOR.black + 10.0, DETECTOR.black + 11.0], (4, 1))
    np.testing.assert_array_equal(flag_pixels(frames, DETECTOR, dark_level=10.0), [PixelFlag.DARK, 0])
    assert (
        flag_pixels(frames, DETECTOR, dark_level=10.0, black=np.full(2, DETECTOR.black + 1.0)).tolist()
        == [PixelFlag.DARK] * 2
    )


def test_black_level_and_flat_field_of_each_pixel():
    """Pixels that differ in black level and response read the same light: signal = (raw − black)/flat. The variance is
    that of the raw number over flat²."""
    n = 40_000
    rng = np.random.default_rng(5)
    black, flat = rng.uniform(40, 80, n), rng.uniform(0.5, 1.5, n)
    signal = SIX.intensities(LIGHT)[:, None] * flat
    noiseless = signal + black
    image = reduce_frames(noiseless, SIX, DETECTOR, black=black, flat=flat)
    np.testing.assert_allclose(image.stokes, np.repeat(LIGHT[:, None], n, axis=1), rtol=1e-12, atol=1e-9)
    frames = noiseless + np.sqrt(DETECTOR.variance(noiseless)) * rng.standard_normal(noiseless.shape)
    noisy = reduce_frames(frames, SIX, DETECTOR, black=black, flat=flat)
    pull = (noisy.stokes - LIGHT[:, None]) / np.sqrt(np.einsum("iip->ip", noisy.covariance))
    np.testing.assert_allclose(pull.std(axis=1), 1, atol=5 / np.sqrt(2 * n) + 0.005)
    # one for each state and pixel, and one for all, are the same thing
    again = reduce_frames(noiseless, SIX, DETECTOR, black=np.tile(black, (6, 1)), flat=np.tile(flat, (6, 1)))
    np.testing.assert_allclose(again.stokes, image.stokes)


def test_a_map_is_reduced_with_the_vectors_of_each_place():
    rng = np.random.default_rng(2)
    analyzer = SIX.analyzer + 0.05 * rng.normal(size=(2, 3, 6, 4))
    polarimeter = measured(analyzer)
    S = LIGHT[:, None, None] * np.ones((4, 8, 9))
    frames = polarimeter.intensities(S) + DETECTOR.black
    whole = reduce_frames(frames, polarimeter, DETECTOR)
    np.testing.assert_allclose(whole.stokes, S, rtol=1e-9, atol=1e-8)
    part = reduce_frames(frames[:, 2:5], polarimeter, DETECTOR, analyzer=polarimeter.spread(8, 9, 2, 5))
    np.testing.assert_array_equal(part.stokes, whole.stokes[:, 2:5])


def test_errors():
    with pytest.raises(DataError, match="5 frames for the 6 states"):
        reduce_frames(np.ones((5, 3)), SIX, DETECTOR)
    with pytest.raises(DataError, match="flat field"):
        reduce_frames(np.full((6, 3), 100.0), SIX, DETECTOR, flat=[1.0, 0.0, 1.0])
    with pytest.raises(DataError, match="black level has the shape"):
        reduce_frames(np.full((6, 3), 100.0), SIX, DETECTOR, black=np.ones(4))
    with pytest.raises(DataError, match="cannot be placed"):
        reduce_frames(np.full((6, 3), 100.0), measured(np.ones((2, 2, 6, 4))), DETECTOR)
    # a flat field may be anything where the pixel is dead
    image = reduce_frames(
        np.full((6, 3), 100.0), SIX, DETECTOR, flat=[1.0, 0.0, np.nan], dead=[False, True, True]
    )
    assert image.counts()["dead"] == 2 and np.isfinite(image.stokes[:, 0]).all()
