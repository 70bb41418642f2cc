"""Dark frame, flat field and dead pixels: what they take back, and what their own noise adds."""

from dataclasses import replace

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.frames.mosaic import MosaicFrames
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, rotating_polarizer
from pbrdf.instruments.reduction.corrections import Corrections, reduce_rows
from pbrdf.instruments.reduction.stokes_image import PixelFlag, reduce_frames

POLARIZER = rotating_polarizer(np.deg2rad([0.0, 45.0, 90.0, 135.0]))
MOSAIC = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))
QUIET = Detector(bits=16, gain=10.0, read_noise=0.0, offset=100.0)
ROWS, COLUMNS = 8, 6


def reduced(raw, instrument, corrections):
    return reduce_rows(raw, instrument, corrections, (0, raw.shape[1], raw.shape[1]))


@pytest.fixture
def in_folder(tmp_path):
    """An instrument whose [frames] table names pictures that are written into a folder."""

    def make(polarimeter, detector=QUIET, **pictures):
        numbers = {key: value for key, value in pictures.items() if isinstance(value, int)}
        named = {key: f"{key}.npy" for key in pictures if key not in numbers}
        for key in named:
            np.save(tmp_path / named[key], pictures[key])
        return Instrument(polarimeter, detector, frames={**named, **numbers}, folder=tmp_path)

    return make


def unfiltered(polarimeter, stokes, response, level):
    """Frames without noise of pixels with their own response and dark level, rounded."""
    light = np.einsum("nk,k->n", polarimeter.analyzer, stokes)[:, None, None]
    return np.rint(light * response + level).astype(np.uint16)


def test_pixels_that_differ_come_out_alike(in_folder):
    """A dark frame and a flat field taken with the same pixels take back what those pixels add and multiply."""
    draw = np.random.default_rng(1)
    response = draw.uniform(0.7, 1.3, (ROWS, COLUMNS))
    level = draw.uniform(50.0, 150.0, (ROWS, COLUMNS))
    stokes = np.array([40000.0, 9000.0, -4000.0, 0.0])
    raw = unfiltered(POLARIZER, stokes, response, level)
    dark = np.rint(level).astype(np.uint16)
    flat = np.rint(30000.0 * response + level).astype(np.uint16)
    instrument = in_folder(POLARIZER, dark_frame=dark, flat_field=flat)
    image = reduced(raw, instrument, Corrections.of(instrument, ArrayFrames(raw[None])))
    expected = stokes[:3] * response.mean()
    np.testing.assert_allclose(
        image.stokes[:3], np.broadcast_to(expected[:, None, None], (3, ROWS, COLUMNS)), atol=3.0
    )
    plain = reduced(raw, replace(instrument, frames={}), Corrections())
    assert np.ptp(plain.stokes[0]) > 10000.0


def test_flat_field_of_a_mosaic_is_of_natural_light(in_folder):
    """A mosaic's flat field also evens out the transmittance of its polarisers: natural light comes out unpolarised."""
    draw = np.random.default_rng(2)
    response = draw.uniform(0.7, 1.3, (2 * ROWS, 2 * COLUMNS))
    # the polarisers at 0 degrees pass a tenth less than the others
    response[1::2, 1::2] *= 0.9
    flat = np.rint(20000.0 * response + 100.0).astype(np.uint16)
    instrument = in_folder(MOSAIC, flat_field=flat)
    shot = np.rint(8000.0 * response + 100.0).astype(np.uint16)
    frames = MosaicFrames(ArrayFrames(shot[None, None]), MOSAIC)
    image = reduced(frames.read(0, 0, ROWS), instrument, Corrections.of(instrument, frames))
    np.testing.assert_allclose(image.stokes[1:3], 0.0, atol=2.0)
    np.testing.assert_allclose(image.stokes[0], image.stokes[0].mean(), rtol=3e-4)
    uncorrected = reduced(frames.read(0, 0, ROWS), Instrument(MOSAIC, QUIET), Corrections())
    assert np.abs(uncorrected.stokes[1:3]).max() > 500.0


def test_transmittance_of_the_flat_field_where_it_is_stated(in_folder):
    """Polarisers that pass 0.55 and 0.45, flat field of natural light: divided by a stated 0.5 of all, each state reads
    as if it passed 0.5; the polarimeter that a calibration made of such readings is not corrected a second time."""
    passed = np.array([0.55, 0.5, 0.5, 0.45])
    response = np.empty((2 * ROWS, 2 * COLUMNS))
    for state, (y, x) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        response[y::2, x::2] = passed[state]
    flat = np.rint(20000.0 * response + 100.0).astype(np.uint16)
    uneven = replace(MOSAIC, analyzer=MOSAIC.analyzer * (passed / 0.5)[:, None])
    shot = np.rint(8000.0 * response + 100.0).astype(np.uint16)
    frames = MosaicFrames(ArrayFrames(shot[None, None]), MOSAIC)
    instrument = in_folder(uneven, flat_field=flat)
    stated = replace(instrument, frames={**instrument.frames, "flat_transmittance": [0.5] * 4})
    corrections = Corrections.of(stated, frames)
    pixels = corrections.pixels(stated, slice(0, ROWS))
    signal = (frames.read(0, 0, ROWS) - pixels.level) / pixels.flat
    np.testing.assert_allclose(signal, 4000.0, rtol=1e-3)
    wrong = replace(stated, frames={**instrument.frames, "flat_transmittance": [0.5] * 3})
    with pytest.raises(DataError, match="flat_transmittance holds 3 numbers for the 4 states"):
        Corrections.of(wrong, frames)
    for value in ([0.5, -1], "0.5", [True] * 4):
        with pytest.raises(DataError, match=r"flat_transmittance is .*: give a list of numbers more than 0"):
            Corrections.of(replace(stated, frames={"flat_transmittance": value}), frames)


def test_without_pictures_it_is_the_plain_reduction():
    draw = np.random.default_rng(3)
    raw = draw.integers(200, 3000, (4, ROWS, COLUMNS)).astype(np.uint16)
    image = reduced(raw, Instrument(POLARIZER, QUIET), Corrections())
    plain = reduce_frames(raw, POLARIZER, QUIET)
    np.testing.assert_array_equal(image.stokes, plain.stokes)
    np.testing.assert_array_equal(image.covariance, plain.covariance)


def test_dead_pixels_of_a_mosaic_spoil_their_cell(in_folder):
    dead = np.zeros((2 * ROWS, 2 * COLUMNS), np.uint8)
    dead[4, 7] = 255
    instrument = in_folder(MOSAIC, dead_pixels=dead)
    frames = MosaicFrames(ArrayFrames(np.full((1, 1, 2 * ROWS, 2 * COLUMNS), 500, np.uint16)), MOSAIC)
    image = reduced(frames.read(0, 0, ROWS), instrument, Corrections.of(instrument, frames))
    assert image.flags[2, 3] == PixelFlag.DEAD
    assert np.isnan(image.stokes[:, 2, 3]).all()
    assert (image.flags != 0).sum() == 1


@pytest.mark.parametrize("number", [90, 65535], ids=["below the black level", "saturated"])
def test_a_pixel_without_a_known_response_counts_as_dead(in_folder, number):
    flat = np.full((ROWS, COLUMNS), 9000, np.uint16)
    flat[3, 2] = number
    instrument = in_folder(POLARIZER, flat_field=flat)
    raw = np.full((4, ROWS, COLUMNS), 700, np.uint16)
    image = reduced(raw, instrument, Corrections.of(instrument, ArrayFrames(raw[None])))
    assert np.argwhere(image.flags).tolist() == [[3, 2]]
    assert image.flags[3, 2] == PixelFlag.DEAD


@pytest.mark.parametrize("polarimeter", [POLARIZER, MOSAIC], ids=["one picture a state", "mosaic"])
@pytest.mark.parametrize("exposures", [1, 4])
def test_covariance_with_the_noise_of_dark_frame_and_flat_field(polarimeter, exposures):
    """The stated covariance is that of many measurements, each with a dark frame and a flat field of its own."""
    detector = Detector(bits=16, gain=1.0, read_noise=20.0, offset=200.0)
    mosaic = polarimeter.mosaic is not None
    instrument = Instrument(polarimeter, detector, frames={})
    draw = np.random.default_rng(4)
    # dim flat field and noisy dark frame, so that they matter; every pixel is one measurement of the same light
    rows, columns = 200, 250
    states = polarimeter.size if mosaic else 1
    light = np.einsum("nk,k->n", polarimeter.analyzer, [3000.0, 900.0, 500.0, 0.0])
    raw = detector.expose(np.broadcast_to(light[:, None, None], (4, rows, columns)), draw)

    def mean_of(signal):
        shots = detector.expose(np.broadcast_to(signal, (exposures, states, rows, columns)), draw)
        return np.rint(shots.mean(axis=0)).astype(np.uint16)

    through = polarimeter.analyzer[:, 0] if mosaic else np.ones(1)
    layout = replace(Corrections().layout, dark_exposures=exposures, flat_exposures=exposures)
    corrections = Corrections(
        mean_of(0.0), mean_of(1500.0 * through[:, None, None] / through.mean()), None, layout
    )
    corrections = replace(corrections, flat_scale=corrections._mean_flat(instrument))
    image = reduced(raw, instrument, corrections)
    found = np.cov(image.stokes[:3].reshape(3, -1))
    stated = image.covariance[:3, :3].reshape(3, 3, -1).mean(axis=-1)
    # a sample variance of 50 000 has a relative standard error of 0.6 %; the quotient by a noisy flat field adds
    # its second order, and the covariance estimated at noisy pixels as well
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    np.testing.assert_allclose(found / scale, stated / scale, atol=0.03)
    # without what the two pictures add it would be far from that
    alone = reduced(raw, instrument, Corrections()).covariance[0, 0].mean()
    assert found[0, 0] > 1.25 * alone


def test_pictures_that_do_not_fit_are_named(in_folder):
    frames = ArrayFrames(np.zeros((1, 4, ROWS, COLUMNS), np.uint16))
    small = np.full((ROWS, COLUMNS - 1), 500, np.uint16)
    with pytest.raises(DataError, match=r"dark_frame\.npy: 8 × 5 pixels .* the frames have 8 × 6"):
        Corrections.of(in_folder(POLARIZER, dark_frame=small), frames)
    with pytest.raises(DataError, match=r"flat_field\.npy: the flat field holds numbers of the type float64"):
        Corrections.of(in_folder(POLARIZER, flat_field=np.ones((ROWS, COLUMNS))), frames)
    with pytest.raises(DataError, match="nowhere between the dark level and saturation"):
        Corrections.of(in_folder(POLARIZER, flat_field=np.ones((ROWS, COLUMNS), np.uint8)), frames)
    with pytest.raises(DataError, match="it holds 2 pictures, and one is wanted"):
        Corrections.of(in_folder(POLARIZER, dark_frame=np.zeros((2, ROWS, COLUMNS), np.uint16)), frames)


def test_numbers_beyond_the_converter_are_an_error():
    """12 bits in the upper end of 16 read as numbers that a 12-bit converter cannot give; others need more bits."""
    raw = np.full((4, ROWS, COLUMNS), 700 << 4, np.uint16)
    with pytest.raises(
        DataError, match=r'a pixel reads 11200, but 12 bits end at 4095: .* alignment = "left"'
    ):
        reduced(raw, Instrument(POLARIZER, Detector(bits=12)), Corrections())
    with pytest.raises(DataError, match="a pixel reads 11201, but 12 bits end at 4095: set bits = 14"):
        reduced(raw + np.uint16(1), Instrument(POLARIZER, Detector(bits=12)), Corrections())
    with pytest.raises(DataError, match=r"its numbers have 8 bits, but \[detector\] says bits = 12"):
        reduced(raw.astype(np.uint8), Instrument(POLARIZER, Detector(bits=12)), Corrections())
