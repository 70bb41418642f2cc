"""What the data determine and what they do not, in sentences.

The information matrix JᵀJ of a fit says how fast χ² rises in every direction of the parameters. In units of the
prior spread (the standard deviation of a value of which only the bounds are known, range/√12, taken on the
logarithm of parameters that are fitted as such) its eigenvalue λ is the rise of χ² for a step of one such spread.

* λ < 1: the data tell less about this combination than the bounds do; it is **not determined**.
* Otherwise, moving the leading parameter of a combination alone costs Mᵢᵢeᵢ²/λ times as much χ² as moving along
  the combination. Where that is 10 or more (the standard error is then at least 3.2 times what it would be if the
  others were known) the combination is a **trade-off**: determined, but by the combination's slight rise only.

Each sentence is checked on χ² itself: the named parameters are moved, all others refitted, and the step is
shortened until χ² really rises by less than 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.refits import Optima
from pbrdf.inversion.statistics import covariance, prior_spread
from pbrdf.inversion.verdict import verdict
from pbrdf.models.parameters import Parameter, shown_unit
from pbrdf.wording import joined

if TYPE_CHECKING:
    import xarray as xr


__all__ = ["Combination", "Identifiability", "identifiability"]

#: Below this rise of χ² for a step of one prior spread a direction is not determined.
UNDETERMINED = 1.0

#: Moving the leading parameter alone costs so many times the χ² of moving along a trade-off.
TRADE_OFF = 10.0

#: A parameter is named in a combination if moving it alone would cost this part of what the leading one costs.
NAMED = 0.1

#: Steps tried along a combination, as parts of the step at which the quadratic approximation rises by 1.
STEPS = 0.8 ** np.arange(24)


@dataclass(frozen=True)
class Combination:
    """A combination of parameters that the data determine badly.

    Attributes
    ----------
    changes
        Change of each named parameter, in its own unit, that goes together; the leading one first.
    rise
        By how much χ² rises for these changes with all others refitted; with uncertainties known up to
        their scale, in units of that scale.
    determined
        False: the data say less than the bounds. True: a trade-off, determined by a slight rise of χ² only.
    sentence
        The same in words.
    """

    changes: dict[str, float]
    rise: float
    determined: bool
    sentence: str


@dataclass(frozen=True)
class Identifiability:
    """What the data determine; Q is the number of free parameters on no bound.

    Attributes
    ----------
    eigenvalues
        Rise of χ² for a step of one prior spread along each direction, ascending, shape (Q,).
    directions
        Unit vectors in units of the prior spread, dimensions ``direction`` and ``parameter``.
    condition
        Largest over smallest eigenvalue; infinite where the smallest is lost in rounding.
    parameters
        Over ``parameter``, in own units: ``marginal_std`` (standard error, the others free), ``conditional_std``
        (if the others were known) and ``inflation``, the square of their ratio.
    at_bound
        Free parameters on a bound; they are left out, as their χ² rises linearly or not at all.
    combinations
        Not determined or traded off, the worst first.
    described
        Whether the model describes the data at all; if not, no sentence says that they determine anything.
    settled
        Whether the fit has converged; if not, the same.
    """

    eigenvalues: np.ndarray
    directions: xr.DataArray
    condition: float
    parameters: xr.Dataset
    at_bound: list[str]
    combinations: list[Combination] = field(default_factory=list)
    described: bool = True
    settled: bool = True

    @property
    def sentences(self) -> list[str]:
        """The findings in words."""
        if not self.settled:
            return ["Nothing can be said of what the data determine, as the fit has not converged."]
        if not self.described:
            return ["Nothing can be said of what the data determine, as the model does not describe them."]
        found = [combination.sentence for combination in self.combinations]
        inside = [str(name) for name in self.parameters["parameter"].values]
        if not found and not self.at_bound:
            found = ["The data determine every free parameter; no combination of them is nearly free."]
        elif not found and len(inside) == 1:
            found = [f"The data determine {inside[0]}, the others being where they are."]
        elif not found and inside:
            found = [f"The data determine {joined(inside, 'and')}; no combination of these is nearly free."]
        if self.at_bound:
            found.append(f"Not determined, as the optimum lies on a bound: {', '.join(self.at_bound)}.")
        return found


def identifiability(result: Optimum, *, described: bool | None = None) -> Identifiability:
    """Name the combinations of parameters that the data of a fit do not determine.

    Parameters
    ----------
    result
        A fit.
    described
        Whether the model describes the data; None asks :func:`~pbrdf.inversion.verdict.verdict`.

    Returns
    -------
    Identifiability
        Without directions where every free parameter stands on a bound.
    """
    import xarray as xr

    if described is None:
        described = verdict(result).level.usable

    optima = Optima.of(result)
    space = result.space
    inside = np.flatnonzero(~optima.at_bound[0])
    names = [space.names[i] for i in inside]
    scale = 1.0 if result.std_known else max(result.goodness.reduced_chi2, 1e-300)
    spread = prior_spread(optima.low, optima.high)[inside]
    matrix = result.information[np.ix_(inside, inside)] * np.outer(spread, spread) / scale
    eigenvalues, vectors = np.linalg.eigh(matrix)
    floor = max(float(eigenvalues.max(initial=0.0)), 0.0) * 1e-15 + 1e-200
    least = float(eigenvalues.min(initial=math.inf))
    condition = float(eigenvalues[-1]) / least if floor < least < math.inf else math.inf
    eigenvalues = np.maximum(eigenvalues, floor)

    # d parameter / d unknown, by a central difference far above rounding and far below any curvature
    step = 1e-6 * prior_spread(optima.low, optima.high)
    slope = (space.to_parameters(optima.u[0] + step) - space.to_parameters(optima.u[0] - step)) / (2.0 * step)
    marginal = np.diag(covariance(matrix, np.ones(len(names))))
    with np.errstate(divide="ignore"):
        conditional = 1.0 / np.diag(matrix)
    unit = np.abs(slope[inside]) * spread
    parameters = xr.Dataset(
        {
            "marginal_std": ("parameter", np.sqrt(marginal) * unit),
            "conditional_std": ("parameter", np.sqrt(conditional) * unit),
            "inflation": ("parameter", np.where(np.isinf(conditional), math.nan, marginal / conditional)),
        },
        coords={"parameter": names},
    )

    combinations: list[Combination] = []
    told = set()
    for value, vector in zip(eigenvalues, vectors.T, strict=True):
        determined = bool(value >= UNDETERMINED)
        if determined and (np.diag(matrix) * vector**2).max() < TRADE_OFF * value:
            continue
        found = _combination(optima, inside, spread * vector, matrix, spread, scale, determined)
        # with the others refitted, two directions may come down to the same trade-off
        pattern = frozenset((name, change > 0.0) for name, change in found.changes.items())
        if pattern not in told:
            combinations.append(found)
            told.add(pattern)
    return Identifiability(
        eigenvalues,
        xr.DataArray(
            vectors.T,
            dims=("direction", "parameter"),
            coords={"direction": np.arange(len(names)), "parameter": names},
        ),
        condition,
        parameters,
        [space.names[i] for i in np.flatnonzero(optima.at_bound[0])],
        combinations,
        described,
        result.settled,
    )


def _combination(
    optima: Optima,
    inside: np.ndarray,
    direction: np.ndarray,
    matrix: np.ndarray,
    spread: np.ndarray,
    scale: float,
    determined: bool,
) -> Combination:
    """Walk both ways along a direction (in unknowns, of the columns ``inside``) as far as χ² allows."""
    vector = direction / spread
    value = float(vector @ matrix @ vector)
    length = 1.0 / math.sqrt(max(value, 1e-200))
    alone = np.diag(matrix) * (vector * min(length, 1.0)) ** 2
    order = np.argsort(-alone)
    named = [i for i in order if alone[i] >= max(NAMED * alone[order[0]], 1.0)]
    if not named:
        named = [int(np.argmax(np.abs(vector)))]
    elif len(named) == 1 and len(order) > 1 and alone[named[0]] > 2.0:
        # something must make up for what the leading parameter costs, or the direction would not be weak
        named.append(int(order[1]))
    columns = inside[named]

    best = optima.u[0]
    step = np.zeros(len(best))
    step[inside] = direction
    if step[columns[0]] < 0.0:
        step = -step
    lanes = []
    for sign in (1.0, -1.0):
        room = np.where(sign * step > 0.0, optima.high - best, best - optima.low)
        # 0/0 where an unknown on its bound stays there; it is not among the columns
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = float((room / np.abs(step))[columns].min())
        # what is not determined may go to its bounds, whatever the curvature at the optimum says
        longest = min(length, longest) if determined else longest
        lanes.append(best + sign * longest * STEPS[:, None] * step)
    held = np.zeros((2 * len(STEPS), len(best)), dtype=bool)
    held[:, columns] = True
    refit = optima.refit(held, np.concatenate(lanes)[None])
    rise = ((refit.chi2[0] - optima.chi2[0]) / scale).reshape(2, -1)
    moved = refit.u[0].reshape(2, len(STEPS), -1)
    # steps shrink along each side: the first that costs less than 1; if none does, say what the last one costs
    lane = [int(np.argmax(side < 1.0)) if (side < 1.0).any() else len(STEPS) - 1 for side in rise]
    reach = [abs(moved[side, lane[side], columns[0]] - best[columns[0]]) for side in (0, 1)]
    # upwards if that goes about as far, as it reads more easily
    side = 0 if reach[0] >= 0.8 * reach[1] else 1
    space = optima.space
    before = space.to_parameters(best)
    ends = [space.to_parameters(moved[k, lane[k]])[columns] for k in (1, 0)]
    parameters = [space.free[i] for i in columns]
    named_as = [p.name for p in parameters]
    changes = dict(zip(named_as, map(float, ends[1 - side] - before[columns]), strict=True))
    cost = float(rise[side, lane[side]])
    if determined or len(columns) > 1:
        move = _move(parameters, changes, before[columns])
    else:
        (low,), (high,) = ends
        low, high = (parameters[0].shown(end, ".3g") for end in (low, high))
        move = f"moving it anywhere between {low} and {high}"
        cost = float(max(rise[0, lane[0]], rise[1, lane[1]]))
    names = joined(named_as, "and")
    if determined:
        opening = f"{names} trade off"
    else:
        opening = f"The data do not determine {names}{' apart' if len(columns) > 1 else ''}"
    limit = "less than 1" if cost < 1.0 else f"{cost:.2g}"
    others = " (the others refitted)" if len(columns) < len(best) else ""
    return Combination(changes, cost, determined, f"{opening}: {move} changes χ² by {limit}{others}.")


def _move(parameters: list[Parameter], changes: dict[str, float], before: np.ndarray) -> str:
    """``raising t by 0.10 to 0.77 with n lowered by 0.02 to 1.60``."""
    parts: list[str] = []
    for parameter, value in zip(parameters, before, strict=True):
        name, change = parameter.name, changes[parameter.name]
        amount, end = _numbers(parameter, float(value), change)
        if parts:
            parts.append(f"{name} {'raised' if change > 0.0 else 'lowered'} by {amount} to {end}")
        else:
            parts.append(f"{'raising' if change > 0.0 else 'lowering'} {name} by {amount} to {end}")
    return parts[0] + (f" with {joined(parts[1:], 'and')}" if parts[1:] else "")


def _numbers(parameter: Parameter, value: float, change: float) -> tuple[str, str]:
    """Size of a change with two digits, and where it leads with as many decimals."""
    size = abs(change) * shown_unit(parameter)[0]
    if not 1e-6 <= size < 1e6:
        return parameter.shown(abs(change), ".2g"), parameter.shown(value + change, ".6g")
    form = f".{max(0, 1 - math.floor(math.log10(size)))}f"
    return parameter.shown(abs(change), form), parameter.shown(value + change, form)
