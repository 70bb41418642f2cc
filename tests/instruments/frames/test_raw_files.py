"""Files of nothing but pixels, packed by an independent writer of bits, byte for byte."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.frames.raw_files import RawFormat, open_raw
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane

FORMATS = (
    "Mono8",
    "Mono10",
    "Mono12",
    "Mono14",
    "Mono16",
    "Mono10p",
    "Mono12p",
    "Mono10Packed",
    "Mono12Packed",
)


def bits_of(name):
    return int("".join(c for c in name if c.isdigit()))


def packed(numbers, name):
    """Bytes of a picture as a camera sends them: a string of bits, or byte by byte."""
    flat, bits = [int(v) for v in np.ravel(numbers)], bits_of(name)
    if name.endswith("p"):
        stream = "".join(f"{v:0{bits}b}"[::-1] for v in flat)
        stream += "0" * (-len(stream) % 8)
        return bytes(int(stream[i : i + 8][::-1], 2) for i in range(0, len(stream), 8))
    if name.endswith("Packed"):
        out = bytearray()
        for first, second in zip(flat[::2], flat[1::2], strict=True):
            low = bits - 8
            out += bytes([first >> low, (first & (2**low - 1)) | (second & (2**low - 1)) << 4, second >> low])
        return bytes(out)
    return b"".join(v.to_bytes(1 if bits == 8 else 2, "little") for v in flat)


def numbers_of(name, shape, seed=0):
    return np.random.default_rng(seed).integers(0, 2 ** bits_of(name), shape)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("width", [8, 6])
def test_pictures_and_rows(tmp_path, name, width):
    """Two pictures after a header; rows that begin within a group of pixels."""
    pictures = numbers_of(name, (2, 6, width))
    content = b"head" + b"".join(packed(picture, name) for picture in pictures)
    (tmp_path / "a.raw").write_bytes(content)
    file = open_raw(tmp_path / "a.raw", RawFormat(width, 6, name, header=4))
    assert file.count == 2
    for k in range(2):
        np.testing.assert_array_equal(file.read(k, 0, 6), pictures[k])
        np.testing.assert_array_equal(file.read(k, 1, 4), pictures[k, 1:4])
        np.testing.assert_array_equal(file.read(k, 5, 6), pictures[k, 5:])


def test_the_bytes_of_the_standard():
    """0xABC and 0x123 as GenICam's Mono12p and GigE Vision's Mono12Packed have them."""
    assert packed([0xABC, 0x123], "Mono12p") == bytes([0xBC, 0x3A, 0x12])
    assert packed([0xABC, 0x123], "Mono12Packed") == bytes([0xAB, 0x3C, 0x12])
    assert packed([0x3FF, 0, 0, 0x201], "Mono10p") == bytes([0xFF, 0x03, 0x00, 0x40, 0x80])


def test_an_odd_number_of_pixels_ends_within_a_byte(tmp_path):
    picture = numbers_of("Mono12p", (3, 5))
    (tmp_path / "a.raw").write_bytes(packed(picture, "Mono12p"))
    np.testing.assert_array_equal(
        open_raw(tmp_path / "a.raw", RawFormat(5, 3, "Mono12p")).read(0, 0, 3), picture
    )


CAMERA = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))


def camera(bits=12, **frames):
    return Instrument(CAMERA, Detector(bits=bits), frames=frames)


@pytest.mark.parametrize("name", ["Mono12p", "BayerRG12p", "mono12Packed", "PolarizeMono12p"])
def test_a_mosaic_camera(tmp_path, name):
    known = "Mono12Packed" if "acked" in name else "Mono12p"
    picture = numbers_of(known, (4, 8))
    raw = {"width": 8, "height": 4, "format": name}
    for suffix in ("raw", "bin", "dat"):
        (tmp_path / suffix).mkdir()
        (tmp_path / suffix / f"shot.{suffix}").write_bytes(packed(picture, known))
        frames = open_frames(tmp_path / suffix / f"shot.{suffix}", camera(raw=raw))
        np.testing.assert_array_equal(frames.read(0, 0, 2)[0], picture[::2, ::2])
        folder = open_frames(tmp_path / suffix, camera(raw=raw, pattern=f"{{series}}.{suffix}"))
        np.testing.assert_array_equal(folder.read(0, 1, 2)[3], picture[3::2, 1::2])


def test_sizes_that_do_not_fit(tmp_path):
    (tmp_path / "a.raw").write_bytes(bytes(8 * 4 * 3 // 2))
    with pytest.raises(DataError, match=r"does not say how they stand in it: set raw = { width"):
        open_frames(tmp_path / "a.raw", camera())
    wrong = {"width": 8, "height": 4, "format": "Mono16"}
    with pytest.raises(
        DataError,
        match=r"48 bytes are not whole pictures: 8 × 4 pixels of Mono16 take 64 .* size fits Mono12p",
    ):
        open_frames(tmp_path / "a.raw", camera(raw=wrong))
    empty = tmp_path / "b.raw"
    empty.write_bytes(b"")
    with pytest.raises(DataError, match="0 bytes are not whole pictures"):
        open_frames(empty, camera(raw=wrong))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("Mono12p", "give { width = 2448"),
        ({"width": 8, "height": 4}, "give { width = 2448"),
        ({"width": 8, "height": 4, "format": "Mono12p", "depth": 3}, "give { width = 2448"),
        ({"width": 8.5, "height": 4, "format": "Mono12p"}, "width is 8.5: give a whole number from 1"),
        ({"width": 8, "height": 4, "format": "RGB8"}, "format 'RGB8' is not known; use Mono8"),
        ({"width": 8, "height": 4, "format": "Mono12p", "header": -1}, "header is -1"),
    ],
)
def test_mistakes_in_the_table(tmp_path, table, message):
    (tmp_path / "a.raw").write_bytes(bytes(48))
    with pytest.raises(DataError, match=message):
        open_frames(tmp_path / "a.raw", camera(raw=table))
