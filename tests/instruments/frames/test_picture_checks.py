"""A picture that cannot be what it says is refused before it is read."""

from __future__ import annotations

import numpy as np
import pytest
import tifffile
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.instruments.frames.picture_checks import require_checksums, require_pages, require_possible
from pbrdf.instruments.frames.pictures import open_pictures


@pytest.fixture
def png(tmp_path):
    path = tmp_path / "a.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 4096, (20, 30)).astype(np.uint16)).save(path)
    return path


def test_a_whole_file_passes(png):
    require_checksums(png)
    assert open_pictures(png).read(0, 0, 20).shape == (20, 30)


def test_every_single_damaged_byte_is_found(png):
    """Among them those of the pixels' own checksums, which decoders do not look at."""
    whole = png.read_bytes()
    for at in range(8, len(whole), 11):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        png.write_bytes(damaged)
        with pytest.raises(DataError, match=r"a\.png: cannot be read as a picture: "):
            require_checksums(png)


def test_a_wrong_checksum_of_the_pixels_is_named_when_they_are_read(png):
    whole = png.read_bytes()
    at = whole.index(b"IDAT")
    length = int.from_bytes(whole[at - 4 : at], "big")
    damaged = bytearray(whole)
    damaged[at + 4 + length] ^= 1
    png.write_bytes(damaged)
    picture = open_pictures(png)
    with pytest.raises(DataError, match=r"the checksum of its part b'IDAT' at byte \d+ is wrong"):
        picture.read(0, 0, 20)


def test_a_file_that_is_cut_off_is_told(png):
    whole = png.read_bytes()
    for length in (len(whole) - 1, len(whole) - 12, 40, 9, 3):
        png.write_bytes(whole[:length])
        with pytest.raises(DataError, match=r"cut off|not a PNG file"):
            require_checksums(png)


def test_more_pixels_than_the_file_can_hold_are_refused(tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(bytes(100))
    require_possible(path, (2, 1000, 1000), np.dtype("u2"))
    with pytest.raises(
        DataError, match=r"a\.tif: declares 100000 × 100000 pixels, 20 GB, which a file of this"
    ):
        require_possible(path, (100_000, 100_000), np.dtype("u2"))


@pytest.mark.parametrize("big", [False, True], ids=["classic", "BigTIFF"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_pages_of_a_tiff_stand_within_the_file(tmp_path, big, order):
    path = tmp_path / "a.tif"
    frames = np.random.default_rng(0).integers(0, 4096, (3, 20, 30)).astype(np.uint16)
    with tifffile.TiffWriter(path, bigtiff=big, byteorder=order) as file:
        for frame in frames:
            file.write(frame)
    require_pages(path)
    assert np.array_equal(open_pictures(path).read(2, 0, 20), frames[2])

    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(
        DataError, match=r"a\.tif: cannot be read as a picture: page \d stands outside of the file"
    ):
        open_pictures(path)
    path.write_bytes(b"MZ" + bytes(30))
    with pytest.raises(DataError, match="this is not a TIFF file"):
        open_pictures(path)
