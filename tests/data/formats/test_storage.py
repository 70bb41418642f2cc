from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pbrdf.data.formats.storage import (
    atomic_target,
    decode_attribute,
    encode_attribute,
    exact_degrees,
    read_lines,
)
from pbrdf.errors import DataError


def test_whole_degrees_come_back_as_whole_degrees():
    degrees = np.arange(-360.0, 361.0)
    assert_array_equal(exact_degrees(np.deg2rad(degrees)), degrees)


@given(st.floats(-360, 360))
def test_degrees_exist_for_every_angle_that_came_from_degrees(degrees):
    radians = np.deg2rad(np.array([degrees, np.nan]))
    found = exact_degrees(radians)
    assert found is not None
    assert_array_equal(np.deg2rad(found), radians)
    assert np.signbit(found[0]) == np.signbit(degrees)


def test_an_angle_too_large_for_degrees_has_none():
    assert exact_degrees(np.array([1e308])) is None


def test_angles_between_the_images_of_two_degrees_are_reported():
    radians = 0.9 + np.arange(100) * np.spacing(0.9)
    degrees = [exact_degrees(radians[i : i + 1]) for i in range(100)]
    missed = [d is None for d in degrees]
    assert 0 < sum(missed) < 30
    # Brute force: no double nearby has this image.
    for index in np.flatnonzero(missed):
        start = np.rad2deg(radians[index])
        nearby = start + np.arange(-50, 51) * np.spacing(start)
        assert radians[index] not in np.deg2rad(nearby)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("white paint", "white paint"),
        ("Größe: 5 µm", "Größe: 5 µm"),
        ("12", '"12"'),
        (12, "12"),
        (1.5, "1.5"),
        (" x", '" x"'),
        ("two\nlines", '"two\\nlines"'),
        ('"quoted"', '"\\"quoted\\""'),
        (["a", "b"], '["a", "b"]'),
        ("007", "007"),
    ],
)
def test_attributes_are_plain_where_they_can_be(value, text):
    assert encode_attribute("note", value) == text
    assert decode_attribute("note", text) == value


def test_a_title_is_text_even_if_it_looks_like_a_number():
    assert decode_attribute("title", "2017") == "2017"
    assert decode_attribute("date", "2017") == 2017


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_target(path) as target:
        target.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path):
    with (
        pytest.raises(DataError, match="cannot be written"),
        atomic_target(tmp_path / "no" / "x.csv") as target,
    ):
        target.write_text("")


def test_text_that_is_not_utf8_is_refused_with_its_line(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes(b"# title: ok\n# source: Gr\xf6\xdfe\n")
    with pytest.raises(DataError, match="line 2: not UTF-8"):
        read_lines(path)


def test_lines_end_at_line_ends_only(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes("\ufeffa\u2028b\r\nc\x0cd\n".encode())
    assert read_lines(path) == ["a\u2028b", "c\x0cd", ""]


def test_a_file_in_place_of_the_folder_is_reported_as_such(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with (
        pytest.raises(DataError, match="cannot be written"),
        atomic_target(tmp_path / "file" / "x.csv") as target,
    ):
        target.write_text("x")
