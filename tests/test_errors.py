"""Messages quote what stands in files, and do not obey it."""

from __future__ import annotations

import pytest

from pbrdf.errors import DataError, visible


def test_characters_that_command_a_terminal_are_spelled():
    text = "a\x1b[31mb\x07\r\x9b\u202ec\x00"
    assert visible(text) == r"a\x1b[31mb\x07\r\x9b\u202ec\x00"
    assert str(DataError(text)) == visible(text)


@pytest.mark.parametrize("text", ["", "φ = 0 → вперёд, 30°", "two\nlines\tand a tabulator", "日本", "\\x1b"])
def test_all_others_stay(text):
    assert visible(text) == text
