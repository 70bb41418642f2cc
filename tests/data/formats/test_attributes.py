from __future__ import annotations

import pytest

from pbrdf.data.formats.attributes import decode_attribute, encode_attribute


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
