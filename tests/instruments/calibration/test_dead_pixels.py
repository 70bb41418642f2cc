"""Dead pixels are found, and good ones are not called dead."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.dead_pixels import find_dead_pixels
from pbrdf.instruments.polarimeter.detector import Detector

DETECTOR = Detector(bits=12, gain=2.0, read_noise=6.0, offset=100.0, dark=4.0)
SHAPE = (60, 80)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def darks(rng, count=16):
    return DETECTOR.expose(np.zeros((count, *SHAPE)), rng).astype(float)


def vignetted():
    y, x = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    return 2000 * (1 - 0.4 * (x**2 + y**2))


def test_hot_noisy_and_stuck_pixels(rng):
    stack = darks(rng)
    stack[:, 3, 4] += 60
    stack[:, 10, 70] += rng.normal(0, 60, 16)
    stack[:, 59, 0] = 104
    found = find_dead_pixels(stack)
    assert set(zip(*np.nonzero(found), strict=True)) == {(3, 4), (10, 70), (59, 0)}


def test_unresponsive_pixels_under_vignetting(rng):
    """Half and twice the response of the surroundings; the vignetting itself, 80 % at the corners, is not dead."""
    signal = vignetted()
    signal[5, 5] *= 0.5
    signal[30, 40] *= 1.5
    signal[59, 79] = 0
    flats = DETECTOR.expose(np.tile(signal, (4, 1, 1)), rng)
    found = find_dead_pixels(darks(rng), flats)
    assert set(zip(*np.nonzero(found), strict=True)) == {(5, 5), (30, 40), (59, 79)}
    assert not find_dead_pixels(flat=DETECTOR.signal(DETECTOR.expose(vignetted(), rng))).any()


def test_classes_of_a_mosaic_are_not_compared(rng):
    """Polarised light through a mosaic: neighbours differ by factors, pixels of one class do not."""
    signal = vignetted()
    signal[::2, ::2] *= 0.2
    signal[20, 30] *= 0.6
    frames = DETECTOR.signal(DETECTOR.expose(np.tile(signal, (8, 1, 1)), rng))
    found = find_dead_pixels(flat=frames, cell=(2, 2))
    assert set(zip(*np.nonzero(found), strict=True)) == {(20, 30)}


def test_a_quiet_detector_has_no_outliers_for_nothing():
    """All numbers alike but one step of the converter: the rounding is the least scatter there is."""
    dark = np.full((20, 20), 5.0)
    dark[3, 3] = 6.0
    assert not find_dead_pixels(dark).any()
    dark[4, 4] = 9.0
    assert find_dead_pixels(dark).sum() == 1


def test_errors():
    with pytest.raises(DataError, match="give one or both"):
        find_dead_pixels()
    with pytest.raises(DataError, match="same rows and columns"):
        find_dead_pixels(np.ones((5, 5)), np.ones((5, 6)))
    with pytest.raises(DataError, match="rows, columns"):
        find_dead_pixels(np.ones(5))
    with pytest.raises(DataError, match="not brighter than the dark frame"):
        find_dead_pixels(np.full((9, 9), 100.0), np.full((9, 9), 90.0))
