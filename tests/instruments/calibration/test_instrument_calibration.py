"""From frames of known light to a calibrated instrument: units, noise, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.analyzer_calibration import reduced_inputs, standard_inputs
from pbrdf.instruments.calibration.input_table import InputTable
from pbrdf.instruments.calibration.instrument_calibration import calibrate_instrument
from pbrdf.instruments.frames.color_frames import ColorFrames
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.polarimeter.color_filters import BAYER, ColorFilters
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.stokes_image import PixelFlag
from pbrdf.instruments.virtual.miscalibration import miscalibrated

DETECTOR = Detector(bits=14, gain=2.0, read_noise=5.0, offset=60.0)
NOMINAL = lcvr(retardance_set("tetrahedron"))
INPUTS = InputTable(tuple(f"{k:02d}" for k in range(14)), standard_inputs(12))


def frames_of(polarimeter, inputs, *, level=6000.0, shape=(10, 12), seed=0, detector=DETECTOR):
    rng = np.random.default_rng(seed)
    signal = polarimeter.intensities(level * inputs.stokes).T
    raw = detector.expose(np.broadcast_to(signal[..., None, None], (*signal.shape, *shape)), rng)
    return ArrayFrames(raw, inputs.names)


def test_unit_of_the_inputs_does_not_matter():
    """Relative intensities in any unit, and twice as much light for one input: the same instrument, with the nominal
    mean transmittance."""
    truth = miscalibrated(NOMINAL, 0.02, 0.05, np.random.default_rng(0))
    scale = np.ones(14)
    scale[3] = 2.0
    brighter = InputTable(INPUTS.names, INPUTS.stokes * scale)
    frames = frames_of(truth, brighter)
    found = [
        calibrate_instrument(
            frames, Instrument(NOMINAL, DETECTOR), InputTable(INPUTS.names, unit * brighter.stokes)
        )
        for unit in (1.0, 0.01)
    ]
    np.testing.assert_allclose(
        found[0].instrument.polarimeter.analyzer, found[1].instrument.polarimeter.analyzer, rtol=1e-12
    )
    assert found[0].level == pytest.approx(0.01 * found[1].level)
    assert found[0].level == pytest.approx(6000.0, rel=0.01)
    assert found[0].instrument.polarimeter.analyzer[:, 0].mean() == pytest.approx(0.5)
    np.testing.assert_allclose(found[0].instrument.polarimeter.analyzer, truth.analyzer, atol=0.01)


def test_difference_from_the_nominal_instrument():
    """Without noise it is that of the analyser vectors."""
    truth = miscalibrated(NOMINAL, 0.02, 0.05, np.random.default_rng(0))
    bright = Detector(bits=16, gain=1000.0, read_noise=0.0)
    made = calibrate_instrument(
        frames_of(truth, INPUTS, level=50000.0, detector=bright), Instrument(NOMINAL, bright), INPUTS
    )
    scaled = truth.analyzer / truth.analyzer[:, 0].mean() * 0.5
    apart = 2.0 * (scaled - NOMINAL.analyzer)
    expected = [np.sqrt(np.mean(apart[:, part] ** 2)) for part in ([0], [1, 2], [3])]
    np.testing.assert_allclose(made.difference, expected, rtol=0.01)
    assert made.warnings == []


def test_noise_explains_the_errors_of_a_perfect_instrument():
    """Single pixels of an instrument that is as nominal: for the nominal vectors all error is noise of the reading. The
    calibrated vectors of an input held out add sₖᵀ (S Sᵀ)⁻¹ sₖ of the others to its variance (linear regression)."""
    loud = Detector(bits=14, gain=2.0, read_noise=400.0, offset=1500.0)
    frames = frames_of(NOMINAL, INPUTS, shape=(24, 24), detector=loud)
    made = calibrate_instrument(frames, Instrument(NOMINAL, loud), INPUTS, cells=None)
    nominal = made.nominal_accuracy
    np.testing.assert_allclose([nominal.linear, nominal.circular], made.noise, rtol=0.04)
    S = INPUTS.stokes
    more = np.array([s @ np.linalg.inv(S @ S.T - np.outer(s, s)) @ s for s in S.T])
    # variances of Q/I, U/I and V/I at the inputs: those of the tetrahedron, 3 and 1 of I
    own = 3.0 + S[1:] ** 2
    expected = [np.sqrt((own[part] * (1.0 + more)).mean() / own[part].mean()) for part in ([0, 1], [2])]
    ratio = np.array([made.calibration.accuracy.linear, made.calibration.accuracy.circular]) / made.noise
    np.testing.assert_allclose(ratio, expected, rtol=0.04)


def test_a_dark_input_is_no_light_and_its_pixels_are_not_dark():
    dark = InputTable((*INPUTS.names, "dark"), np.concatenate([INPUTS.stokes, np.zeros((4, 1))], axis=1))
    made = calibrate_instrument(frames_of(NOMINAL, dark), Instrument(NOMINAL, DETECTOR), dark)
    assert made.readings.counts() == {"good": 120, "saturated": 0, "dead": 0, "dark": 0}
    assert 14 not in made.calibration.held_out or made.calibration.accuracy.inputs == 14
    assert not (made.readings.flags & PixelFlag.DARK).any()


def test_linear_polarisers_need_no_circular_input():
    linear = InputTable(INPUTS.names[:12], INPUTS.stokes[:, :12])
    real = rotating_polarizer(np.deg2rad([1, 44, 91, 136]), diattenuation=0.97)
    nominal = rotating_polarizer(np.deg2rad([0, 45, 90, 135]))
    made = calibrate_instrument(frames_of(real, linear), Instrument(nominal, DETECTOR), linear)
    np.testing.assert_allclose(made.instrument.polarimeter.analyzer, real.analyzer, atol=0.002)
    assert made.instrument.polarimeter.accuracy[1] == 0.0 and np.isnan(made.noise[1])
    fitted = calibrate_instrument(
        frames_of(real, linear), Instrument(nominal, DETECTOR), linear, parametric=True, held_out=["03"]
    )
    assert fitted.calibration.held_out == (3,)
    assert fitted.calibration.value("diattenuation") == pytest.approx(0.97, abs=0.003)


def test_noise_of_linear_polarisers():
    """Four states at 45° steps, all with the same noise σ: the variance of Q/I is σ² (2 + q²), that of I being σ²."""
    linear = InputTable(INPUTS.names[:12], INPUTS.stokes[:, :12])
    loud = Detector(bits=14, gain=2.0, read_noise=400.0, offset=1500.0)
    nominal = rotating_polarizer(np.deg2rad([0, 45, 90, 135]))
    made = calibrate_instrument(frames_of(nominal, linear, detector=loud), Instrument(nominal, loud), linear)
    assert made.noise[0] == pytest.approx(np.sqrt(2.5 * made.readings.variance.mean()) / 6000.0, rel=0.03)


def test_a_black_level_below_zero_is_not_written():
    """An offset of 0 that the readings put below 0 stays 0: no camera has one."""
    inputs = InputTable((*INPUTS.names, "dark"), np.concatenate([INPUTS.stokes, np.zeros((4, 1))], axis=1))
    frames = frames_of(NOMINAL, inputs, detector=Detector(bits=14, gain=2.0, read_noise=5.0, offset=60.0))
    shifted = ArrayFrames(np.maximum(frames.array, 60) - np.uint16(60), frames.names)
    zero = Detector(bits=14, gain=2.0, read_noise=5.0)
    low = ArrayFrames(np.maximum(shifted.array, 3) - np.uint16(3), frames.names)
    made = calibrate_instrument(low, Instrument(NOMINAL, zero), inputs, parametric=True)
    assert made.instrument.detector.offset == 0.0
    assert made.calibration.fixed["offset"] == "fixed"


def test_refusals():
    instrument = Instrument(NOMINAL, DETECTOR)
    frames = frames_of(NOMINAL, INPUTS)
    with pytest.raises(DataError, match="not for a map"):
        calibrate_instrument(frames, instrument, INPUTS, parametric=True, cells=(2, 2))
    with pytest.raises(DataError, match="4 frames a series for the 6 states"):
        calibrate_instrument(frames, Instrument(lcvr(retardance_set("six_states")), DETECTOR), INPUTS)
    wide = ArrayFrames(np.broadcast_to(frames.array[:, :, :1, :1], (14, 4, 3000, 3000)), INPUTS.names)
    with pytest.raises(DataError, match="3000 × 3000 cells takes about"):
        calibrate_instrument(wide, instrument, INPUTS, cells=None)
    # natural-like light that differs by little, while the readings double: no positive transmittance does that
    S = np.array([[1, 1, 1, 1], [0.5, 0.6, 0.5, 0.5], [0, 0, 0.1, 0], [0, 0, 0, 0.1]], dtype=float)
    few = InputTable(tuple("abcd"), S)
    raw = np.full((4, 4, 2, 2), 160, np.uint16)
    raw[1] = 260
    with pytest.raises(DataError, match="do not grow brighter"):
        calibrate_instrument(ArrayFrames(raw, few.names), instrument, few)


def test_the_uncertainty_of_the_light_is_in_the_accuracy():
    """Case M1: the generator's zero is off by 1.5°, which no input held out can show: the reduction is wrong by
    2·1.5°/√2 = 3.7 % of Q and U, and the accuracy says so once the table does; without, there is a word."""
    nominal = rotating_polarizer(np.deg2rad([0, 45, 90, 135]))
    linear = standard_inputs(6, circular=False)
    names = tuple("abcdef")
    off = np.deg2rad(1.5)
    frames = frames_of(nominal.turned(-off), InputTable(names, linear))
    instrument = Instrument(nominal, DETECTOR)
    silent = calibrate_instrument(frames, instrument, InputTable(names, linear))
    assert silent.instrument.polarimeter.accuracy[0] < 0.005
    assert "nominal one turned by -1.5°" in silent.warnings[0]
    psi = np.pi * np.arange(6) / 6
    std = 2 * off * np.abs([np.sin(2 * psi), np.cos(2 * psi), 0 * psi])
    stated = calibrate_instrument(frames, instrument, InputTable(names, linear, std))
    accuracy = stated.instrument.polarimeter.accuracy
    assert accuracy[0] == pytest.approx(2 * off / np.sqrt(2), rel=0.02)
    assert accuracy[1] == 0.0
    assert stated.warnings == []
    # the error that there really is
    found = reduced_inputs(stated.instrument.polarimeter.analyzer, nominal.intensities(linear))
    rms = np.sqrt(np.mean((found[1:3] / found[0] - linear[1:3]) ** 2))
    assert rms == pytest.approx(accuracy[0], rel=0.05)


def test_one_colour_of_a_colour_camera(tmp_path):
    """Polarisers that are weaker behind red: the calibration of that colour finds their vectors, is written with its
    colour, and reads pictures with it; all colours at once are refused."""
    rng = np.random.default_rng(0)
    layout = np.deg2rad([[90.0, 45.0], [135.0, 0.0]])
    weak, good = (division_of_focal_plane(layout, diattenuation=d) for d in (0.8, 0.97))
    light = 3000.0 * standard_inputs(6, circular=False)
    colors = {"R": weak, "G": good, "B": good}
    pictures = []
    for s in light.T:
        cells = [[colors[c].intensities(s)[weak.mosaic] for c in row] for row in BAYER]
        pictures.append(DETECTOR.expose(np.tile(np.block(cells), (8, 8)), rng))
    pictures = ArrayFrames(np.stack(pictures)[:, None], tuple("abcdef"))
    inputs = InputTable(tuple("abcdef"), light / 3000.0)
    nominal = division_of_focal_plane(layout)
    with pytest.raises(DataError, match='set color = "R"'):
        both = replace(nominal, filters=ColorFilters())
        calibrate_instrument(ColorFrames(pictures, both), Instrument(both, DETECTOR), inputs)
    red = replace(nominal, filters=ColorFilters(only="R"))
    made = calibrate_instrument(ColorFrames(pictures, red), Instrument(red, DETECTOR), inputs)
    np.testing.assert_allclose(made.instrument.polarimeter.analyzer, weak.analyzer, atol=2e-3)
    save_instrument(made.instrument, tmp_path / "red.toml")
    again = load_instrument(tmp_path / "red.toml")
    assert again.polarimeter.filters == ColorFilters(only="R")
    np.testing.assert_array_equal(again.polarimeter.mosaic, nominal.mosaic)
