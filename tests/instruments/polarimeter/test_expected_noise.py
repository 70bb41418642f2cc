"""What is expected of readings that have not been taken, against readings that have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.expected_noise import (
    automatic_exposure,
    expected_covariance,
    systematic_covariance,
)
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.virtual.miscalibration import miscalibrated
from pbrdf.optics.elements import rotate_frame

STOKES = np.array([120.0, -40.0, 25.0, 6.0])


def spread(samples):
    away = samples - samples.mean(axis=0)
    return away.T @ away / (len(samples) - 1)


def test_calibration_errors_have_the_stated_covariance():
    instrument = preset("paper")
    polarimeter = instrument.polarimeter
    rng = np.random.default_rng(2)
    inverse = np.linalg.pinv(polarimeter.analyzer)
    read = np.array(
        [inverse @ miscalibrated(polarimeter, 0.01, 0.05, rng).intensities(STOKES) for _ in range(4000)]
    )
    stated = systematic_covariance(replace(instrument, stability=0.0), STOKES)
    found = spread(read)
    np.testing.assert_allclose(np.diag(found)[1:], np.diag(stated)[1:], rtol=0.1)
    assert found[0, 0] < 1e-20
    # no correlation beyond chance
    scale = np.sqrt(np.outer(np.diag(stated)[1:], np.diag(stated)[1:]))
    assert np.abs((found[1:, 1:] - np.diag(np.diag(found)[1:])) / scale).max() < 0.06


def test_a_source_scales_the_whole_vector():
    steady = replace(
        preset("paper"), polarimeter=preset("paper").polarimeter.with_accuracy(0.0, 0.0), stability=0.01
    )
    factors = 1.0 + 0.01 * np.random.default_rng(0).standard_normal(5000)
    np.testing.assert_allclose(
        systematic_covariance(steady, STOKES), spread(factors[:, None] * STOKES), rtol=0.08
    )


def test_detector_noise_is_that_of_exposed_frames():
    """Seen through an instrument that is turned by 25°, averaged over 9 pixels, at an exposure of 3."""
    instrument = replace(
        preset("paper"),
        polarimeter=preset("paper").polarimeter.with_accuracy(0.0, 0.0),
        stability=0.0,
        detector=Detector(bits=12, gain=0.5, read_noise=2.0, offset=30.0, dark=5.0),
    )
    angle = np.deg2rad(25.0)
    expected = expected_covariance(instrument, STOKES, reference_angle=angle, pixels=9, exposure=3.0)
    signal = 3.0 * instrument.polarimeter.intensities(rotate_frame(angle) @ STOKES)
    raw = instrument.detector.expose(
        np.broadcast_to(signal[:, None, None], (4, 6000, 9)), np.random.default_rng(4)
    )
    means = instrument.detector.signal(raw).mean(axis=2) / 3.0
    stokes = rotate_frame(-angle) @ np.linalg.pinv(instrument.polarimeter.analyzer) @ means
    found = spread(stokes.T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / scale).max() < 0.06
    np.testing.assert_allclose(
        stokes.mean(axis=1), STOKES, atol=5.0 * np.sqrt(np.diag(expected) / 6000).max()
    )


def test_what_is_not_seen_has_no_covariance():
    covariance = expected_covariance(preset("sony_imx250mzr"), STOKES, reference_angle=0.4)
    assert np.isnan(covariance[3]).all()
    assert np.isnan(covariance[:, 3]).all()
    assert np.isfinite(covariance[:3, :3]).all()


def test_automatic_exposures_fill_the_range():
    instrument = replace(preset("paper"), detector=Detector(bits=10, offset=100.0, gain=4.0, dark=40.0))
    brightest = np.array([0.003, 0.7, 90.0])
    exposures = automatic_exposure(instrument, brightest)
    np.testing.assert_allclose(exposures * brightest, 0.8 * (1023.0 - 110.0), rtol=1e-3)
    assert all(len(f"{e:.12g}".replace(".", "").strip("0")) <= 4 for e in exposures)
    assert automatic_exposure(instrument, 0.0) == 1.0


def test_numbers_out_of_range_are_refused():
    with pytest.raises(DataError, match="at least one pixel"):
        expected_covariance(preset("paper"), STOKES, pixels=0)
    with pytest.raises(DataError, match="a part from 0 to 1"):
        automatic_exposure(preset("paper"), 1.0, 1.5)


@pytest.mark.parametrize(
    ("read_noise", "least", "most"), [(0.05, 200.0, 400.0), (0.25, 3.0, 50.0), (0.8, 1.0, 1.001)]
)
def test_rounding_in_a_quiet_even_region_does_not_average_away(read_noise, least, most):
    """Means over 400 pixels, for many brightnesses, scatter as stated: far more than single pixels' noise / √400."""
    instrument = replace(
        preset("paper"),
        polarimeter=preset("paper").polarimeter.with_accuracy(0.0, 0.0),
        stability=0.0,
        # so many electrons a digital number that shot noise is small
        detector=Detector(bits=8, gain=1e5, read_noise=read_noise * 1e5, offset=4.0),
    )
    rng = np.random.default_rng(5)
    detector, polarimeter = instrument.detector, instrument.polarimeter
    stokes = STOKES[:, None] * rng.uniform(0.8, 1.2, 300)
    frames = detector.expose(np.repeat(polarimeter.intensities(stokes)[..., None], 400, axis=-1), rng)
    means = np.linalg.pinv(polarimeter.analyzer) @ detector.signal(frames).mean(axis=-1)
    stated = expected_covariance(instrument, stokes.T, pixels=400, exposure=1.0)
    chi2 = np.einsum("gi,gij,gj->g", (means - stokes).T, np.linalg.inv(stated), (means - stokes).T)
    assert chi2.mean() == pytest.approx(4.0, rel=0.15)
    single = expected_covariance(instrument, stokes.T, pixels=1, exposure=1.0)
    ratio = stated[:, 0, 0] / (single[:, 0, 0] / 400.0)
    assert (ratio >= least).all() and (ratio <= most).all()
