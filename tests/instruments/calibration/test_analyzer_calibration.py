"""Calibration by known input states: exact without noise, as accurate as stated with it, bad pixels kept out."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.analyzer_calibration import calibrate, standard_inputs, verify
from pbrdf.instruments.calibration.cell_means import cell_means
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.polarimeter import lcvr, measured, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.stokes_image import reduce_frames
from pbrdf.instruments.virtual.miscalibration import miscalibrated

NOMINAL = lcvr(retardance_set("six_states"))
DETECTOR = Detector(bits=14, gain=2.0, read_noise=5.0, offset=60.0)
INPUTS = standard_inputs(12)


def field(rows, columns, seed=0):
    """A map that changes over the field, as the retardance of liquid crystals does."""
    y, x = np.mgrid[0:rows, 0:columns] / max(rows, columns)
    shift = np.deg2rad(6 * x - 4 * y)[..., None, None]
    cells = [lcvr(retardance_set("six_states") + s).analyzer for s in shift.reshape(-1, 1, 1)]
    return measured(np.array(cells).reshape(rows, columns, 6, 4))


def test_standard_inputs():
    """12 linear angles 15° apart, then left (V = +1) and right circular light, then natural light."""
    S = standard_inputs(12, natural=True)
    assert S.shape == (4, 15)
    np.testing.assert_allclose(np.hypot(*S[1:3, :12]), 1)
    np.testing.assert_allclose(0.5 * np.arctan2(S[2, 3], S[1, 3]), np.deg2rad(45))
    np.testing.assert_array_equal(S[:, 12:].T, [[1, 0, 0, 1], [1, 0, 0, -1], [1, 0, 0, 0]])
    assert standard_inputs(4, circular=False).shape == (4, 4)


@pytest.mark.parametrize("weighted", [False, True])
def test_noiseless_readings_give_the_analyser_vectors(weighted):
    """W = I S⁺ is exact, whatever the instrument; the inputs held out are read right and nothing is left over."""
    truth = np.random.default_rng(0).normal(3.0, 1.0, size=(5, 4))
    intensities = truth @ (100 * INPUTS)
    spread = np.random.default_rng(1).uniform(1, 2, intensities.shape) if weighted else None
    found = calibrate(intensities, 100 * INPUTS, variance=spread)
    np.testing.assert_allclose(found.polarimeter.analyzer, truth, atol=1e-12)
    assert found.residual < 1e-13
    assert found.accuracy.linear < 1e-12 and found.accuracy.circular < 1e-12
    assert found.accuracy.inputs == 14 and found.held_out == tuple(range(14))


def test_maps_are_calibrated_cell_by_cell():
    truth = field(3, 4)
    intensities = np.einsum("yxnk,ki->niyx", truth.analyzer, INPUTS)
    found = calibrate(intensities, INPUTS)
    np.testing.assert_allclose(found.polarimeter.analyzer, truth.analyzer, atol=1e-13)
    assert found.covariance.shape == (3, 4, 6, 4, 4) and not found.filled.any()
    assert verify(found.polarimeter, intensities, INPUTS).linear < 1e-12


@pytest.mark.slow
def test_covariance_of_the_analyser_vectors():
    """Over 1000 noisy calibrations the scatter of W is its stated covariance, from given variances and from
    residuals."""
    rng = np.random.default_rng(2)
    exact = NOMINAL.intensities(100 * INPUTS)
    sigma = 0.5 * np.sqrt(1 + exact / 100)
    found, stated, from_residuals = [], None, []
    for _ in range(1000):
        noisy = exact + sigma * rng.standard_normal(exact.shape)
        weighted = calibrate(noisy, 100 * INPUTS, variance=sigma**2, held_out=())
        plain = calibrate(noisy, 100 * INPUTS, held_out=())
        found.append(weighted.polarimeter.analyzer)
        stated = weighted.covariance
        from_residuals.append(plain.covariance)
    scatter = np.einsum("mna,mnb->nab", *(2 * [np.array(found) - NOMINAL.analyzer])) / 1000
    scale = np.sqrt(np.einsum("naa->na", stated))
    size = scale[:, :, None] * scale[:, None]
    np.testing.assert_allclose(scatter / size, stated / size, atol=0.22)
    ratio = np.einsum("mnaa->na", np.array(from_residuals)) / 1000 / np.einsum("naa->na", stated)
    # without weights it is a little worse, and the mean noise stands for that of each input
    assert (ratio > 0.8).all() and (ratio < 1.5).all()


@pytest.mark.slow
def test_accuracy_is_that_of_light_not_calibrated_with():
    """An instrument with small errors, taken for nominal: `verify` finds the stated 1 % and 5 %, linear and circular
    apart; calibrated, what is left is the noise of the readings."""
    rng = np.random.default_rng(3)
    linear, circular, left = [], [], []
    for _ in range(100):
        truth = miscalibrated(NOMINAL, 0.01, 0.05, rng)
        read = truth.intensities(INPUTS) + 1e-4 * rng.standard_normal((6, 14))
        nominal = verify(NOMINAL, read, INPUTS)
        linear.append(nominal.linear)
        circular.append(nominal.circular)
        left.append(calibrate(read, INPUTS).accuracy)
    assert np.sqrt(np.mean(np.square(linear))) == pytest.approx(0.01, rel=0.15)
    assert np.sqrt(np.mean(np.square(circular))) == pytest.approx(0.05, rel=0.15)
    # noise of Q/I: σ √2 of the six states (variance 2), a little more for that of W itself
    expected = 1e-4 * np.sqrt(2) * np.sqrt(1.5)
    assert np.sqrt(np.mean([a.linear**2 for a in left])) == pytest.approx(expected, rel=0.3)
    assert np.sqrt(np.mean([a.circular**2 for a in left])) == pytest.approx(expected, rel=0.5)


def test_held_out_inputs_take_no_part():
    """Wrong readings at inputs held out change the accuracy, not the analyser vectors; and the polarimeter carries
    it."""
    read = NOMINAL.intensities(INPUTS)
    wrong = read.copy()
    wrong[:, [2, 12]] = np.roll(read[:, [2, 12]], 1, axis=0)
    found = calibrate(wrong, INPUTS, held_out=[12, 2])
    np.testing.assert_allclose(found.polarimeter.analyzer, NOMINAL.analyzer, atol=1e-13)
    assert found.held_out == (2, 12) and found.accuracy.inputs == 2
    assert found.accuracy.linear > 0.1
    assert found.polarimeter.accuracy == (found.accuracy.linear, found.accuracy.circular)
    assert calibrate(read, INPUTS, held_out=()).accuracy is None


def test_an_input_that_the_others_cannot_replace_is_not_held_out():
    """With one circular input V is only known through it: it stays in when each other one is held out."""
    S = standard_inputs(12)[:, :13]
    found = calibrate(NOMINAL.intensities(S), S)
    assert found.held_out == tuple(range(12))
    assert np.isfinite(found.accuracy.circular)


def test_inputs_must_span_the_components():
    S = standard_inputs(12, circular=False)
    with pytest.raises(DataError, match=r"do not determine V: .*'IQU'"):
        calibrate(NOMINAL.intensities(S), S)
    with pytest.raises(DataError, match="do not determine I, Q, U"):
        calibrate(np.ones((6, 2)), S[:, :2])
    with pytest.raises(DataError, match="without the inputs held out, the others do not determine V"):
        calibrate(NOMINAL.intensities(INPUTS), INPUTS, held_out=[12, 13])
    same = np.repeat(INPUTS[:, :1], 5, axis=1)
    with pytest.raises(DataError, match="do not determine"):
        calibrate(np.ones((6, 5)), same)


def test_linear_polarisers_need_no_circular_input():
    truth = rotating_polarizer(np.deg2rad([1, 44, 91, 137]), diattenuation=0.98)
    S = standard_inputs(12, circular=False)
    found = calibrate(truth.intensities(S), S, components="IQU", states=truth.states)
    np.testing.assert_allclose(found.polarimeter.analyzer, truth.analyzer, atol=1e-13)
    np.testing.assert_array_equal(found.polarimeter.determined, [True, True, True, False])
    assert np.isnan(found.accuracy.circular) and found.polarimeter.accuracy[1] == 0.0
    assert found.polarimeter.states == truth.states


def test_cells_without_a_good_pixel_take_their_neighbour():
    truth = field(2, 3)
    read = np.einsum("yxnk,ki->niyx", truth.analyzer, INPUTS)
    read[..., 1, 2] = np.nan
    found = calibrate(read, INPUTS)
    np.testing.assert_array_equal(found.filled, [[False, False, False], [False, False, True]])
    np.testing.assert_allclose(found.polarimeter.analyzer[0], truth.analyzer[0], atol=1e-13)
    filled = found.polarimeter.analyzer[1, 2]
    assert any(np.allclose(filled, truth.analyzer[p], atol=1e-13) for p in ((0, 2), (1, 1)))
    assert found.accuracy.linear < 1e-12
    with pytest.raises(DataError, match="no pixel or cell"):
        calibrate(np.full((6, 14, 2, 2), np.nan), INPUTS)


def test_from_frames_to_a_map_that_reduces_pictures():
    """The whole way: raw frames of the 14 inputs through an instrument that changes over the field, black level and
    flat field of each pixel, calibrated in 4 × 4 cells; a picture reduced with the map is right within the stated
    accuracy and noise, and wrong without it."""
    shape = (16, 16)
    truth = field(16, 16)
    rng = np.random.default_rng(5)
    flat = rng.uniform(0.9, 1.1, shape)
    levels = 5000.0 * INPUTS
    frames = np.stack(
        [
            DETECTOR.expose(truth.intensities(s[:, None, None] * np.ones((4, *shape))) * flat, rng)
            for s in levels.T
        ],
        axis=1,
    )
    means = cell_means(frames, DETECTOR, cells=(4, 4), flat=flat)
    found = calibrate(means.intensities, levels, variance=means.variance)
    light = np.array([5000.0, 2000.0, -1500.0, 1000.0])
    signal = truth.intensities(light[:, None, None] * np.ones((4, *shape))) * flat
    image = reduce_frames(DETECTOR.expose(signal, rng), found.polarimeter, DETECTOR, flat=flat)
    error = (image.stokes[1:].mean(axis=(1, 2)) - light[1:]) / light[0]
    noise = np.sqrt(np.einsum("iiyx->iyx", image.covariance).mean(axis=(1, 2)))[1:] / 16 / light[0]
    assert (abs(error) < 3 * np.array([0.002, 0.002, 0.002]) + 3 * noise).all()
    assert found.accuracy.linear < 0.003
    blind = reduce_frames(DETECTOR.expose(signal, rng), NOMINAL, DETECTOR, flat=flat)
    pixelwise = abs((blind.stokes - light[:, None, None]) / light[0]).max(axis=(1, 2))
    assert pixelwise[1:].max() > 0.03


def test_errors():
    with pytest.raises(DataError, match=r"\(states, inputs\)"):
        calibrate(np.ones((6, 13)), INPUTS)
    with pytest.raises(DataError, match="variances as the intensities"):
        calibrate(np.ones((6, 14)), INPUTS, variance=np.ones((6, 13)))
    with pytest.raises(DataError, match="not finite"):
        calibrate(np.ones((6, 14)), np.full((4, 14), np.nan))
    with pytest.raises(DataError, match="'IQU'"):
        calibrate(np.ones((6, 14)), INPUTS, components="IQ")
    with pytest.raises(DataError, match=r"0 … 13"):
        calibrate(np.ones((6, 14)), INPUTS, held_out=[14])
    with pytest.raises(DataError, match="'each'"):
        calibrate(np.ones((6, 14)), INPUTS, held_out="all")
    with pytest.raises(DataError, match="6 states"):
        verify(NOMINAL, np.ones((5, 14)), INPUTS)
