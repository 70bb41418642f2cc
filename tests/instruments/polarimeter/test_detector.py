"""The detector: photon transfer, saturation, errors."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.detector import Detector


@pytest.mark.parametrize(
    "detector",
    [
        Detector(bits=12, gain=2.5, read_noise=6.0, offset=100.0, dark=20.0),
        Detector(bits=8, gain=40.0, read_noise=30.0, offset=5.0),
        Detector(bits=16, gain=0.5, read_noise=3.0, offset=1000.0),
    ],
)
def test_mean_and_variance_are_those_of_photon_transfer(detector):
    """Mean d = signal + offset + dark/gain; variance (signal + dark/gain)/gain + (read noise/gain)² + 1/12; the
    variance told from the frames themselves agrees on average. Bounds are 5 standard errors of 200 000 exposures."""
    n, signal = 200_000, 0.4 * detector.range
    frames = detector.expose(np.full(n, signal), np.random.default_rng(1))
    mean = signal + detector.offset + detector.dark / detector.gain
    variance = (
        (signal + detector.dark / detector.gain) / detector.gain
        + (detector.read_noise / detector.gain) ** 2
        + 1 / 12
    )
    assert frames.mean() == pytest.approx(mean, abs=5 * np.sqrt(variance / n))
    assert frames.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / n))
    assert detector.variance(frames).mean() == pytest.approx(variance, rel=0.005)
    assert detector.signal(frames).mean() == pytest.approx(signal, abs=5 * np.sqrt(variance / n))
    assert detector.black == pytest.approx(mean - signal)


def test_types_and_range_of_the_numbers():
    rng = np.random.default_rng(0)
    for bits, kind in ((1, np.uint8), (8, np.uint8), (9, np.uint16), (16, np.uint16)):
        frames = Detector(bits=bits, gain=1.0, read_noise=0.1).expose([0.0, 1e9, -5.0], rng)
        assert frames.dtype == kind
        assert frames.tolist() == [0, 2**bits - 1, 0]


def test_saturation_at_the_converter():
    """The largest number of the converter is saturated, the one below is not."""
    detector = Detector(bits=10)
    np.testing.assert_array_equal(detector.saturated([1022, 1023]), [False, True])


def test_pixels_filled_to_the_well_count_as_saturated():
    """A pixel that fills before the converter ends reads the full well, scattered by the read noise: all such pixels
    are found (4 read noises: 3 in 100 000 are not), and one at 80 % of the well is not."""
    detector = Detector(bits=12, gain=2.5, read_noise=15.0, offset=50.0, full_well=6000.0)
    rng = np.random.default_rng(2)
    full = detector.expose(np.full(20_000, 4000.0), rng)
    assert full.max() < 4095
    assert np.count_nonzero(~detector.saturated(full)) <= 5
    below = detector.expose(np.full(20_000, 0.8 * 6000 / 2.5), rng)
    assert not detector.saturated(below).any()


def test_range_is_what_light_can_use():
    detector = Detector(bits=8, gain=10.0, offset=5.0, dark=50.0)
    assert detector.range == 255 - 5 - 5


def test_noise_is_repeated_from_the_same_seed_only():
    detector = Detector()
    a, b, c = (detector.expose(np.full(100, 500.0), np.random.default_rng(s)) for s in (1, 1, 2))
    assert (a == b).all() and (a != c).any()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"bits": 0}, "bits"),
        ({"bits": 17}, "bits"),
        ({"bits": 8.0}, "bits"),
        ({"bits": True}, "bits"),
        ({"gain": 0.0}, "gain"),
        ({"gain": "2"}, "gain"),
        ({"read_noise": -1.0}, "read_noise"),
        ({"offset": np.nan}, "offset"),
        ({"dark": -3}, "dark"),
        ({"full_well": 0}, "full_well"),
        ({"bits": 8, "offset": 255}, "leave no range"),
        ({"bits": 8, "gain": 1.0, "dark": 300.0}, "leave no range"),
        ({"full_well": 20.0, "read_noise": 6.0}, "leave no range"),
    ],
)
def test_errors(settings, message):
    with pytest.raises(DataError, match=message):
        Detector(**settings)


def test_a_signal_that_is_not_a_number_is_refused():
    with pytest.raises(DataError, match="not a finite number"):
        Detector().expose([1.0, np.nan], np.random.default_rng(0))
