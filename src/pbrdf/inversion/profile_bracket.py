"""Brackets around the ends of profile intervals, and the moves that narrow them.

From the optimum each profiled unknown is searched to both sides. On each side a bracket holds the farthest distance
from the optimum that is known to lie within the threshold, its inner end, and the nearest one known to lie outside,
its outer end. A round refits the other unknowns at a trial distance of every side, of all data sets, in one solver
call, and moves the brackets by what it says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.inversion.refits import Lowest, Optima

__all__ = ["Brackets", "Outcome", "Sides"]

#: Precision of an end, as a part of its distance from the optimum: 1e-3 of a standard error at 95 %.
PRECISION = 5e-4

#: The root of the rise must be this close to the threshold's before its slope is trusted.
NEAR = 0.02


@dataclass(frozen=True)
class Sides:
    """Where ends are sought: below and above the optimum in each profiled unknown in turn, S sides in all.

    Attributes
    ----------
    optima
        Where the search starts, D data sets of P unknowns.
    column
        The unknown that each side profiles, shape (S,).
    sign
        −1 below the optimum, 1 above, shape (S,).
    target
        Root of the threshold of each data set, shape (D, 1).
    """

    optima: Optima
    column: np.ndarray
    sign: np.ndarray
    target: np.ndarray

    @classmethod
    def of(cls, optima: Optima, rise: np.ndarray, columns: Sequence[int]) -> Sides:
        """Both sides of some unknowns; ``rise`` is the threshold of each data set, shape (D,)."""
        sign = np.tile([-1.0, 1.0], len(columns))
        return cls(optima, np.repeat(np.asarray(columns), 2), sign, np.sqrt(rise)[:, None])

    @property
    def held(self) -> np.ndarray:
        """Which unknown each side holds, mask of shape (S, P)."""
        values: np.ndarray = np.eye(len(self.optima.low), dtype=bool)[self.column]
        return values

    @property
    def bound(self) -> np.ndarray:
        """The bound that each side faces, shape (S,)."""
        values: np.ndarray = np.where(
            self.sign < 0.0, self.optima.low[self.column], self.optima.high[self.column]
        )
        return values

    @property
    def room(self) -> np.ndarray:
        """Distance of the bound from the optimum, shape (D, S)."""
        values: np.ndarray = np.abs(self.bound - self.optima.u[:, self.column])
        return values

    @property
    def margin(self) -> np.ndarray:
        """How close to a bound an unknown stands on it, shape (P,)."""
        values: np.ndarray = 1e-9 * (self.optima.high - self.optima.low)
        return values

    def unknown(self, distance: np.ndarray) -> np.ndarray:
        """The profiled unknowns at distances from the optimum, both of shape (D, S)."""
        values: np.ndarray = self.optima.u[:, self.column] + self.sign * distance
        return values


@dataclass(frozen=True)
class Outcome:
    """What the refits of one round gave.

    Attributes
    ----------
    u
        Unknowns, shape (D, S, P).
    root
        Root of the rise of χ² above that of the optimum, shape (D, S). Infinite where the model gives no finite
        residuals: that is outside.
    """

    u: np.ndarray
    root: np.ndarray


@dataclass
class Brackets:
    """Brackets of the ends on S sides of D data sets; the methods are the moves of a round, in their order.

    Distances are those of the profiled unknown from its optimum, outwards positive.

    Attributes
    ----------
    sides
        Where ends are sought.
    inner, inner_root
        The farthest distance known to be within the threshold, and the root of the rise there, shape (D, S).
    inner_u
        All unknowns there, shape (D, S, P).
    outer, outer_root
        The nearest distance known to be outside and the root of the rise there, both infinite until there is one,
        shape (D, S).
    trial
        The distance to try next, shape (D, S).
    slow
        Whether the last trial left more than half of the bracket standing, shape (D, S).
    end
        The end by what is known so far, shape (D, S).
    at_bound
        Whether that is the bound, χ² below the threshold there, shape (D, S).
    done
        Whether it is final, shape (D, S).
    path
        Change of all unknowns per unit distance, between optimum and end, shape (D, S, P).
    blocked
        Other unknowns on a bound at the last trial but not at the optimum, shape (D, S, P).
    lowest
        The lowest χ² met so far.
    """

    sides: Sides
    inner: np.ndarray
    inner_root: np.ndarray
    inner_u: np.ndarray
    outer: np.ndarray
    outer_root: np.ndarray
    trial: np.ndarray
    slow: np.ndarray
    end: np.ndarray
    at_bound: np.ndarray
    done: np.ndarray
    path: np.ndarray
    blocked: np.ndarray
    lowest: Lowest

    @classmethod
    def around(cls, sides: Sides) -> Brackets:
        """Brackets from the optimum to infinity; the first trial is the end that the Jacobian predicts."""
        optima, column, room = sides.optima, sides.column, sides.room
        shape = room.shape
        # standing on this very bound: nothing to search
        at_bound = room <= sides.margin[column]
        return cls(
            sides=sides,
            inner=np.zeros(shape),
            inner_root=np.zeros(shape),
            inner_u=np.repeat(optima.u[:, None], len(column), axis=1),
            outer=np.full(shape, np.inf),
            outer_root=np.full(shape, np.inf),
            trial=np.minimum(sides.target * optima.error[:, column], room),
            slow=np.zeros(shape, dtype=bool),
            end=np.where(at_bound, room, 0.0),
            at_bound=at_bound,
            done=at_bound.copy(),
            path=optima.tangent[:, column] * sides.sign[:, None],
            blocked=np.zeros((*shape, len(optima.low)), dtype=bool),
            lowest=Lowest(optima.chi2, optima.u),
        )

    @property
    def value(self) -> np.ndarray:
        """The profiled unknowns at the ends by what is known so far, shape (D, S)."""
        return np.where(self.at_bound, self.sides.bound, self.sides.unknown(self.end))

    @property
    def bracketed(self) -> np.ndarray:
        """Whether a distance outside is known, shape (D, S)."""
        values: np.ndarray = np.isfinite(self.outer)
        return values

    @property
    def sloped(self) -> np.ndarray:
        """Whether the rise is known at both ends, shape (D, S)."""
        values: np.ndarray = np.isfinite(self.outer_root)
        return values

    def refit(self) -> Outcome:
        """Refit the other unknowns at the trials, and at the inner ends of what is done."""
        sides, optima = self.sides, self.sides.optima
        self.trial = np.where(self.done, self.inner, self.trial)
        tangent = optima.tangent[:, sides.column] * sides.sign[:, None]
        start = self.inner_u + tangent * (self.trial - self.inner)[..., None]
        start[:, np.arange(len(sides.column)), sides.column] = sides.unknown(self.trial)
        refit = optima.refit(sides.held, start)
        self.lowest = self.lowest.or_lower(refit.lowest())
        climb = np.where(np.isnan(refit.chi2), np.inf, refit.chi2 - optima.chi2[:, None])
        return Outcome(refit.u, np.sqrt(np.maximum(climb, 0.0)))

    def note_path(self, outcome: Outcome) -> None:
        """Take the path from where the trials led, if the model is finite there."""
        moved = ~self.done & np.isfinite(outcome.root) & (self.trial > 0.0)
        change = outcome.u - self.sides.optima.u[:, None]
        self.path[moved] = change[moved] / self.trial[moved][:, None]

    def note_blocked(self, outcome: Outcome) -> None:
        """Note which other unknowns the trials brought to a bound."""
        optima, margin = self.sides.optima, self.sides.margin
        on_bound = (outcome.u <= optima.low + margin) | (outcome.u >= optima.high - margin)
        fresh = on_bound & ~self.sides.held & ~optima.at_bound[:, None]
        self.blocked = np.where(self.done[..., None], self.blocked, fresh)

    def tighten(self, outcome: Outcome) -> None:
        """Make the trials the inner ends where they lie within the threshold, else the outer ends."""
        width = self.outer - self.inner
        within = outcome.root < self.sides.target
        inside, outside = ~self.done & within, ~self.done & ~within
        self.inner[inside], self.inner_root[inside] = self.trial[inside], outcome.root[inside]
        self.inner_u[inside] = outcome.u[inside]
        self.outer[outside], self.outer_root[outside] = self.trial[outside], outcome.root[outside]
        self.slow = self.outer - self.inner > 0.5 * width

    def settle(self, outcome: Outcome) -> None:
        """Read the ends off the brackets; those that are precise, or the bound, are done."""
        target, room = self.sides.target, self.sides.room
        self.at_bound = self.at_bound | (~self.done & (outcome.root < target) & (self.trial >= room))
        miss, width = np.abs(outcome.root - target), self.outer - self.inner
        tolerance = PRECISION * self.outer
        with np.errstate(invalid="ignore", divide="ignore"):
            off = miss * width / (self.outer_root - self.inner_root)
        close = self.sloped & (miss <= NEAR * target) & (off <= tolerance)
        narrow = self.bracketed & (width <= tolerance)
        known = np.where(self.sloped, self._secant(), np.where(self.bracketed, self.inner, self.trial))
        self.end = np.where(self.done, self.end, np.where(self.at_bound, room, known))
        self.done = self.done | close | narrow | self.at_bound

    def choose_trial(self) -> None:
        """Next, try the secant of a bracket or, after a slow step, its middle; without a bracket, go further out."""
        # a secant that leaves most of the bracket standing is followed by a bisection
        between = np.where(self.sloped & ~self.slow, self._secant(), 0.5 * (self.inner + self.outer))
        self.trial = np.where(self.bracketed, between, self._extrapolated(1.05, 1.2, 4.0))

    def jump_ahead(self, outcome: Outcome) -> None:
        """Go on from a point of any side that is within the threshold and further out: the end lies beyond it."""
        room = self.sides.room
        far, root, u = self._farthest(outcome)
        passed = far > (1.0 + 4.0 * PRECISION) * np.where(self.done, self.end, self.inner)
        self.inner[passed], self.inner_root[passed] = far[passed], root[passed]
        self.inner_u[passed] = u[passed]
        self.path[passed] = (u - self.sides.optima.u[:, None])[passed] / far[passed][:, None]
        beyond = passed & (self.outer <= self.inner)
        self.outer[beyond], self.outer_root[beyond] = np.inf, np.inf

        middle, ahead = 0.5 * (self.inner + self.outer), self._extrapolated(1.0, 1.1, 2.0)
        self.trial = np.where(passed, np.where(self.bracketed, middle, ahead), self.trial)
        self.at_bound = np.where(passed, far >= room - self.sides.margin[self.sides.column], self.at_bound)
        self.end = np.where(passed & self.at_bound, room, self.end)
        self.done = np.where(passed, self.at_bound, self.done)

    def _secant(self) -> np.ndarray:
        """Where a straight line between the roots at both ends of the bracket meets the threshold."""
        width, lacking = self.outer - self.inner, self.sides.target - self.inner_root
        with np.errstate(invalid="ignore", divide="ignore"):
            values: np.ndarray = self.inner + width * lacking / (self.outer_root - self.inner_root)
            return values

    def _extrapolated(self, stretch: float, least: float, most: float) -> np.ndarray:
        """Somewhat past where a straight line from the optimum through the inner end meets the threshold.

        By a factor ``stretch``, but between ``least`` and ``most`` times as far as the inner end, and not past the
        bound: the bound itself from where no line can be drawn.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            meeting = stretch * self.inner * self.sides.target / self.inner_root
        further = np.clip(meeting, least * self.inner, most * self.inner)
        return np.where(np.isnan(further), self.sides.room, np.minimum(further, self.sides.room))

    def _farthest(self, outcome: Outcome) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The point within the threshold, of whichever side, that lies farthest out in each side's own unknown.

        Its distance, −∞ if there is none, and root, shape (D, S), and unknowns, shape (D, S, P).
        """
        sides = self.sides
        change = outcome.u - sides.optima.u[:, None]
        # of the unknown that the first S sides profile, at the points of the second S sides: shape (D, S, S)
        distance = sides.sign[:, None] * change.swapaxes(1, 2)[:, sides.column]
        distance = np.where((outcome.root < sides.target)[:, None, :], distance, -np.inf)
        point = distance.argmax(axis=2)
        return (
            np.take_along_axis(distance, point[..., None], axis=2)[..., 0],
            np.take_along_axis(outcome.root, point, axis=1),
            np.take_along_axis(outcome.u, point[..., None], axis=1),
        )
