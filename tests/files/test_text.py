from __future__ import annotations

from pathlib import Path

import pytest

from pbrdf.errors import DataError
from pbrdf.files.text import read_lines, read_toml, utf8


def test_toml_that_is_not_utf8_is_refused_with_its_line(tmp_path):
    path = tmp_path / "data.toml"
    path.write_bytes(b"# title: ok\n# source: Gr\xf6\xdfe\n")
    with pytest.raises(DataError, match="line 2: not UTF-8"):
        read_toml(path)


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16", "utf-16-be", "utf-16-le"]
)
def test_encodings_that_programs_write(tmp_path, encoding):
    path = tmp_path / "data.csv"
    text = "# size: 5 µm at 30°\r\ntheta_i,theta_r\r\n30,40\r\n"
    path.write_bytes(text.encode(encoding))
    assert read_lines(path) == text.split("\r\n")


def test_utf16_with_its_marks_of_either_order(tmp_path):
    path = tmp_path / "data.csv"
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        path.write_bytes(mark + "σ\nб\n".encode(encoding))
        assert read_lines(path) == ["σ", "б", ""]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a,b\n1,\x00\n", r"line 2: a byte 0x00 is in no text"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", r"line 3: a byte 0x"),
        (b"caf\xe9\n\n\x02\n", r"line 3: a byte 0x02 is in no text; this is a binary file, or a damaged one"),
    ],
)
def test_bytes_of_no_text_are_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / "data.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match=message) as told:
        read_lines(path)
    assert "\n" not in str(told.value)


def test_the_end_of_a_part_within_a_character_is_no_other_encoding():
    assert utf8(Path("x"), "30°".encode()[:-1]).startswith(b"30")
    assert "Â" not in utf8(Path("x"), ("30°" * 5).encode()[:-1]).decode(errors="replace")


def test_lines_end_at_line_ends_only(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes("\ufeffa\u2028b\r\nc\x0cd\n".encode())
    assert read_lines(path) == ["a\u2028b", "c\x0cd", ""]
