"""One geometry measured more than once."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.data import check, make_dataset
from pbrdf.data.repeats import find_repeats, separating_column


def built(I, theta_r=(20, 20, 30), **more):  # noqa: E741
    return make_dataset(np.deg2rad(30), np.deg2rad(theta_r), 0.0, quantity="brdf", I=I, **more)


def test_exact_copies_are_counted():
    ds = built([0.3, 0.3, 0.3, 0.3, 0.4], (20, 20, 20, 30, 30), std={"I": 0.01})
    found = find_repeats(ds)
    assert found.copies.tolist() == [1, 2]
    assert found.originals.tolist() == [0, 0]
    words = [str(issue) for issue in check(ds)]
    assert any(w.startswith("2 rows are exact copies of others (index 1 of index 0)") for w in words)


def test_a_copy_has_all_that_was_measured_the_same():
    """Values not measured in either row are the same, another uncertainty is not."""
    both = built([0.3, 0.3, 0.3], Q=[np.nan, np.nan, 0.1])
    assert find_repeats(both).copies.tolist() == [1]
    assert find_repeats(built([0.3, 0.3, 0.3], std={"I": [0.1, 0.2, 0.1]})).copies.size == 0
    assert find_repeats(built([0.3, 0.3, 0.3], wavelength=[450, 550, 550])).copies.size == 0
    assert find_repeats(built([0.3, 0.3, 0.3], group=[1, 2, 2])).copies.size == 0


@pytest.mark.parametrize(
    ("values", "more", "disagree"),
    [
        ([0.300, 0.301, 0.5], {}, False),
        ([0.30, 0.36, 0.5], {}, True),
        ([0.30, 0.36, 0.5], {"std": {"I": 0.02}}, False),
        ([0.30, 0.32, 0.5], {"std": {"I": 0.001}}, True),
        ([0.30, 0.30, 0.5], {"Q": [0.1, -0.1, 0.0]}, True),
        ([0.30, 0.30, 0.5], {"Q": [0.001, -0.001, 0.0]}, False),
        ([0.30, 0.30, 0.5], {"dolp": [0.1, 0.4, 0.0]}, True),
        ([0.30, np.nan, 0.5], {}, False),
    ],
)
def test_repeats_disagree_beyond_their_uncertainty(values, more, disagree):
    found = find_repeats(built(values, **more))
    assert found.disagreeing.tolist() == ([0, 1] if disagree else [])


def test_mueller_matrices_that_disagree():
    matrix = np.stack([np.eye(4), np.eye(4) - 0.3 * np.eye(4), np.eye(4)])
    ds = make_dataset(0.5, [0.3, 0.3, 0.4], 0.0, quantity="brdf", mueller=matrix)
    assert find_repeats(ds).disagreeing.tolist() == [0, 1]


def test_the_column_that_tells_repeats_apart():
    found = find_repeats(built([0.3, 0.6, 0.3, 0.6, 1.0, 2.0], (20, 20, 30, 30, 40, 40)))
    columns = {"same": ["x"] * 6, "all": list("abcdef"), "half": ["a", "a", "a", "b", "a", "b"]}
    assert separating_column(found, columns) is None
    assert separating_column(found, columns | {"paint": ["w", "b"] * 3}) == ("paint", ["w", "b"])


def test_the_mirror_of_signed_zero_is_the_same_place():
    ds = make_dataset([0.5, 0.5], [0.0, -0.0], 0.0, quantity="brdf", I=[0.3, 0.3])
    assert find_repeats(ds).copies.tolist() == [1]
