from __future__ import annotations

import pytest

from pbrdf.errors import DataError
from pbrdf.files.text import read_lines


def test_text_that_is_not_utf8_is_refused_with_its_line(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes(b"# title: ok\n# source: Gr\xf6\xdfe\n")
    with pytest.raises(DataError, match="line 2: not UTF-8"):
        read_lines(path)


def test_lines_end_at_line_ends_only(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes("\ufeffa\u2028b\r\nc\x0cd\n".encode())
    assert read_lines(path) == ["a\u2028b", "c\x0cd", ""]
