"""What the numbers of files say of the converter: alignment, means, saturation below the stated end."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.instruments.frames.digital_numbers import ConvertedFrames, require_range, trailing_zeros
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.frames.frames import ArrayFrames, ChosenSeries, notes_of, shift_of
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane
from pbrdf.instruments.reduction.stokes_image import PixelFlag
from pbrdf.instruments.reduction.streaming import reduced_blocks

CAMERA = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))


def picture(bits=12, level=5600.0 / 4096.0, dolp=0.6, size=16, seed=1):
    """A mosaic picture of even light, horizontally polarised, with noise; case H1: bright enough that the pixels
    behind 0° fill up."""
    rng = np.random.default_rng(seed)
    top = 2.0**bits
    cell = 0.5 * level * top * np.array([[1 - dolp, 1], [1, 1 + dolp]])
    even = np.tile(cell, (size // 2, size // 2))
    return np.clip(np.round(even + rng.normal(0, 0.002 * top, even.shape)), 0, top - 1).astype(np.uint16)


def frames_of(numbers, **detector):
    """A picture as frames of one series and state, in the detector's numbers."""
    return ConvertedFrames(ArrayFrames(numbers[None, None]), Detector(**detector))


def read(frames):
    return frames.read(0, 0, frames.rows)[0]


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("level", [1.37, 0.3, 0.06])
def test_bits_in_the_upper_end_are_seen(bits, level):
    """Bright or so dim that the shifted numbers are within the range: the numbers are those of the converter."""
    numbers = picture(bits, level)
    frames = frames_of(numbers << (16 - bits), bits=bits)
    np.testing.assert_array_equal(read(frames), numbers)
    assert frames.shift == 16 - bits
    assert f"read as {bits} bits in the upper end of 16" in frames.notes[0]
    # numbers that stand right are left as they are, without a word
    right = frames_of(picture(bits, 0.5), bits=bits)
    np.testing.assert_array_equal(read(right), picture(bits, 0.5))
    assert right.notes == []


def test_alignment_that_is_stated():
    numbers = picture()
    left = frames_of(numbers << 4, bits=12, alignment="left")
    np.testing.assert_array_equal(read(left), numbers)
    assert left.notes == []
    # all multiples of 16, and yet as they stand: 8 bits stretched to 12
    stretched = picture(8, 0.9) << 4
    np.testing.assert_array_equal(read(frames_of(stretched, bits=12, alignment="right")), stretched)
    with pytest.raises(
        DataError, match=r"series '1': not all numbers are multiples of 16, .* alignment = \"right\""
    ):
        read(frames_of(numbers, bits=12, alignment="left"))
    with pytest.raises(DataError, match="alignment is 'up'"):
        Detector(alignment="up")


@pytest.mark.parametrize(("bits", "said"), [(10, 12), (12, 14), (12, 16), (14, 16)])
def test_more_bits_than_there_are(bits, said):
    """Case H1 with bits = 16, as once was told: 65520 would not count as saturated."""
    top = (2**bits - 1) << (16 - bits)
    with pytest.raises(
        DataError, match=rf"the largest is {top} = {2**bits - 1} · {2 ** (16 - bits)}.* bits = {bits}"
    ):
        frames_of(picture(bits) << (16 - bits), bits=said)


def test_few_numbers_prove_nothing():
    """Noise-free numbers that happen to be multiples of 16 are left alone unless they are beyond the range."""
    even = np.full((8, 8), 1600, np.uint16)
    assert frames_of(even, bits=12).shift == 0
    assert frames_of(even << 4, bits=12).shift == 4
    assert frames_of(np.zeros((8, 8), np.uint16), bits=12).shift == 0
    assert trailing_zeros(np.array([48, 16, 0])) == 4
    assert trailing_zeros(np.zeros(3, int)) == 16


def test_multiples_that_only_the_whole_picture_shows():
    """The rows that are looked at first are dark; the others hold few numbers at a time, all multiples of 16."""
    numbers = np.zeros((1200, 512), np.uint16)
    numbers[:40] = 16 * np.random.default_rng(0).integers(0, 200, (40, 512))
    frames = frames_of(numbers, bits=12)
    assert (frames.shift, frames.notes) == (0, [])
    read(frames)
    assert "all numbers are multiples of 16, and were read as they stand" in frames.notes[0]
    right = frames_of(numbers, bits=12, alignment="right")
    read(right)
    assert right.notes == []


def test_a_dark_series_first_does_not_decide():
    dim = np.zeros((16, 16), np.uint16)
    run = np.stack([dim, picture() << 4, dim])[:, None]
    frames = ConvertedFrames(ArrayFrames(run), Detector(bits=12))
    assert frames.shift == 4
    np.testing.assert_array_equal(frames.read(1, 0, 16)[0], picture())


def test_saturation_of_left_aligned_bits_is_marked(tmp_path):
    """Case H1 from the file on: every cell has a saturated pixel, none gives a degree of polarisation of 0.570."""
    Image.fromarray(picture() << 4).save(tmp_path / "f.png")
    instrument = Instrument(CAMERA, Detector(bits=12))
    frames = open_frames(tmp_path / "f.png", instrument)
    (block,) = reduced_blocks(frames, instrument, lambda block: block)
    assert (block.image.flags == PixelFlag.SATURATED).all()
    assert shift_of(ChosenSeries(frames, ["f"])) == 4


@pytest.mark.parametrize(
    ("numbers", "detector", "remedy"),
    [
        (np.minimum(picture(), 4080), {"bits": 12}, "full_scale = 4080"),
        (np.minimum(picture(14), 15000), {"bits": 14}, "full_scale = 15000"),
        (picture(), {"bits": 16}, "bits = 12"),
        (picture(10) << 2, {"bits": 12}, "full_scale = 4092"),
        (np.minimum(picture(), 4000) << 4, {"bits": 12, "alignment": "left"}, "full_scale = 4000"),
    ],
)
def test_pixels_that_pile_up_below_the_end(numbers, detector, remedy):
    """A quarter of the pixels at one number, which the detector as stated does not call saturated."""
    frames = frames_of(numbers, **detector)
    top = int(read(frames).max())
    assert f"64 pixels (25.00%) read exactly {top}, the largest number" in frames.notes[-1]
    assert remedy in frames.notes[-1]
    assert frames.notes == notes_of(ChosenSeries(frames, ["1"]))


def test_what_is_no_pile():
    """Noise at the top, pictures without noise, pixels that are marked as saturated anyhow, and a stated end."""
    rng = np.random.default_rng(0)
    wide = rng.normal(2000, 30, (64, 64)).round().astype(np.uint16)
    few = rng.poisson(3.0, (64, 64)).astype(np.uint8)
    steps = np.tile(np.arange(16, dtype=np.uint16) * 100, (16, 1))
    for numbers, detector in (
        (wide, {"bits": 12}),
        (few, {"bits": 8}),
        (steps, {"bits": 12}),
        (picture(), {"bits": 12}),
        (np.minimum(picture(), 4080), {"bits": 12, "full_scale": 4080}),
    ):
        frames = frames_of(numbers, **detector)
        read(frames)
        assert frames.notes == []


def test_full_scale_is_where_the_detector_saturates():
    detector = Detector(bits=12, full_scale=4080)
    np.testing.assert_array_equal(detector.saturated([4079, 4080]), [False, True])
    assert detector.expose(np.full(10, 9000.0), np.random.default_rng(0)).max() == 4080
    with pytest.raises(DataError, match="full_scale is 5000, but 12 bits end at 4095"):
        Detector(bits=12, full_scale=5000)


def test_means_need_their_number():
    means = picture(12, 0.4) + np.float32(0.25)
    with pytest.raises(DataError, match=r"float32, as means of several exposures are: .* exposures = 100"):
        frames_of(means, bits=12)
    frames = ConvertedFrames(ArrayFrames(means[None, None]), Detector(bits=12), 4)
    np.testing.assert_array_equal(read(frames), means)
    with pytest.raises(DataError, match=r"the largest of the numbers is 1: .* multiply by 4095"):
        ConvertedFrames(ArrayFrames(means[None, None] / means.max()), Detector(bits=12), 4)
    # means of numbers in the upper end are divided, if that is stated
    left = ConvertedFrames(ArrayFrames(16 * means[None, None]), Detector(bits=12, alignment="left"), 4)
    np.testing.assert_array_equal(read(left), means)


@pytest.mark.parametrize(
    ("numbers", "detector", "message"),
    [
        (np.array([5000, 32]), {"bits": 12}, "reads 5000, but 12 bits end at 4095: set bits = 13"),
        (np.array([40000, 33]), {"bits": 12}, "set bits = 16"),
        (np.array([40000, 32]), {"bits": 12}, 'set alignment = "left"'),
        (picture() << 4, {"bits": 8}, 'set bits = 12 and alignment = "left"'),
        (
            picture(bits=10) << 2,
            {"bits": 10},
            "10 bits in the upper end of 12: set bits = 12 and full_scale = 4092",
        ),
        (np.array([5000.5]), {"bits": 12}, 'set bits = 13, .* or alignment = "left" if they are means'),
        (np.array([70000]), {"bits": 16}, "give numbers of 16 bits at most"),
        (np.array([-1], dtype=np.int16), {"bits": 12}, "a pixel reads -1"),
        (np.array([1], dtype=np.uint8), {"bits": 12}, "its numbers have 8 bits, .* set bits = 8"),
    ],
)
def test_advice_on_numbers_out_of_range(numbers, detector, message):
    with pytest.raises(DataError, match=message):
        require_range(numbers, Detector(**detector))


@pytest.mark.parametrize("repeats", [1, 2])
def test_pictures_of_nothing_but_zero_are_told(repeats):
    """As the end of a stack reads that was made first and filled until its writer was killed."""
    numbers = np.random.default_rng(6).integers(80, 3000, (3, repeats, 4, 30, 20)).astype(np.uint16)
    whole = ConvertedFrames(Repeated(numbers), Detector(bits=12))
    numbers = numbers.copy()
    numbers[1, -1, 3] = numbers[2] = 0
    numbers[0, :, 0, :15] = 0  # half a picture may be dark
    half = ConvertedFrames(Repeated(numbers), Detector(bits=12))
    black = ConvertedFrames(Repeated(np.zeros_like(numbers)), Detector(bits=12))
    for frames in (whole, half, black):
        for series in range(3):
            for row in (0, 15):
                frames.read(series, row, row + 15)
    assert not [note for note in (*whole.notes, *black.notes) if "0 at every pixel" in note]
    (told,) = [note for note in half.notes if "0 at every pixel" in note]
    assert told.startswith(
        "0 at every pixel that was read: state 4 of the series '2', state 1 of the series '3', state 2 of the series "
        f"'3' and {1 + 4 * repeats - 3} more. If the camera saw light"
    )


class Repeated:
    """Frames of an array (series, repeat, state, row, column)."""

    def __init__(self, array):
        self.array, self.names = array, tuple("123")
        _, self.layers, self.states, self.rows, self.columns = array.shape

    def read(self, series, first_row, last_row):
        part = self.array[series, :, :, first_row:last_row]
        return part if self.layers > 1 else part[0]
