"""What refits keep: the lowest χ² met, and the lower of two tries."""

from __future__ import annotations

import numpy as np
from closed_form_helpers import closed_form

from pbrdf.inversion.refits import Lowest, Refit


def test_the_lowest_of_each_data_set_passes_over_points_without_chi2():
    u = np.arange(6.0).reshape(2, 3, 1)
    refit = Refit(u, np.array([[3.0, np.nan, 2.0], [1.0, 4.0, np.nan]]), np.ones((2, 3), dtype=bool))
    lowest = refit.lowest()
    assert lowest.chi2.tolist() == [2.0, 1.0] and lowest.u.tolist() == [[2.0], [3.0]]


def test_the_lower_of_two_is_taken_for_each_data_set_and_the_first_where_equal():
    first = Lowest(np.array([1.0, 5.0, 2.0]), np.array([[1.0], [1.0], [1.0]]))
    second = Lowest(np.array([3.0, 4.0, 2.0]), np.array([[2.0], [2.0], [2.0]]))
    both = first.or_lower(second)
    assert both.chi2.tolist() == [1.0, 4.0, 2.0]
    assert both.u.tolist() == [[1.0], [2.0], [1.0]]


def test_lanes_are_tried_again_from_others_and_keep_what_is_lower_by_enough():
    """χ² = x² + w(y) with y staying at the start of its lane: 9 from y = 0, 4 from y = 1, 3.9 from y = 2."""

    def formula(held, u):
        return u, u[..., 0] ** 2 + np.choose(np.round(u[..., 1]).astype(int), [9.0, 4.0, 3.9])

    optima = closed_form(formula, np.zeros((1, 2)), np.ones((1, 2)), np.eye(2), -10.0, 10.0)
    held = np.tile([True, False], (4, 1))
    start = np.array([[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 0.0]]])
    found = optima.refit(held, start)
    found.chi2[0, 3] = np.nan
    assert found.chi2[0, :3].tolist() == [9.0, 5.0, 7.9]
    # 0 from 1 gains 5, 1 from 2 only 0.1, and 3 had no χ² at all
    assert optima.retry(found, held, np.array([0, 1, 3]), np.array([1, 2, 0]), worth=0.5)
    assert found.chi2[0].tolist() == [4.0, 5.0, 7.9, 18.0]
    assert found.u[0].tolist() == [[0.0, 1.0], [1.0, 1.0], [2.0, 2.0], [3.0, 0.0]]
    assert not optima.retry(found, held, np.array([1]), np.array([2]), worth=0.5)
    calls = len(optima.calls)
    assert not optima.retry(found, held, np.array([], dtype=int), np.array([], dtype=int), worth=0.5)
    assert len(optima.calls) == calls
