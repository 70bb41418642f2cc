"""Decimal numbers: what is one, and that columns of them are parsed to the bits that ``float`` gives."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pbrdf.errors import DataError
from pbrdf.files.delimited import read_table
from pbrdf.files.numbers import PADDING, parse_cells, to_number


def parsed(texts, decimal_comma=False):
    text = b"0" * (PADDING - 1) + b"\n" + "".join(f"{text}\n" for text in texts).encode() + b"0" * PADDING
    buffer = np.frombuffer(text, dtype=np.uint8)
    special = np.flatnonzero((buffer - np.uint8(48)) > 9)
    ends = np.flatnonzero(buffer[special] == 10)
    values, odd = parse_cells(buffer, special, ends[:-1], ends[1:], decimal_comma)
    return values, set(odd.tolist())


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0), ("-1.5", -1.5), ("+.5", 0.5), ("5.", 5.0), ("1e5", 1e5), ("1E+05", 1e5), ("1.25e-3", 1.25e-3),
        ("1.0D-3", 1e-3), ("2d2", 200.0), ("\u22121.5", -1.5), ("-0.0", -0.0), ("007", 7.0),
        ("inf", math.inf), ("-Infinity", -math.inf), ("1e999", math.inf), ("9" * 300, float("9" * 300)),
    ],
)  # fmt: skip
def test_numbers(text, value):
    found = to_number(text)
    assert found == value
    assert math.copysign(1.0, found) == math.copysign(1.0, value)


@pytest.mark.parametrize(
    "text",
    [
        "", "-", ".", "+.", "e5", "1e", "1e+", "1_0", "٣", "1٣", "٣.5", "0x1F", "True", "None", "1,5", "1,234.5", "1 2",
        "--1", "1-2", "1.2.3", "1..2", "1e5.5", "1e5e5", "½", "1²", "１", "nan1", "infinit", "1" * 500, "0b1", "1j",
    ],
)  # fmt: skip
def test_what_is_no_number(text, tmp_path):
    assert to_number(text) is None
    if text and "," not in text and text != "1 2":
        values, odd = parsed([text, "1"])
        assert odd == {0}
        assert_array_equal(values, [np.nan, 1.0])
        (tmp_path / "t.csv").write_text(f"a,b\n1,2\n3,{text}\n", encoding="utf-8")
        with pytest.raises(DataError, match=r"t\.csv: line 3, column 'b': .* is not a number"):
            read_table(tmp_path / "t.csv").numbers(1)


def test_not_a_number_is_a_number():
    for text in ("nan", "NaN", "-nan", "-nan(ind)", "1.#QNAN", "-1.#IND"):
        assert math.isnan(to_number(text))


def test_decimal_commas_only_where_they_are_allowed():
    assert to_number("1,5", decimal_comma=True) == 1.5
    assert to_number("-,25e-1", decimal_comma=True) == -0.025
    assert to_number("1.234,5", decimal_comma=True) is None
    values, odd = parsed(["1,5", "2.5", "1,2,3", "1.2,3"], decimal_comma=True)
    assert_array_equal(values, [1.5, 2.5, np.nan, np.nan])
    assert odd == {2, 3}


def test_columns_have_the_bits_of_single_numbers():
    rng = np.random.default_rng(11)
    values = [
        *(rng.uniform(-1, 1, 4000) * 10.0 ** rng.integers(-25, 25, 4000)).tolist(),
        0.0,
        -0.0,
        5e-324,
        1e308,
    ]
    values += [struct.unpack("d", bits.tobytes())[0] for bits in rng.integers(0, 2**63 - 2**53, 2000)]
    forms = ("{!r}", "{:.18e}", "{:.16e}", "{:.6g}", "{:.3f}", "{:.12f}", "{:.0f}")
    texts = [forms[k % len(forms)].format(value) for k, value in enumerate(values)]
    # What lies in the middle between two numbers, or nearly.
    texts += [
        str(2**53 + 1),
        str(2**53 + 3),
        "9007199254740993.0",
        "0.5000000000000000277",
        "1.00000000000000011102",
    ]
    found, odd = parsed(texts)
    wanted = np.array([float(text) for text in texts])
    plain = np.array([row not in odd for row in range(len(texts))])
    assert plain[[len(text) < 24 and "e" not in text for text in texts]].mean() > 0.9
    assert_array_equal(found[plain].view(np.int64), wanted[plain].view(np.int64))
    assert np.isnan(found[~plain]).all()


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1),
    st.integers(0, 20),
    st.sampled_from("efg"),
)
def test_any_float_in_any_form(values, digits, form):
    texts = [format(value, f".{digits}{form}") for value in values]
    found, odd = parsed(texts)
    for row, text in enumerate(texts):
        if row not in odd:
            assert struct.pack("d", found[row]) == struct.pack("d", float(text))


@given(st.lists(st.text("0123456789+-.,eEdD_ nax", min_size=1, max_size=12), min_size=1), st.booleans())
def test_columns_know_no_numbers_that_single_texts_are_not(texts, decimal_comma):
    found, odd = parsed(texts, decimal_comma)
    for row, text in enumerate(texts):
        if row not in odd:
            assert found[row] == to_number(text, decimal_comma)


def test_thousands_are_refused_with_what_to_do(tmp_path):
    path = tmp_path / "t.csv"
    for cell in ("1,234.5", "1.234,5", "1'234", "12 345.5", "1\u202f234"):
        path.write_text(f"a;b\n1;{cell}\n", encoding="utf-8")
        with pytest.raises(
            DataError, match=r"line 2, column 'b': .* is not a number; leave out the marks of thousands"
        ):
            read_table(path).numbers(1)
    path.write_text('a,b\n1,"1,234.5"\n')
    with pytest.raises(DataError, match="is not a number; leave out the marks of thousands"):
        read_table(path).numbers(1)
    path.write_text("a;b\n1;2.5\n2;1,234\n")
    with pytest.raises(DataError, match="line 3, column 'b': '1,234': decimals or thousands"):
        read_table(path).numbers(1)
    path.write_text("a;b\n1;2,5\n2;1,234\n")
    assert read_table(path).numbers(1).tolist() == [2.5, 1.234]


def test_a_huge_cell_is_named_in_a_short_line(tmp_path):
    path = tmp_path / "t.csv"
    for cell in ("7" * 300_000, "x" * 300_000, '"' + "y" * 100_000 + '"'):
        path.write_text(f"a,b\n1,2\n3,{cell}\n")
        with pytest.raises(DataError, match=r"line 3, column 'b': '.*…? is not a number") as told:
            read_table(path).numbers(1)
        assert len(str(told.value)) < 300
