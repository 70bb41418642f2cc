"""Ends of profile intervals: where χ², minimised over the other unknowns, meets a threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbrdf.inversion.profile_bracket import Brackets, Sides
from pbrdf.inversion.refits import Lowest, Optima

__all__ = ["Ends", "interval_ends"]

#: Solver calls at most for the ends of all intervals; some four suffice where χ² is smooth.
ROUNDS = 30


@dataclass(frozen=True)
class Ends:
    """Ends of profile intervals: lower and upper of each column in turn, S sides in all, in unknowns.

    Attributes
    ----------
    value
        The unknown at the end, shape (D, S).
    at_bound
        Whether it is the bound, χ² below the threshold there, shape (D, S).
    found
        Whether the end is known to :data:`pbrdf.inversion.profile_bracket.PRECISION`, shape (D, S).
    path
        Change of all unknowns per unit change of the profiled one between optimum and end, shape (D, S, P).
    blocked
        Other unknowns that stand on a bound at the end but not at the optimum, shape (D, S, P).
    lowest
        The lowest χ² met on the way.
    """

    value: np.ndarray
    at_bound: np.ndarray
    found: np.ndarray
    path: np.ndarray
    blocked: np.ndarray
    lowest: Lowest

    def of(self, columns: Sequence[int]) -> Ends:
        """Only the ends of some columns, where those of all unknowns are known."""
        sides = (2 * np.asarray(columns)[:, None] + np.arange(2)).ravel()
        names = ("value", "at_bound", "found", "path", "blocked")
        return replace(self, **{name: getattr(self, name)[:, sides] for name in names})


def interval_ends(optima: Optima, rise: np.ndarray, columns: Sequence[int]) -> Ends:
    """Where χ², minimised over the other unknowns, has risen by a threshold; all sides of all data sets at once.

    The root of the rise is nearly linear in the unknown, so a secant on it, kept inside its bracket, takes few
    rounds. The first trial is the end that the Jacobian predicts. Where the way of another unknown passes through
    lower values of χ² further out, the search goes on from there: the interval reaches to the farthest value found
    within the threshold, also where a local optimum of the others, or a barrier, lies between.

    Parameters
    ----------
    optima
        Where to start from, D data sets.
    rise
        Threshold of each data set, shape (D,).
    columns
        The unknowns to profile.
    """
    brackets = Brackets.around(Sides.of(optima, rise, columns))
    for _ in range(ROUNDS):
        if brackets.done.all():
            break
        outcome = brackets.refit()
        brackets.note_path(outcome)
        brackets.note_blocked(outcome)
        brackets.tighten(outcome)
        brackets.settle(outcome)
        brackets.choose_trial()
        brackets.jump_ahead(outcome)
    path = brackets.path * brackets.sides.sign[:, None]
    return Ends(brackets.value, brackets.at_bound, brackets.done, path, brackets.blocked, brackets.lowest)
