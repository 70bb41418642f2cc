"""Levenberg-Marquardt where most unknowns count for a block of the points only: work linear in the blocks.

With S shared unknowns s and L own ones l_g of each of G blocks, JᵀJ is an arrow: l_g and l_h of two blocks meet in no
residual. The damped step comes from the Schur complement (see, for bundle adjustment, Triggs et al., Vision Algorithms:
Theory and Practice, LNCS 1883, 298 (2000), section 6)

    (A_ss − Σ_g A_sg A_gg⁻¹ A_gs) δ_s = −g_s + Σ_g A_sg A_gg⁻¹ g_g,    A_gg δ_g = −g_g − A_gs δ_s

with small matrices only. What is evaluated are pairs of a problem and a block, each over the points of its block, by
the S + L unknowns that count there: one kernel, whatever the number of blocks, problems and points. The small matrices
are dealt with in NumPy, all pairs at a time. Damping, bounds and the end of each problem are those of
:mod:`pbrdf.inversion.solver`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.inversion.blocks import Blocks
from pbrdf.inversion.solver import (
    BOUND_PASSES,
    CREEPING,
    DAMPING,
    LAUNCH,
    NOTHING_TO_GAIN,
    PATIENCE,
    WIDTH,
    Residuals,
    Solution,
    Status,
    nothing_to_gain,
    point_sums,
)

__all__ = ["BlockResiduals", "recombined", "solve_blocks"]

#: A step that promises no more than this part of the cost is the last: it is taken unseen. With χ² about 100 it is some
#: 1e-4 standard errors long, and what it leaves is as small against it as it is against the one before.
LAST_STEP = 1e-10
#: How often the best end is put together anew from what all starts found for each block.
RECOMBINATIONS = 3
_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class BlockResiduals:
    """What :func:`solve_blocks` minimises: ½ Σ ρ(r²) over the points of all blocks, plus ½ Σ of squared penalties.

    Attributes
    ----------
    blocks
        Which unknowns are shared and which count for a block only.
    residuals
        The residuals at a point as a function of the S + L unknowns that count there, the shared ones first.
    order
        Points, those of the first block first and so on.
    begin
        Where in ``order`` each block begins, and their number, shape (G + 1,).
    penalty
        ``penalty(u)`` of all unknowns, shape (B, P), returns residuals that depend on one unknown each, and their
        derivatives by it, of the same shape; None for none.
    """

    blocks: Blocks
    residuals: Residuals
    order: np.ndarray
    begin: np.ndarray
    penalty: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None


def solve_blocks(
    problem: BlockResiduals,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    max_iterations: int = 100,
    tolerance: float = 1e-10,
    progress: Callable[[int, int], None] | None = None,
) -> Solution:
    """Minimise within bounds; parameters and result as of :func:`pbrdf.inversion.solver.solve`."""
    batch, size = start.shape
    lower, upper = (np.broadcast_to(np.asarray(b, dtype=float), start.shape) for b in (lower, upper))
    result = Solution(
        u=np.empty((batch, size)),
        cost=np.empty(batch),
        information=np.empty((batch, size, size)),
        gradient=np.empty((batch, size)),
        status=np.empty(batch, dtype=np.int64),
        iterations=np.empty(batch, dtype=np.int64),
    )
    evaluate = _Evaluation(problem)
    lanes = np.arange(batch)
    u = np.clip(start, lower, upper)
    with np.errstate(all="ignore"):
        cost, system = evaluate(u, lanes)
        walk = _Walk.initial(cost, np.any(upper > lower, axis=1))
        while True:
            going = walk.status == Status.RUNNING
            if not going.all():
                target = lanes[~going]
                result.u[target], result.gradient[target] = u[~going], system.gradient[~going]
                result.information[target] = system[~going].dense()
                for name in ("cost", "status", "iterations"):
                    getattr(result, name)[target] = getattr(walk, name)[~going]
                lanes, u, system, walk = lanes[going], u[going], system[going], walk[going]
            if progress is not None:
                progress(batch - len(lanes), batch)
            if not len(lanes):
                break
            low, high = lower[lanes], upper[lanes]
            trial, predicted = _propose(system, walk.damping, u, low, high)
            arrived = _arrived(system, walk, u, trial, predicted, low, high, tolerance)
            last = np.isin(arrived, (Status.SMALL_STEP, Status.SMALL_REDUCTION)) & (predicted > 0.0)
            going = np.flatnonzero(arrived == Status.RUNNING)
            cost = np.where(last, np.maximum(walk.cost - predicted, 0.0), walk.cost)
            # those that have arrived take their last step unseen: it is so short
            accepted = last.copy()
            if len(going):
                cost[going], tried = evaluate(trial[going], lanes[going])
                accepted[going] = (cost < walk.cost)[going] & (predicted > 0.0)[going]
                system = system.replaced(going[accepted[going]], tried[accepted[going]])
            u = np.where(accepted[:, None], trial, u)
            walk = walk.next(arrived, accepted, cost, predicted, max_iterations)
        result.status[nothing_to_gain(result, lower, upper)] = Status.SMALL_REDUCTION
    return result


def recombined(
    problem: BlockResiduals,
    found: Solution,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    max_iterations: int = 100,
    tolerance: float = 1e-10,
) -> Solution:
    """Ends of many starts of one data set, the best one bettered by what others found for single blocks.

    That one start finds the right optimum for every block is the less likely the more blocks there are; that some start
    does for each is not. With the shared unknowns of the best end, each block takes those own unknowns of any end that
    suit it best, and all are fitted again from there.

    Parameters
    ----------
    problem, max_iterations, tolerance
        As of :func:`solve_blocks`, of which ``found`` is the result.
    lower, upper
        Bounds, shape (P,).

    Returns
    -------
    Solution
        The same, but for the best lane.
    """
    blocks = problem.blocks
    lanes = np.flatnonzero(np.isfinite(found.cost))
    if not len(lanes):
        return found
    best = found.best(lower, upper)
    result = Solution(**{f.name: getattr(found, f.name).copy() for f in fields(Solution)})
    evaluate = _Evaluation(problem)
    for _ in range(RECOMBINATIONS):
        u = result.u[lanes]
        u[:, blocks.shared] = result.u[best, blocks.shared]
        cost = evaluate.by_block(u, lanes)
        cost[~np.isfinite(cost)] = np.inf
        before = cost[np.searchsorted(lanes, best)].sum()
        if not cost.min(axis=0).sum() < before * (1.0 - NOTHING_TO_GAIN):
            break
        mixed = result.u[best].copy()
        mixed[blocks.own] = u[cost.argmin(axis=0)[:, None], blocks.own]
        again = solve_blocks(
            problem, mixed[None], lower, upper, max_iterations=max_iterations, tolerance=tolerance
        )
        if not again.cost[0] < result.cost[best]:
            break
        for f in fields(Solution):
            getattr(result, f.name)[best] = getattr(again, f.name)[0]
    return result


@dataclass(frozen=True)
class _Walk:
    """How each of n problems goes on; every attribute of shape (n,).

    Attributes
    ----------
    cost, status, iterations
        See :class:`~pbrdf.inversion.solver.Solution`.
    damping, growth
        Marquardt's λ, and by what it grows when a step is refused.
    slow
        Steps in turn that gained next to nothing.
    """

    cost: np.ndarray
    status: np.ndarray
    iterations: np.ndarray
    damping: np.ndarray
    growth: np.ndarray
    slow: np.ndarray

    @classmethod
    def initial(cls, cost: np.ndarray, free: np.ndarray) -> _Walk:
        """From the cost at the start; where no unknown is ``free`` there is nothing to try."""
        status = np.where(free, Status.RUNNING, Status.ZERO_GRADIENT)
        status = np.where(np.isfinite(cost), status, Status.NOT_FINITE)
        none = np.zeros(len(cost), dtype=np.int64)
        return cls(cost, status, none + 1, np.full(len(cost), DAMPING), np.full(len(cost), 2.0), none)

    def __getitem__(self, chosen: np.ndarray) -> _Walk:
        return _Walk(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def next(
        self, arrived: np.ndarray, accepted: np.ndarray, cost: np.ndarray, predicted: np.ndarray, limit: int
    ) -> _Walk:
        """After a step: damping by Nielsen's rule, and whether the problem is done."""
        gain = (self.cost - cost) / np.maximum(predicted, _TINY)
        factor = np.clip(1.0 - (2.0 * gain - 1.0) ** 3, 1.0 / 5.0, 2.0)
        slow = np.where(self.cost - cost > CREEPING * self.cost, 0, self.slow + 1)
        stalled = (self.damping > 1e12) | (slow >= PATIENCE)
        status = np.where(self.iterations >= limit, Status.ITERATIONS, Status.RUNNING)
        status = np.where(stalled, Status.STALLED, status)
        return _Walk(
            cost=np.where(accepted, cost, self.cost),
            status=np.where(arrived == Status.RUNNING, status, arrived),
            iterations=self.iterations + 1,
            damping=np.where(accepted, np.maximum(self.damping * factor, 1e-12), self.damping * self.growth),
            growth=np.where(accepted, 2.0, np.minimum(2.0 * self.growth, 64.0)),
            slow=slow,
        )


@dataclass(frozen=True)
class _System:
    """Normal equations of n problems.

    Attributes
    ----------
    blocks
        Where the unknowns stand.
    shared
        JᵀJ of the shared unknowns, shape (n, S, S).
    mixed
        Of shared and own ones, shape (n, G, S, L).
    own
        Of each block's own ones, shape (n, G, L, L).
    gradient
        Jᵀr, shape (n, P).
    """

    blocks: Blocks
    shared: np.ndarray
    mixed: np.ndarray
    own: np.ndarray
    gradient: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> _System:
        return _System(
            self.blocks, self.shared[chosen], self.mixed[chosen], self.own[chosen], self.gradient[chosen]
        )

    def replaced(self, chosen: np.ndarray, other: _System) -> _System:
        """With another's problems in the place of the chosen ones."""
        if len(chosen) == len(self.shared):
            return other
        for name in ("shared", "mixed", "own", "gradient"):
            getattr(self, name)[chosen] = getattr(other, name)
        return self

    def joined(self, shared: np.ndarray, own: np.ndarray) -> np.ndarray:
        """All unknowns, shape (n, P), from the shared ones, (n, S), and the blocks' own, (n, G, L)."""
        result = np.empty((len(shared), self.gradient.shape[1]), dtype=shared.dtype)
        result[:, self.blocks.shared], result[:, self.blocks.own] = shared, own
        return result

    @property
    def diagonal(self) -> np.ndarray:
        """Diagonal of JᵀJ, shape (n, P)."""
        return self.joined(np.einsum("nss->ns", self.shared), np.einsum("ngll->ngl", self.own))

    def times(self, x: np.ndarray) -> np.ndarray:
        """JᵀJ x, shape (n, P)."""
        shared, own = x[:, self.blocks.shared], x[:, self.blocks.own]
        return self.joined(
            np.einsum("nst,nt->ns", self.shared, shared) + np.einsum("ngsl,ngl->ns", self.mixed, own),
            np.einsum("ngsl,ns->ngl", self.mixed, shared) + np.einsum("nglk,ngk->ngl", self.own, own),
        )

    def dense(self) -> np.ndarray:
        """JᵀJ, shape (n, P, P)."""
        size = self.gradient.shape[1]
        result = np.zeros((len(self.gradient), size, size))
        shared, own = self.blocks.shared, self.blocks.own
        result[:, shared[:, None], shared] = self.shared
        result[:, shared[None, :, None], own[:, None, :]] = self.mixed
        result[:, own[:, :, None], shared[None, None, :]] = self.mixed.swapaxes(2, 3)
        result[:, own[:, :, None], own[:, None, :]] = self.own
        return result


class _Evaluation:
    """Cost and normal equations of problems at given unknowns."""

    def __init__(self, problem: BlockResiduals) -> None:
        self.problem = problem
        self.order = get_backend().upload(get_backend().UInt32, problem.order.astype(np.uint32))

    def __call__(self, u: np.ndarray, lanes: np.ndarray) -> tuple[np.ndarray, _System]:
        """Cost, shape (n,), and normal equations at u, shape (n, P); ``lanes`` are the numbers of the problems."""
        blocks = self.problem.blocks
        number, size = len(blocks.shared), blocks.own.shape[1]
        sums = self._sums(np.moveaxis(u[:, blocks.counting], 2, 0), lanes)
        cost, packed, slopes = sums[0], sums[1 : -number - size], sums[-number - size :]
        A = np.empty((*cost.shape, number + size, number + size))
        for value, i, j in zip(packed, *np.tril_indices(number + size), strict=True):
            A[..., i, j] = A[..., j, i] = value
        total = cost.sum(axis=1)
        system = _System(
            blocks,
            A[..., :number, :number].sum(axis=1),
            np.ascontiguousarray(A[..., :number, number:]),
            np.ascontiguousarray(A[..., number:, number:]),
            np.empty((len(u), u.shape[1])),
        )
        system.gradient[:, blocks.shared] = slopes[:number].sum(axis=2).T
        system.gradient[:, blocks.own] = np.moveaxis(slopes[number:], 0, 2)
        if self.problem.penalty is not None:
            r, slope = self.problem.penalty(u)
            total += 0.5 * (r * r).sum(axis=1)
            system.gradient[:] += slope * r
            system.shared[:, range(number), range(number)] += slope[:, blocks.shared] ** 2
            system.own[:, :, range(size), range(size)] += slope[:, blocks.own] ** 2
        return total, system

    def by_block(self, u: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        """Cost of each block, shape (n, G), with the penalties of its own unknowns, not of the shared ones."""
        blocks = self.problem.blocks
        cost: np.ndarray = self._sums(np.moveaxis(u[:, blocks.counting], 2, 0), lanes)[0]
        if self.problem.penalty is not None:
            cost = cost + 0.5 * (self.problem.penalty(u)[0][:, blocks.own] ** 2).sum(axis=2)
        return cost

    def _sums(self, u: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        """½ Σ r², the lower triangle of JᵀJ by rows, and Jᵀr of n problems and G blocks, shape (…, n, G).

        ``u`` has shape (S + L, n, G). Problems of one block are computed side by side, as their points take the same
        branches; where they are few, each shares out its points to several lanes.
        """
        import drjit as dr

        backend = get_backend()
        Float, UInt32 = backend.Float, backend.UInt32
        count, groups = u.shape[1:]
        begin = self.problem.begin.astype(np.uint32)
        longest = int(np.diff(self.problem.begin).max())
        share = max(1, min(WIDTH // (count * groups), longest))
        turns = max(1, LAUNCH // (count * groups * share))
        # lanes by block, problem and share of the points
        shape = (groups, count, share)

        def columns(values: np.ndarray, kind: Any) -> Any:
            return backend.upload(kind, np.ascontiguousarray(np.broadcast_to(values, shape)).ravel())

        unknowns = [columns(v.T[:, :, None], Float) for v in u]
        lane = columns(lanes.astype(np.uint32)[None, :, None], UInt32)
        first = columns(begin[:-1, None, None] + np.arange(share, dtype=np.uint32), UInt32)
        base, end = (columns(b[:, None, None], UInt32) for b in (begin[:-1], begin[1:]))
        stride = dr.opaque(UInt32, share)
        total: list[Any] | None = None
        for turn in range(0, -(-longest // share), turns):
            here = first + dr.opaque(UInt32, turn * share)
            until = dr.minimum(end, base + dr.opaque(UInt32, (turn + turns) * share))
            cost, A, g = point_sums(self.problem.residuals, unknowns, lane, here, stride, until, self.order)
            part = [cost, *A, *g]
            total = part if total is None else [a + b for a, b in zip(total, part, strict=True)]
            dr.eval(total)
            dr.sync_thread()  # here an interrupt is heard
        assert total is not None
        return np.stack([x.numpy().reshape(shape).sum(axis=2).T for x in total])


def _leaving(g: np.ndarray, u: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which unknowns stand on a bound and would leave through it: they are held."""
    return ((u <= low) & (g > 0.0)) | ((u >= high) & (g < 0.0))


def _propose(
    system: _System, damping: np.ndarray, u: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where every problem goes next, and the reduction of the cost that the quadratic model promises there."""
    held = _leaving(system.gradient, u, low, high)
    trial = np.clip(u + _bounded_step(system, damping, held, u, low, high), low, high)
    step = trial - u
    return trial, -np.einsum("ni,ni->n", step, system.gradient + 0.5 * system.times(step))


def _arrived(
    system: _System,
    walk: _Walk,
    u: np.ndarray,
    trial: np.ndarray,
    predicted: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    tolerance: float,
) -> np.ndarray:
    """Why a problem need not be evaluated where it would go next, as it stands at a minimum; RUNNING where it must."""
    length = (np.abs(trial - u) / np.maximum(high - low, _TINY)).max(axis=1)
    # largest squared cosine between the residuals and a column of J
    cosine2 = system.gradient**2 / np.maximum(2.0 * system.diagonal * walk.cost[:, None], _TINY)
    slope2 = np.where(_leaving(system.gradient, u, low, high), 0.0, cosine2).max(axis=1)
    # a step is small because the minimum is near only if damping has not made it so
    free = walk.damping <= 1.0
    small = (predicted >= 0.0) & (predicted <= max(tolerance * tolerance, LAST_STEP) * walk.cost)
    status = np.where(free & small, Status.SMALL_REDUCTION, Status.RUNNING)
    status = np.where(free & (length < tolerance), Status.SMALL_STEP, status)
    return np.where(slope2 <= tolerance * tolerance, Status.ZERO_GRADIENT, status)


def _bounded_step(
    system: _System, damping: np.ndarray, held: np.ndarray, u: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Solve (A + λ diag A) δ = −g, then again with the unknowns on the bounds that they would cross."""
    known = np.zeros_like(u)
    step = _damped_step(system, damping, held, known)
    for _ in range(BOUND_PASSES):
        outside = ~held & ((u + step < low) | (u + step > high))
        if not outside.any():
            break
        known = np.where(outside, np.clip(u + step, low, high) - u, known)
        held = held | outside
        step = _damped_step(system, damping, held, known)
    return step


def _damped_step(system: _System, damping: np.ndarray, held: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Solve (A + λ diag A) δ = −g for the unknowns that are not held at ``known`` steps, by the Schur complement."""
    shared, own = system.blocks.shared, system.blocks.own
    diagonal = system.diagonal
    # scale to a unit diagonal first: unknowns without influence get a unit row and no step
    idle = held | ~(diagonal > 0.0)
    scale = np.where(idle, 0.0, 1.0 / np.sqrt(np.maximum(diagonal, _TINY)))
    right = -(system.gradient + system.times(known)) * scale
    scale_s, scale_o = scale[:, shared], scale[:, own]
    damped = 1.0 + damping[:, None]
    own_own = system.own * scale_o[..., :, None] * scale_o[..., None, :]
    np.einsum("ngll->ngl", own_own)[:] = damped[..., None]
    own_shared = system.mixed.swapaxes(2, 3) * scale_o[..., None] * scale_s[:, None, None, :]
    shared_shared = system.shared * scale_s[:, :, None] * scale_s[:, None, :]
    np.einsum("nss->ns", shared_shared)[:] = damped
    L = _cholesky(own_own)
    W, y = _forward(L, own_shared), _forward(L, right[:, own][..., None])
    K = _cholesky(shared_shared - np.einsum("ngls,nglt->nst", W, W, optimize=True))
    z = _forward(K, (right[:, shared] - np.einsum("ngls,ngl->ns", W, y[..., 0]))[..., None])
    step_s = _backward(K, z)
    step_o = _backward(L, y - W @ step_s[:, None])
    step = system.joined(step_s[..., 0], step_o[..., 0]) * scale
    return np.where(held, known, step)


def _cholesky(A: np.ndarray) -> np.ndarray:
    """Lower triangular L with L Lᵀ = A, (…, M, M); no pivot is less than what rounding leaves of 1."""
    L = np.zeros_like(A)
    for i in range(A.shape[-1]):
        column = A[..., i:, i] - (L[..., i:, :i] @ L[..., i, :i, None])[..., 0]
        pivot = np.sqrt(np.maximum(column[..., :1], 1e-14))
        L[..., i:, i] = column / pivot
        L[..., i, i] = pivot[..., 0]
    return L


def _forward(L: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve L x = right, (…, M, K)."""
    x = np.empty_like(right)
    for i in range(L.shape[-1]):
        x[..., i, :] = (right[..., i, :] - (L[..., i, None, :i] @ x[..., :i, :])[..., 0, :]) / L[
            ..., i, i, None
        ]
    return x


def _backward(L: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve Lᵀ x = right, (…, M, K)."""
    x = np.empty_like(right)
    for i in reversed(range(L.shape[-1])):
        known = (L[..., i + 1 :, i][..., None, :] @ x[..., i + 1 :, :])[..., 0, :]
        x[..., i, :] = (right[..., i, :] - known) / L[..., i, i, None]
    return x
