"""How the search runs: all parameters together, or step by step as the paper does.

Stepwise (paper, section 2.2): the parameters of the diffuse part (the paper's a, k, b, t) from the geometries where
the specular lobe is negligible, with the others (σ and n) held; then the others from all geometries, with the diffuse
ones held. The paper does not say where it holds σ and n in the first step: here the width of the lobe comes from a wide
first guess that is replaced by the fitted one until the choice of geometries no longer changes, and the rest from the
parameters' defaults, then from the second step. Beyond the paper, an optional last step polishes all parameters
together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from pbrdf.errors import FitError
from pbrdf.inversion.block_solver import BlockResiduals, recombined
from pbrdf.inversion.clusters import cluster
from pbrdf.inversion.minimise import solve
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.solver import Solution
from pbrdf.inversion.thinning import thinned
from pbrdf.optics.half_difference import facet_tilt

__all__ = ["STRATEGIES", "Stage", "joint", "stepwise"]

STRATEGIES = ("joint", "stepwise")
#: The lobe counts as negligible where the mirror facet is tilted by more than this many of its slope widths.
LOBE_WIDTH = 4.5
#: First guess of the width for choosing geometries, and how often the choice is revised.
WIDE, REVISIONS = 0.1, 4

#: Ends of a search of part of the geometries with up to so many times the best χ², and so many of them, see all.
RIVALS, MOST_RIVALS = 1.25, 4

Progress = Callable[[int, int], None] | None


@dataclass(frozen=True)
class Stage:
    """One step of a fit.

    Attributes
    ----------
    name
        ``"search"`` (on part of the geometries), ``"diffuse"``, ``"specular"`` or ``"joint"``.
    free, held
        Names of the parameters that were free, and values of those held, at the best start.
    values
        All parameters after the step, at the best start.
    points
        Number of geometries used.
    chi2
        Σ (residual/std)² over these geometries at the best start.
    """

    name: str
    free: tuple[str, ...]
    held: dict[str, float]
    values: dict[str, float]
    points: int
    chi2: float


def joint(
    space: Space, data: Observations, first: np.ndarray, max_iterations: int, progress: Progress
) -> tuple[Solution, list[Stage]]:
    """Search from all starts with the draft accuracy, then refine each distinct end with the model's own.

    Every start gets the refined end of its cluster. Many geometries are searched in part
    (:mod:`pbrdf.inversion.thinning`), and the best ends then refined on all; χ² of the others is that of the search.

    Parameters
    ----------
    space, data
        The problem.
    first
        Starting unknowns, shape (S, P).
    max_iterations, progress
        As for :func:`pbrdf.inversion.solver.solve`.

    Returns
    -------
    solution, stages
        S lanes; and the stages: ``"search"`` if only part of the geometries were searched, and ``"joint"``.
    """
    low, high = space.box
    part = thinned(space, data)
    problem = residuals(space, [data if part is None else part], len(first), accuracy="draft")
    search = solve(
        problem, first, low, high, max_iterations=max_iterations, tolerance=1e-6, progress=progress
    )
    if isinstance(problem, BlockResiduals):
        search = recombined(problem, search, low, high, max_iterations=max_iterations, tolerance=1e-6)
    if part is not None:
        solution = _on_all(space, data, part, search, low, high, max_iterations, progress)
        stages = [_stage("search", space, search, space.names, part)]
    else:
        solution = _refine(space, data, search, low, high, max_iterations)
        stages = []
    return solution, [*stages, _stage("joint", space, solution, space.names, data)]


def stepwise(
    space: Space,
    data: Observations,
    first: np.ndarray,
    max_iterations: int,
    progress: Progress,
    *,
    polish: bool = True,
    diffuse_tilt: float | None = None,
) -> tuple[Solution, list[Stage], np.ndarray]:
    """The paper's strategy.

    Parameters
    ----------
    space, data, first, max_iterations, progress
        As for :func:`joint`.
    polish
        Whether all parameters are fitted together in the end: only then are many geometries searched in part.
    diffuse_tilt
        Facet tilt in radians beyond which a geometry counts as diffuse; None chooses it from the running width.

    Returns
    -------
    solution, stages, diffuse
        S lanes, whose information matrix is that of all parameters together; the stages; and the mask of the
        geometries used for the diffuse step, shape (G,).

    Raises
    ------
    FitError
        If a parameter is free for each group or wavelength, no diffuse or specular parameter is free, or too
        few geometries lie outside the lobe.
    """
    names = space.names
    diffuse = [p.name for p in space.model.parameters if p.part == "diffuse"]
    others = [p.name for p in space.model.parameters if p.part != "diffuse"]
    is_diffuse = np.array([not term.nuisance and term.role in diffuse for term in space.terms])
    diffuse_free = [n for n, chosen in zip(names, is_diffuse, strict=True) if chosen]
    other_free = [n for n, chosen in zip(names, is_diffuse, strict=True) if not chosen]
    if any(term.split == "wavelength" or (term.split and not term.nuisance) for term in space.terms):
        raise FitError(
            "stepwise: parameters of the model that are free for each group or wavelength need joint"
        )
    if not diffuse or not others:
        raise FitError(
            f"stepwise: every parameter of {space.model.name} shapes the same part: use the joint strategy"
        )
    if not diffuse_free or not any(not term.nuisance and term.role in others for term in space.terms):
        raise FitError(
            f"stepwise: at least one of {', '.join(diffuse)} and one of {', '.join(others)} must be free"
        )
    low, high = space.box
    tilt = facet_tilt(data.theta_i, data.theta_r, data.phi)
    part = thinned(space, data) if polish else None
    if part is not None:
        found, steps, _ = stepwise(
            space, part, first, max_iterations, progress, polish=True, diffuse_tilt=diffuse_tilt
        )
        solution = _on_all(space, data, part, found, low, high, max_iterations, progress)
        width = float(space.build(list(steps[-1].values.values())).lobe_width())
        chosen = _choose(tilt, data, diffuse_tilt, width, len(diffuse_free), shrink=False)
        steps = [*steps[:-1], replace(steps[-1], name="search")]
        return solution, [*steps, _stage("joint", space, solution, names, data)], chosen

    # all but the diffuse parameters start the first step at their defaults, the diffuse ones all over the bounds
    u = first.copy()
    held = _held_values(space, first)
    u[:, ~is_diffuse] = held[~is_diffuse]
    stages: list[Stage] = []
    chosen = _choose(tilt, data, diffuse_tilt, WIDE, len(diffuse_free), shrink=True)
    for _ in range(REVISIONS):
        part = _only(data, chosen)
        one = _step(space, part, u, is_diffuse, low, high, max_iterations, progress)
        stages.append(_stage("diffuse", space, one, diffuse_free, part))
        u = one.u.copy()
        u[:, ~is_diffuse] = first[:, ~is_diffuse]
        two = _step(space, data, u, ~is_diffuse, low, high, max_iterations, progress)
        stages.append(_stage("specular", space, two, other_free, data))
        best = space.to_parameters(two.u[int(np.nanargmin(two.cost))])
        width = float(space.build(best).lobe_width())
        revised = _choose(tilt, data, diffuse_tilt, width, len(diffuse_free), shrink=False)
        u = two.u.copy()
        u[:, ~is_diffuse] = two.u[int(np.nanargmin(two.cost)), ~is_diffuse]
        if (revised == chosen).all():
            break
        chosen = revised
    if polish:
        solution = _refine(space, data, two, low, high, max_iterations)
        stages.append(_stage("joint", space, solution, names, data))
    else:
        # standard errors from all parameters together: those of one step alone would be too small
        final = solve(residuals(space, [data], len(two.u)), two.u, two.u, two.u, max_iterations=1)
        solution = replace(final, status=two.status)
    return solution, stages, chosen


def _held_values(space: Space, first: np.ndarray) -> np.ndarray:
    values = np.array(
        [np.clip(p.default, lo, hi) for p, lo, hi in zip(space.free, space.lower, space.upper, strict=True)]
    )
    result = space.to_unknowns(values)
    for i in range(first.shape[1]):
        if np.ptp(first[:, i]) == 0.0:  # the user said where to start
            result[i] = first[0, i]
    return result


def _choose(
    tilt: np.ndarray, data: Observations, override: float | None, width: float, free: int, shrink: bool
) -> np.ndarray:
    """Geometries outside the lobe; with ``shrink`` the guess of its width is halved until enough are left."""
    if override is not None:
        chosen = tilt > override
    else:
        chosen = tilt > np.arctan(LOBE_WIDTH * width)
        while shrink and _count(data, chosen) < 3 * free and width > 0.005:
            width *= 0.5
            chosen = tilt > np.arctan(LOBE_WIDTH * width)
    if _count(data, chosen) <= free:
        raise FitError(
            f"stepwise: {_count(data, chosen)} values outside the specular lobe cannot determine {free} diffuse "
            "parameters; measure more there, state another tilt, or use the joint strategy"
        )
    return chosen


def _count(data: Observations, chosen: np.ndarray) -> int:
    return int(np.isfinite(data.std[:, chosen]).sum())


def _only(data: Observations, chosen: np.ndarray) -> Observations:
    """The same geometries, weight 0 for those not chosen: the form, and so the kernel, stays the same."""
    return replace(data, std=np.where(chosen, data.std, np.inf))


def _step(
    space: Space,
    data: Observations,
    u: np.ndarray,
    free: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    max_iterations: int,
    progress: Progress,
) -> Solution:
    """One step from all starts; the unknowns that are not free stay where they are."""
    return solve(
        residuals(space, [data], len(u), accuracy="draft"),
        u,
        np.where(free, low, u),
        np.where(free, high, u),
        max_iterations=max_iterations,
        tolerance=1e-6,
        progress=progress,
    )


def _refine(
    space: Space, data: Observations, search: Solution, low: np.ndarray, high: np.ndarray, max_iterations: int
) -> Solution:
    clusters = cluster(search.u, search.cost, high - low, 1e-3, 1e-3)
    if not clusters:
        return search
    leaders = np.array([members[0] for members in clusters])
    refined = solve(
        residuals(space, [data], len(leaders)), search.u[leaders], low, high, max_iterations=max_iterations
    )
    cluster_of = np.zeros(len(search.u), dtype=int)
    for number, members in enumerate(clusters):
        cluster_of[members] = number
    columns = {f.name: getattr(refined, f.name)[cluster_of] for f in fields(Solution)}
    lost = ~np.isfinite(search.cost)
    columns["cost"] = np.where(lost, np.inf, columns["cost"])
    columns["status"] = np.where(lost, search.status, columns["status"])
    return Solution(**columns)


def _on_all(
    space: Space,
    data: Observations,
    part: Observations,
    found: Solution,
    low: np.ndarray,
    high: np.ndarray,
    max_iterations: int,
    progress: Progress,
) -> Solution:
    """The best ends of a search of part of the geometries, refined on all; the others with χ² as the part has it."""
    clusters = cluster(found.u, found.cost, high - low, 1e-3, 1e-3)
    if not clusters:
        return found
    limit = RIVALS * found.cost[clusters[0][0]]
    kept = [members for members in clusters if found.cost[members[0]] <= limit][:MOST_RIVALS]
    refined = solve(
        residuals(space, [data], len(kept)),
        found.u[[members[0] for members in kept]],
        low,
        high,
        max_iterations=max_iterations,
        progress=progress,
    )
    scale = 1.0 if space.loss == "linear" else data.count / part.count
    columns = {f.name: getattr(found, f.name).copy() for f in fields(Solution)}
    columns["cost"] = np.maximum(scale * columns["cost"], RIVALS * refined.cost.min())
    for number, members in enumerate(kept):
        for name, column in columns.items():
            column[members] = getattr(refined, name)[number]
    return Solution(**columns)


def _stage(name: str, space: Space, solution: Solution, free: list[str], data: Observations) -> Stage:
    best = int(np.nanargmin(solution.cost))
    values = dict(zip(space.names, map(float, space.to_parameters(solution.u[best])), strict=True))
    return Stage(
        name=name,
        free=tuple(free),
        held={n: v for n, v in values.items() if n not in free},
        values=values,
        points=int(np.isfinite(data.std).any(axis=0).sum()),
        chi2=2.0 * float(solution.cost[best]),
    )
