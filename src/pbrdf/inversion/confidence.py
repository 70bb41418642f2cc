"""What profiles and contours have in common: thresholds of χ², and what a reader must know of the refits."""

from __future__ import annotations

import math

import numpy as np

from pbrdf.errors import FitError
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.problem import Space
from pbrdf.inversion.refits import Lowest, Optima, Refit

__all__ = [
    "better_notes",
    "better_optimum",
    "check_points",
    "clipped",
    "free_column",
    "rise_of_chi2",
    "unsettled_note",
]

#: A curve goes on beyond both ends by this part of their distance from the optimum, a contour's grid by half of it.
MARGIN = 0.5

#: How often curves and grids are gone over again from neighbouring points that have a lower χ².
PASSES = 4

#: An optimum counts as better if its χ² is lower by more than this part of the threshold.
BETTER = 1e-3


def rise_of_chi2(result: Optimum, level: float, parameters: int) -> float:
    """How far χ² may rise above its minimum inside a confidence region.

    With known uncertainties the quantile of χ² with as many degrees of freedom as parameters are looked at (3.84
    for one at 95 %). With uncertainties known up to their scale, ν = data − free degrees of freedom estimate the
    scale, and the threshold is the F-test's: parameters · F(level; parameters, ν) · χ²_min/ν. Both are exact for a
    linear model with normal errors. Known uncertainties are taken at their word even where the reduced χ² is far
    from 1.

    Parameters
    ----------
    result
        A fit.
    level
        Confidence level, between 0 and 1.
    parameters
        How many parameters the region is of.

    Raises
    ------
    FitError
        If the level is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise FitError(f"level={level:g}: a confidence level lies between 0 and 1, for example 0.95")
    from scipy import special  # its quantiles: scipy.stats would take longer to import than the fit takes

    if result.std_known:
        return float(special.chdtri(parameters, 1.0 - level))
    freedom = result.goodness.data - result.goodness.free
    ratio = float(special.fdtri(parameters, freedom, level))
    return parameters * ratio * result.goodness.reduced_chi2


def free_column(space: Space, name: str) -> int:
    """Column of a free parameter; FitError, naming the free ones, if there is none of that name."""
    if name not in space.names:
        raise FitError(f"{name!r} is not a free parameter of this fit: free are {', '.join(space.names)}")
    return space.names.index(name)


def check_points(points: int) -> None:
    """FitError if there are too few points for a curve or an axis of a grid."""
    if points < 3:
        raise FitError(f"points={points}: at least 3 are needed")


def clipped(space: Space, unknowns: np.ndarray) -> np.ndarray:
    """Parameters (..., P), the rounding of the way through the unknowns not leading out of the bounds."""
    values: np.ndarray = np.clip(space.to_parameters(unknowns), space.lower, space.upper)
    return values


def better_optimum(optima: Optima, lowest: Lowest, rise: float) -> tuple[dict[str, float] | None, float]:
    """The free parameters and χ² of a better optimum, reached from the lowest χ² met, if there is one."""
    if not lowest.chi2[0] < optima.chi2[0] - BETTER * rise:
        return None, math.nan
    held = np.zeros((1, len(optima.low)), dtype=bool)
    refit = optima.refit(held, lowest.u[:, None])
    values = clipped(optima.space, refit.u[0, 0])
    return dict(zip(optima.space.names, map(float, values), strict=True)), float(refit.chi2[0, 0])


def better_notes(optima: Optima, better: dict[str, float] | None, chi2: float) -> list[str]:
    """What to tell of a better optimum, if :func:`better_optimum` gave one."""
    if better is None:
        return []
    where = ", ".join(f"{p.name}={p.shown(better[p.name], '.6g')}" for p in optima.space.free)
    return [
        f"Profiling found a better optimum (χ² {chi2:.6g}, the fit's is {optima.chi2[0]:.6g}) at {where}: fit again "
        "from there; what is shown refers to the fit's."
    ]


def unsettled_note(refit: Refit) -> list[str]:
    """What to tell of refits that stand at no minimum, if there are any."""
    count = int((~refit.settled).sum())
    if not count:
        return []
    return [f"{count} of {refit.settled.size} points did not converge; χ² may be too high there."]
