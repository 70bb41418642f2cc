"""Every move of the brackets by itself, on χ² in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from closed_form_helpers import one_unknown, quadratic

from pbrdf.inversion.profile_bracket import PRECISION, Brackets, Outcome, Sides

#: Lower and upper side.
LOWER, UPPER = (0, 0), (0, 1)


def square(u):
    return u * u


def brackets_of(optima, threshold=4.0, columns=(0,)):
    return Brackets.around(Sides.of(optima, np.full(len(optima.u), threshold), columns))


def outcome_of(brackets, root, u=None):
    """An outcome with the roots of a formula, the other unknowns where they are unless given."""
    u = np.repeat(brackets.sides.optima.u[:, None], len(brackets.sides.sign), axis=1) if u is None else u
    return Outcome(np.asarray(u, dtype=float), np.broadcast_to(root, brackets.inner.shape) * 1.0)


def test_sides_are_below_and_above_each_unknown_in_turn():
    sides = Sides.of(quadratic(np.eye(2), low=[-1.0, -2.0], high=[3.0, 4.0]), np.array([9.0]), [1, 0])
    assert sides.column.tolist() == [1, 1, 0, 0]
    assert sides.sign.tolist() == [-1.0, 1.0, -1.0, 1.0]
    assert sides.target.tolist() == [[3.0]]
    assert sides.held.tolist() == [[False, True], [False, True], [True, False], [True, False]]
    assert sides.bound.tolist() == [-2.0, 4.0, -1.0, 3.0]
    assert sides.room.tolist() == [[2.0, 4.0, 1.0, 3.0]]
    assert sides.unknown(np.array([[0.5, 0.5, 0.25, 0.0]])).tolist() == [[-0.5, 0.5, -0.25, 0.0]]


def test_the_first_trial_is_the_end_that_the_jacobian_predicts_but_not_past_the_bound():
    brackets = brackets_of(one_unknown(square, error=0.7, low=-1.0))
    assert brackets.trial.tolist() == [[1.0, 1.4]]
    assert not brackets.bracketed.any() and not brackets.done.any()
    assert (brackets.inner == 0.0).all() and np.isinf(brackets.outer).all()


def test_a_side_whose_bound_holds_the_optimum_is_done_at_once():
    brackets = brackets_of(one_unknown(square, low=0.0))
    assert brackets.done.tolist() == brackets.at_bound.tolist() == [[True, False]]
    assert brackets.value[LOWER] == 0.0


def test_refits_start_along_the_tangent_and_hold_the_profiled_unknown():
    optima = quadratic([[2.0, 1.0], [1.0, 2.0]])
    brackets = brackets_of(optima, columns=(0, 1))
    outcome = brackets.refit()
    z = 2.0 * np.sqrt(2.0 / 3.0)
    expected = [[-z, 0.5 * z], [z, -0.5 * z], [0.5 * z, -z], [-0.5 * z, z]]
    np.testing.assert_allclose(optima.calls[0][0], expected)
    np.testing.assert_allclose(outcome.u[0], expected)
    np.testing.assert_allclose(outcome.root, 2.0)


def test_what_is_done_is_refitted_at_its_inner_end():
    optima = one_unknown(square)
    brackets = brackets_of(optima)
    brackets.done[UPPER], brackets.inner[UPPER] = True, 1.25
    brackets.refit()
    assert optima.calls[0][0, :, 0].tolist() == [-2.0, 1.25]


def test_where_the_model_is_not_finite_is_outside():
    brackets = brackets_of(one_unknown(lambda u: np.where(u > 1.0, np.nan, u * u)))
    outcome = brackets.refit()
    assert outcome.root.tolist() == [[2.0, np.inf]]
    brackets.tighten(outcome)
    assert brackets.outer[UPPER] == 2.0 and brackets.bracketed[UPPER] and not brackets.sloped[UPPER]
    brackets.settle(outcome)
    brackets.choose_trial()
    # no slope across the edge: the middle
    assert brackets.trial[UPPER] == 1.0
    assert brackets.end[UPPER] == 0.0 and not brackets.done[UPPER]


def test_the_lowest_chi2_on_the_way_is_kept():
    optima = one_unknown(lambda u: 4.0 + u * (u - 1.0), error=0.25)
    brackets = brackets_of(optima)
    brackets.refit()
    assert brackets.lowest.chi2.tolist() == [3.75] and brackets.lowest.u.tolist() == [[0.5]]
    brackets.trial[:] = 1.0
    brackets.refit()
    assert brackets.lowest.chi2.tolist() == [3.75]
    # χ² below the optimum's counts as no rise
    assert brackets.refit().root[UPPER] == 0.0


def test_trials_within_the_threshold_become_inner_ends_and_others_outer_ends():
    brackets = brackets_of(one_unknown(square))
    brackets.trial = np.array([[1.0, 3.0]])
    brackets.tighten(brackets.refit())
    assert brackets.inner.tolist() == brackets.inner_root.tolist() == [[1.0, 0.0]]
    assert brackets.inner_u[..., 0].tolist() == [[-1.0, 0.0]]
    assert brackets.outer.tolist() == brackets.outer_root.tolist() == [[np.inf, 3.0]]
    assert not brackets.slow.any()


def test_a_trial_that_leaves_most_of_a_bracket_standing_is_followed_by_its_middle():
    brackets = brackets_of(one_unknown(square))
    brackets.trial = np.array([[8.0, 8.0]])
    brackets.tighten(brackets.refit())
    brackets.trial = np.array([[3.0, 5.0]])
    brackets.tighten(brackets.refit())
    # 3 of 8 are left, 5 of 8
    assert brackets.slow.tolist() == [[False, True]]
    brackets.choose_trial()
    np.testing.assert_allclose(brackets.trial, [[2.0, 2.5]])


def test_without_a_bracket_the_trial_goes_somewhat_past_the_end_that_the_root_predicts():
    brackets = brackets_of(one_unknown(square, error=0.5))
    brackets.tighten(brackets.refit())
    brackets.choose_trial()
    np.testing.assert_allclose(brackets.trial, 1.05 * 2.0)


@pytest.mark.parametrize(
    ("inner", "root", "trial"),
    [
        (1.0, 1.95, 1.2),  # the prediction is close by: at least so much further
        (1.0, 0.01, 4.0),  # far away: at most so much
        (1.0, 0.0, 4.0),  # no rise at all yet
        (40.0, 0.01, 50.0),  # not past the bound
        (0.0, 0.0, 50.0),  # nothing known: the bound
    ],
)
def test_extrapolation_has_limits(inner, root, trial):
    brackets = brackets_of(one_unknown(square))
    brackets.inner[:], brackets.inner_root[:] = inner, root
    brackets.choose_trial()
    assert brackets.trial.tolist() == [[trial, trial]]


def test_a_trial_close_to_the_threshold_settles_the_end_on_the_secant():
    brackets = brackets_of(one_unknown(square))
    brackets.inner[:], brackets.inner_root[:] = 1.9, 1.9
    brackets.trial = np.full((1, 2), 2.0 * (1.0 + 0.5 * PRECISION))
    outcome = brackets.refit()
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert brackets.done.all() and not brackets.at_bound.any()
    np.testing.assert_allclose(brackets.value, [[-2.0, 2.0]], rtol=1e-12)


def test_a_trial_far_from_the_threshold_gives_an_end_but_not_the_last_word():
    brackets = brackets_of(one_unknown(square))
    brackets.trial = np.array([[1.0, 3.0]])
    outcome = brackets.refit()
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert not brackets.done.any()
    # the trial itself without a bracket; the secant, exact for a quadratic, with one
    np.testing.assert_allclose(brackets.value, [[-1.0, 2.0]])


@pytest.mark.parametrize(
    ("inner", "inner_root", "trial", "root"),
    [
        # the secant is within the precision, but the rise passes the threshold by 2.5 %: its slope may be a jump
        (1.0, 0.0, 1.015, 2.05),
        # the rise is within 1 % of the threshold, but so flat that the end may be far off
        (1.0, 1.97, 2.0, 2.02),
    ],
)
def test_neither_a_close_secant_nor_a_close_rise_alone_settles(inner, inner_root, trial, root):
    brackets = brackets_of(one_unknown(square))
    brackets.inner[:], brackets.inner_root[:], brackets.trial[:] = inner, inner_root, trial
    outcome = outcome_of(brackets, root)
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert not brackets.done.any()
    secant = inner + (trial - inner) * (2.0 - inner_root) / (root - inner_root)
    np.testing.assert_allclose(brackets.end, secant)


def test_a_narrow_bracket_settles_whatever_the_rise():
    brackets = brackets_of(one_unknown(lambda u: np.where(np.abs(u) > 2.0, np.nan, 0.0)))
    brackets.inner[:], brackets.trial[:] = 2.0, 2.0 * (1.0 + 0.9 * PRECISION)
    outcome = brackets.refit()
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert brackets.done.all() and (brackets.end == 2.0).all()


def test_a_bound_within_the_threshold_is_the_end():
    brackets = brackets_of(one_unknown(square, error=0.9, low=-1.5, high=2.5))
    outcome = brackets.refit()
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert brackets.at_bound.tolist() == brackets.done.tolist() == [[True, False]]
    assert brackets.value[LOWER] == -1.5


def test_settled_ends_stay():
    brackets = brackets_of(one_unknown(square))
    brackets.done[UPPER], brackets.end[UPPER], brackets.inner[UPPER] = True, 1.99, 1.98
    outcome = brackets.refit()
    brackets.tighten(outcome)
    brackets.settle(outcome)
    assert brackets.end[UPPER] == 1.99 and brackets.inner[UPPER] == 1.98 and np.isinf(brackets.outer[UPPER])


def test_unknowns_that_meet_a_bound_are_noted_and_bend_the_path():
    """y falls by a half as x rises, from 0 to its bound at −0.25."""
    optima = quadratic([[2.0, 1.0], [1.0, 2.0]], low=[-50.0, -0.25])
    brackets = brackets_of(optima)
    brackets.trial = np.array([[1.0, 1.0]])
    outcome = brackets.refit()
    brackets.note_path(outcome)
    brackets.note_blocked(outcome)
    assert brackets.blocked.tolist() == [[[False, False], [False, True]]]
    assert brackets.path.tolist() == [[[-1.0, 0.5], [1.0, -0.25]]]
    # a bound that is left again blocks no more
    brackets.trial = np.array([[1.0, 0.25]])
    brackets.note_blocked(brackets.refit())
    assert not brackets.blocked.any()


def test_the_path_is_not_taken_from_where_the_model_is_not_finite():
    brackets = brackets_of(quadratic(np.eye(2)))
    u = np.array([[[-2.0, 5.0], [2.0, 5.0]]])
    brackets.note_path(outcome_of(brackets, [[3.0, np.inf]], u))
    assert brackets.path.tolist() == [[[-1.0, 2.5], [1.0, 0.0]]]


def test_what_blocks_a_settled_end_stays_noted():
    brackets = brackets_of(quadratic([[2.0, 1.0], [1.0, 2.0]], low=[-50.0, -0.25]))
    brackets.note_blocked(brackets.refit())
    brackets.done[:] = True
    brackets.note_blocked(brackets.refit())
    assert brackets.blocked.tolist() == [[[False, False], [False, True]]]


def test_an_unknown_on_its_bound_from_the_outset_blocks_nothing():
    brackets = brackets_of(quadratic([[2.0, 1.0], [1.0, 2.0]], low=[-50.0, 0.0]))
    brackets.note_blocked(brackets.refit())
    assert not brackets.blocked.any()


def jump(y, root=1.0, **state):
    """The upper side of y after the lower side of x came through the point (−1, y) with this root."""
    brackets = brackets_of(quadratic(np.eye(2), high=[50.0, 20.0]), columns=(0, 1))
    for name, value in state.items():
        getattr(brackets, name)[0, 3] = value
    u = np.zeros((1, 4, 2))
    u[0, 0] = -1.0, y
    brackets.jump_ahead(outcome_of(brackets, [[root, 5.0, 5.0, 5.0]], u))
    return brackets


def test_a_point_of_another_side_further_out_is_gone_on_from():
    brackets = jump(6.0, inner=1.0, inner_root=0.8, outer=3.0, outer_root=2.5)
    assert brackets.inner[0, 3] == 6.0 and brackets.inner_root[0, 3] == 1.0
    assert brackets.inner_u[0, 3].tolist() == [-1.0, 6.0]
    assert brackets.path[0, 3].tolist() == [-1.0 / 6.0, 1.0]
    # what was outside was a barrier
    assert not brackets.bracketed[0, 3] and not brackets.sloped[0, 3]
    assert brackets.trial[0, 3] == 12.0
    # no other side was passed but that of x from where the point is
    assert brackets.inner[0].tolist() == [1.0, 0.0, 0.0, 6.0]


@pytest.mark.parametrize(("root", "trial"), [(1.6, 7.5), (1.99, 6.6), (0.1, 12.0), (0.0, 12.0)])
def test_beyond_the_point_the_trial_is_where_its_root_predicts_the_end_within_limits(root, trial):
    np.testing.assert_allclose(jump(6.0, root=root).trial[0, 3], trial)


def test_a_bracket_further_out_than_the_point_is_kept_and_halved():
    brackets = jump(6.0, inner=1.0, inner_root=0.8, outer=8.0, outer_root=2.5)
    assert brackets.outer[0, 3] == 8.0 and brackets.trial[0, 3] == 7.0


def test_a_settled_end_is_sought_again_if_a_point_lies_beyond():
    brackets = jump(6.0, done=True, end=2.0)
    assert not brackets.done[0, 3] and brackets.inner[0, 3] == 6.0


@pytest.mark.parametrize(
    ("y", "root"), [(6.0, 2.0), (1.9, 1.0), (2.0 * (1.0 + 2.0 * PRECISION), 1.0), (-6.0, 1.0)]
)
def test_points_outside_the_threshold_or_not_further_out_change_nothing(y, root):
    brackets = jump(y, root=root, done=True, end=2.0, inner=1.99)
    assert brackets.done[0, 3] and brackets.end[0, 3] == 2.0 and brackets.inner[0, 3] == 1.99


def test_a_point_on_the_bound_settles_the_side_there():
    brackets = jump(20.0)
    assert brackets.done[0, 3] and brackets.at_bound[0, 3]
    assert brackets.end[0, 3] == brackets.value[0, 3] == 20.0
