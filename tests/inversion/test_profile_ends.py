"""Ends of intervals on χ² in closed form: where they are, how many calls they take, and what is said of them."""

from __future__ import annotations

import numpy as np
from closed_form_helpers import closed_form, one_unknown, quadratic
from linear_helpers import design, linear_fit
from scipy import stats

from pbrdf.inversion import profile_ends
from pbrdf.inversion.profile_bracket import PRECISION
from pbrdf.inversion.profile_ends import interval_ends
from pbrdf.inversion.refits import Optima

FOUR = np.array([4.0])


def test_many_data_sets_at_once_give_what_each_gives_alone(monkeypatch):
    rng = np.random.default_rng(8)
    sets = [design() @ [1.0, -2.0, 0.5] + rng.standard_normal(30) for _ in range(7)]
    fits = [linear_fit(monkeypatch, design(), y) for y in sets]
    together = Optima.at(
        fits[0].space, sets, np.stack([f.unknowns for f in fits]), np.stack([f.information for f in fits])
    )
    ends = interval_ends(together, np.full(7, stats.chi2.ppf(0.95, 1)), [0, 2])
    error = np.sqrt(np.diag(np.linalg.inv(fits[0].information)))
    assert ends.found.all()
    for result, found in zip(fits, ends.value, strict=True):
        expected = [result.unknowns[i] + s * 1.95996 * error[i] for i in (0, 2) for s in (-1, 1)]
        np.testing.assert_allclose(found, expected, atol=1e-3 * error.min())


def test_a_quadratic_takes_few_calls_even_from_a_wrong_error():
    for error in (0.3, 1.0, 3.0):
        optima = one_unknown(lambda u: 7.0 + u * u, error=error)
        ends = interval_ends(optima, FOUR, [0])
        assert len(optima.calls) <= 4
        np.testing.assert_allclose(ends.value, [[-2.0, 2.0]], rtol=PRECISION)
        assert ends.found.all() and not ends.at_bound.any()
        assert ends.lowest.chi2.tolist() == [7.0]


def test_a_skewed_chi2_gives_its_two_unequal_ends():
    """χ² = (eᵘ − 3)²: the ends are ln(3 ± 2), the lower one twice as far away."""
    optima = one_unknown(lambda u: (np.exp(u) - 3.0) ** 2, u=np.log(3.0), error=1.0 / 3.0)
    ends = interval_ends(optima, FOUR, [0])
    away = np.log([1.0, 5.0]) - np.log(3.0)
    np.testing.assert_allclose(ends.value[0] - np.log(3.0), away, rtol=2.0 * PRECISION)
    assert ends.found.all() and len(optima.calls) <= 8


def test_an_edge_of_the_model_is_an_end():
    """No finite residuals above 1.3, where χ² is still far below the threshold."""
    optima = one_unknown(lambda u: np.where(u > 1.3, np.nan, u * u))
    ends = interval_ends(optima, FOUR, [0])
    np.testing.assert_allclose(ends.value, [[-2.0, 1.3]], rtol=PRECISION)
    assert ends.found.all() and not ends.at_bound.any()


def test_a_chi2_that_never_rises_enough_ends_at_its_bounds():
    optima = one_unknown(lambda u: 3.0 * np.tanh(u) ** 2, error=1.0 / np.sqrt(3.0), low=-30.0, high=70.0)
    ends = interval_ends(optima, FOUR, [0])
    assert ends.value.tolist() == [[-30.0, 70.0]]
    assert ends.at_bound.all() and ends.found.all()


def test_an_unknown_between_equal_bounds_takes_no_call():
    optima = one_unknown(lambda u: u * u, low=0.0, high=0.0)
    ends = interval_ends(optima, FOUR, [0])
    assert optima.calls == [] and ends.at_bound.all() and ends.found.all()
    assert ends.value.tolist() == [[0.0, 0.0]]


def test_ends_lie_where_the_other_unknown_follows_until_its_bound():
    """χ² = 2x² + 2xy + 2y², y at best −x/2: 1.5 x² below, and 2x² − x/2 + 1/8 above x = 1/2, where y meets −1/4."""
    optima = quadratic([[2.0, 1.0], [1.0, 2.0]], low=[-50.0, -0.25])
    ends = interval_ends(optima, FOUR, [0])
    above = (0.5 + np.sqrt(0.25 + 8.0 * (4.0 - 0.125))) / 4.0
    np.testing.assert_allclose(ends.value, [[-np.sqrt(4.0 / 1.5), above]], rtol=PRECISION)
    assert ends.blocked.tolist() == [[[False, False], [False, True]]]
    # per unit of x, whichever side
    np.testing.assert_allclose(ends.path, [[[1.0, -0.5], [1.0, -0.25 / above]]], rtol=1e-2)


def test_an_end_beyond_a_barrier_is_found_along_the_way_of_another_unknown():
    """y = x², x nearly free above −1: from x = −1/2, y held higher leaves x on its branch, where the pull is hard."""

    def formula(held, u):
        x, y = u[..., 0].copy(), u[..., 1].copy()
        x = np.where(held[:, 0], x, np.where(x < 0.0, -1.0, 1.0) * np.sqrt(np.maximum(y, 0.0)))
        y = np.where(held[:, 1], y, x * x)
        pull = np.where(x < -0.5, 4.0, 0.4) * (x + 0.5)
        return np.stack([x, y], axis=-1), 100.0 * (y - x * x) ** 2 + pull**2

    tangent = [[1.0, -1.0], [-1.0, 1.0]]
    optima = closed_form(formula, [[-0.5, 0.25]], [[0.5, 0.5]], tangent, -50.0, 200.0)
    ends = interval_ends(optima, FOUR, [0, 1])
    np.testing.assert_allclose(ends.value[0, [0, 1]], [-1.0, 4.5], rtol=2.0 * PRECISION)
    # by itself the branch of the optimum would end y at 1
    np.testing.assert_allclose(ends.value[0, 3], 4.5**2, rtol=2.0 * PRECISION)
    assert ends.found.all()
    np.testing.assert_allclose(ends.path[0, 3], [5.0 / 20.0, 1.0], rtol=1e-2)


def test_each_data_set_has_its_own_threshold():
    optima = one_unknown(lambda u: (u - [[0.0], [1.0], [2.0]]) ** 2, u=[0.0, 1.0, 2.0], error=[1.0, 1.0, 1.0])
    ends = interval_ends(optima, np.array([1.0, 4.0, 9.0]), [0])
    np.testing.assert_allclose(ends.value, [[-1.0, 1.0], [-1.0, 3.0], [-1.0, 5.0]], rtol=2.0 * PRECISION)


def test_an_end_that_the_rounds_do_not_reach_is_said_to_be_unfound(monkeypatch):
    monkeypatch.setattr(profile_ends, "ROUNDS", 1)
    ends = interval_ends(one_unknown(lambda u: u * u, error=0.5, high=0.5), FOUR, [0])
    assert ends.found.tolist() == [[False, True]]
    # the farthest that is known
    assert ends.value.tolist() == [[-1.0, 0.5]]


def test_the_ends_of_some_columns_are_those_of_all():
    optima = quadratic([[2.0, 1.0], [1.0, 2.0]], low=[-50.0, -0.25])
    both = interval_ends(optima, FOUR, [0, 1])
    turned = both.of([1, 0])
    for name in ("value", "at_bound", "found", "path", "blocked"):
        expected = getattr(both, name)[:, [2, 3, 0, 1]]
        np.testing.assert_array_equal(getattr(turned, name), expected)
    assert turned.lowest is both.lowest
