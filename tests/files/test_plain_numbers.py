"""What is a number, and what only Python takes for one."""

from __future__ import annotations

import math

import pytest

from pbrdf.files.plain_numbers import count_from_text, json_from_text, number_from_text, toml_from_text


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), (" -1.5e-3 ", -0.0015), ("+.5", 0.5), ("2.", 2.0), ("1E5", 1e5), ("-inf", -math.inf)],
)
def test_numbers(text, value):
    assert number_from_text(text) == value


def test_what_is_missing_is_a_number_to_ask_for():
    assert math.isnan(number_from_text("NaN"))


@pytest.mark.parametrize(
    "text", ["", " ", "1_0", "٣", "１", "1,5", "0x10", "1e", ".", "1 2", "true", "--1", "infinite"]
)
def test_others_are_none(text):
    with pytest.raises(ValueError, match="is not a number"):
        number_from_text(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": 1,\n}', r"line 2 column 1"),
        ("[" * 100_000, "brackets stand too deep in each other"),
        ("9" * 5000, "an integer has more digits than a number can have"),
        (b"\xff", "utf-8"),
    ],
)
def test_a_json_text_that_is_none_says_why(text, words):
    with pytest.raises(ValueError, match=words):
        json_from_text(text)


@pytest.mark.parametrize("text", ["a = " + "[" * 10_000, "a = " + "9" * 5000, "a = 1\na = 2"])
def test_a_toml_text_that_is_none_says_why(text):
    with pytest.raises(ValueError, match=r"too deep|more digits|Cannot overwrite"):
        toml_from_text(text)


def test_texts_that_are_right():
    assert json_from_text('{"a": [1, 2.5]}') == {"a": [1, 2.5]}
    assert toml_from_text("a = 1_000") == {"a": 1000}


@pytest.mark.parametrize("text", ["", "-1", "+1", "1.0", "1_0", "٣", " 1", "9" * 5000])
def test_what_is_no_count(text):
    with pytest.raises(ValueError, match="is not a count"):
        count_from_text(text)
    assert count_from_text("007") == 7
