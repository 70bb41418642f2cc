import json
import math

import numpy as np
import pytest

from pbrdf.report.numbers import brief, per_cent, plain, with_error


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0397812, 0.000123, "0.03978 ± 0.00012"),
        (1.6207, 0.0996, "1.62 ± 0.10"),
        (1.6207, 0.0994, "1.621 ± 0.099"),
        (-0.031, 0.012, "−0.031 ± 0.012"),
        (25.3, 4.2, "25.3 ± 4.2"),
        (253.4, 42.0, "253 ± 42"),
        (123456.0, 4321.0, "123500 ± 4300"),
        (3.2e-9, 1.5e-10, "(3.20 ± 0.15)e-09"),
        (0.0, 0.012, "0.000 ± 0.012"),
        (1.5, math.nan, "1.5"),
        (1.5, 0.0, "1.5"),
    ],
)
def test_value_and_error_are_rounded_alike(value, error, text):
    assert with_error(value, error) == text


def test_an_exact_value_keeps_readable_digits():
    assert with_error(1.797719684384770256, 5.5e-17) == "1.797719684 ± 5.5e−17"


def test_numbers_are_brief():
    assert brief(-0.123456) == "−0.1235"
    assert brief(13202.0, 3) == "13200"
    assert brief(math.nan) == "–"
    assert brief(-math.inf) == "−∞"
    assert brief(2.5e-9, 2) == "2.5e-09"


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0036, "0.36 %"),
        (0.0123, "1.2 %"),
        (0.123, "12 %"),
        (3.5, "350 %"),
        (0.0, "0 %"),
        (math.nan, "–"),
        (2e-15, "2e−13 %"),
    ],
)
def test_per_cent_has_two_digits(share, text):
    assert per_cent(share) == text


def test_plain_values_are_json():
    value = {
        "a": np.array([1.0, np.nan]),
        "b": (np.int64(3), math.inf),
        4: np.float64(2.0),
        "c": "text",
        "d": np.True_,
    }
    text = json.dumps(plain(value), allow_nan=False)
    assert json.loads(text) == {"a": [1.0, None], "b": [3, None], "4": 2.0, "c": "text", "d": True}
