"""Batched Levenberg-Marquardt: thousands of bounded least-squares problems at once.

One lane of the computation is one problem (one start of one data set, one pixel of a map). An iteration is
one kernel: it solves the damped normal equations of every lane, projects the step onto the bounds, evaluates
residuals and their exact derivatives (forward mode) at the trial point inside a symbolic loop over the
geometries, and accepts or rejects. Lanes that have converged leave the batch. The kernel is compiled once,
whatever the number of lanes, geometries, parameter values or bounds.

Few lanes over many points ("wide") would leave most of the processor idle and run for minutes in one kernel: there an
iteration is several kernels, the points of a lane are dealt out to lanes of their own, a slice of them at a time, and
their sums are added up. Between kernels Python is heard, so a fit can be interrupted.

Large batches of many lanes or points run in single precision first, then from their ends in double precision, where
mostly one evaluation is left: it checks what was found, and its step, too short to be looked at, makes it exact.

The method is Levenberg-Marquardt with Marquardt's scaling, the damping update of Nielsen (1999) and
projection onto the bounds with an active set (compare Kanzow, Yamashita and Fukushima, J. Comput. Appl. Math.
172, 375 (2004)): unknowns that a step would carry across a bound are put on it and the step of the others is
solved again.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pbrdf.backend import get_backend

__all__ = [
    "CONVERGED",
    "LOSSES",
    "Residuals",
    "Solution",
    "Status",
    "costs",
    "linearise",
    "on_bounds",
    "solve",
]

#: Iterations of one kernel launch, after which stopped lanes leave the batch. A batch of at most SMALL_BATCH
#: lanes runs for as many as make LAUNCH evaluations: recording the kernel anew would take longer than idle lanes do.
ROUNDS, SMALL_BATCH, LAUNCH = 10, 1024, 1 << 18
#: Up to SMALL_BATCH lanes that make more than SLICE evaluations in an iteration, over MANY_POINTS points or more, are
#: wide: SLICE evaluations a launch (about half a second of one core), shared by about WIDTH lanes.
SLICE, MANY_POINTS, WIDTH = 1 << 15, 128, 2048

#: An unknown stands on a bound that is no farther than this part of its range.
BOUND_MARGIN = 1e-9
#: How often a step is solved again with the unknowns that would cross a bound held on it.
BOUND_PASSES = 2
#: From so many evaluations in an iteration on, a batch is searched in single precision first, which takes a third of
#: the time; a kernel more has to be compiled, which fewer would not bring in.
WORTH_SINGLE = 1 << 16
#: The last of that batch, one in so many, go on in double precision as they are.
FEW = 64
#: Marquardt's damping at the start, and where the minimum is near.
DAMPING, DAMPING_NEAR = 1e-3, 1e-6

#: An unknown whose whole range changes the residuals by less than this part of them has no influence but rounding's.
NO_INFLUENCE = 1e-10
#: A lane stalls that gains no more than this part of the cost in so many steps: kinks of a model make it creep.
CREEPING, PATIENCE, PATIENCE_SINGLE = 1e-8, 12, 3
#: A step that promises no more than this part of the cost is the last: it is taken unseen. With χ² about 100 it is some
#: 5e-5 standard errors long, and what it leaves is as small against it as it is against the one before. Where single
#: precision has come near the minimum, the step is damped less and so leaves less; in single precision itself, a
#: shorter one would not stand out of rounding.
LAST_STEP, LAST_STEP_NEAR, LAST_STEP_SINGLE = 1e-11, 1e-9, 1e-7
#: A lane that stalled stands at a minimum, but for rounding and kinks, if no more than this part of the cost is left to
#: gain: with χ² about 100, far less than tells one set of parameters from another.
NOTHING_TO_GAIN = 1e-6


#: What is evaluated: unknowns, lane and point to values and whatever was computed on the way.
Function = Callable[[list[Any], Any, Any], tuple[Sequence[Any], Any]]


def _soft_l1(z: Any) -> tuple[Any, Any]:
    import drjit as dr

    root = dr.sqrt(1.0 + z)
    return 2.0 * (root - 1.0), 1.0 / root


def _huber(z: Any) -> tuple[Any, Any]:
    import drjit as dr

    root = dr.sqrt(dr.maximum(z, 1.0))
    return dr.select(z <= 1.0, z, 2.0 * root - 1.0), 1.0 / root


def _cauchy(z: Any) -> tuple[Any, Any]:
    import drjit as dr

    return dr.log(1.0 + z), 1.0 / (1.0 + z)


#: Losses ρ(z) of z = r², with their derivative ρ', as in SciPy's ``least_squares``.
LOSSES: dict[str, Callable[[Any], tuple[Any, Any]]] = {
    "linear": lambda z: (z, 1.0),
    "soft_l1": _soft_l1,
    "huber": _huber,
    "cauchy": _cauchy,
}


class Status(enum.IntEnum):
    """Why a lane stopped."""

    RUNNING = 0
    SMALL_STEP = 1
    SMALL_REDUCTION = 2
    ZERO_GRADIENT = 3
    STALLED = 4
    ITERATIONS = 5
    NOT_FINITE = 6

    @property
    def converged(self) -> bool:
        """Whether the lane stands at a (local) minimum."""
        return self in (Status.SMALL_STEP, Status.SMALL_REDUCTION, Status.ZERO_GRADIENT)


#: Why a lane stopped that stands at a minimum.
CONVERGED = [status for status in Status if status.converged]


@dataclass(frozen=True)
class Residuals:
    """What the solver minimises: ½ Σ ρ(r²) over the points of a lane, plus ½ Σ of squared penalties.

    Attributes
    ----------
    function
        ``function(u, lane, point)`` returns a list of Dr.Jit floats, the weighted residuals at one point for
        the unknowns ``u`` (a list of floats), and whatever else was computed on the way: Dr.Jit 1.5 crashes
        when an output of a differentiated loop has been released before the derivatives are propagated.
        ``lane`` and ``point`` are uint32 indices.
    points
        Number of points that every lane runs over.
    penalty
        ``penalty(u)`` returns triples (i, r, dr/du_i) of residuals that depend on one unknown each: Gaussian
        priors. They are not subject to the loss.
    loss
        ρ: one of ``LOSSES``; r is in standard deviations, so a loss departs from squares at about 1.
    order
        The points such that neighbours take the same branches, shape (points,): neighbours are computed side by side
        where lanes share out their points. None for as they are.
    single
        Makes the same residuals over float32, for the search of large batches; None where there are none.
    """

    function: Function
    points: int
    penalty: Callable[[list[Any]], list[tuple[int, Any, Any]]] | None = None
    loss: str = "linear"
    order: np.ndarray | None = None
    single: Callable[[], Residuals] | None = None


@dataclass(frozen=True)
class Solution:
    """Result of :func:`solve`; B lanes, P unknowns.

    Attributes
    ----------
    u
        Unknowns, shape (B, P).
    cost
        What was minimised, ½ Σ ρ(r²) + ½ Σ penalty², shape (B,).
    information
        JᵀJ at ``u``, or a last step of no account before it, shape (B, P, P).
    gradient
        Jᵀr at ``u``, after that last step by the quadratic model, as the cost, shape (B, P).
    status
        Values of :class:`Status`, shape (B,).
    iterations
        Steps tried, shape (B,).
    """

    u: np.ndarray
    cost: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    status: np.ndarray
    iterations: np.ndarray

    @property
    def converged(self) -> np.ndarray:
        """Mask of the lanes that stand at a minimum, shape (B,)."""
        return np.isin(self.status, CONVERGED)

    def best(self, lower: np.ndarray, upper: np.ndarray) -> int:
        """Number of the lane of the lowest cost: among those as low but for rounding, one at a minimum.

        Of these again one that stands on the fewest of the bounds, shape (P,) each: the end of a valley of equal cost
        that a bound cuts off is no better than any other place in it, but looks determined.
        """
        cost = np.where(np.isfinite(self.cost), self.cost, np.inf)
        as_low = np.flatnonzero(cost <= cost.min() * (1.0 + NOTHING_TO_GAIN))
        held = np.logical_or(*on_bounds(self.u, lower, upper)).sum(axis=1)
        return int(min(as_low, key=lambda lane: (not self.converged[lane], held[lane], cost[lane])))


def on_bounds(u: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which unknowns stand on their lower and on their upper bound, of shapes that broadcast."""
    margin = BOUND_MARGIN * (upper - lower)
    return u <= lower + margin, u >= upper - margin


def solve(
    residuals: Residuals,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    max_iterations: int = 100,
    tolerance: float = 1e-10,
    progress: Callable[[int, int], None] | None = None,
    search: bool = False,
    near: bool = False,
) -> Solution:
    """Minimise ½ Σ r² for every lane within bounds.

    Parameters
    ----------
    residuals
        The problem.
    start
        Starting values, shape (B, P); moved onto the bounds where outside.
    lower, upper
        Bounds, shape (P,), or (B, P) for bounds of each lane's own; an unknown whose two bounds are equal stays
        there, which is how profiles hold one.
    max_iterations
        Steps tried at most.
    tolerance
        A lane stops when the step, in units of the range of each unknown, or the predicted relative
        reduction of the cost over ``tolerance`` falls below ``tolerance``.
    progress
        Called after each iteration with the number of stopped lanes and of all lanes.
    search
        Whether to stop where single precision does, whatever the size of the batch.
    near
        Whether the starts are near the minimum: then there is little damping, and no search in single precision.

    Returns
    -------
    Solution
        With whatever was reached; look at ``status``.
    """
    lower, upper = (np.broadcast_to(np.asarray(b, dtype=float), start.shape) for b in (lower, upper))
    start = np.clip(start, lower, upper)
    damping = np.full(len(start), DAMPING_NEAR if near else DAMPING)
    last = np.full(len(start), LAST_STEP_NEAR if near else LAST_STEP)
    tried = np.zeros(len(start), dtype=int)
    large = len(start) * residuals.points >= WORTH_SINGLE
    if residuals.single is not None and (search or (large and not near)):
        rough = _solve(
            residuals.single(),
            start,
            lower,
            upper,
            damping,
            np.full(len(start), LAST_STEP_SINGLE),
            max_iterations,
            tolerance,
            progress,
            single=True,
            sums=search,
        )
        if search:
            return rough.solution()
        # rounding makes lanes stall in single precision that stand at their minimum
        close = np.isin(rough.status, [*CONVERGED, Status.STALLED])
        start = np.where(np.isfinite(rough.cost)[:, None], np.clip(rough.u.T, lower, upper), start)
        damping, last = np.where(close, DAMPING_NEAR, DAMPING), np.where(close, LAST_STEP_NEAR, LAST_STEP)
        tried, progress = rough.iterations, None
    solution = _solve(
        residuals, start, lower, upper, damping, last, max_iterations, tolerance, progress
    ).solution()
    solution.iterations[:] += tried
    solution.status[nothing_to_gain(solution, lower, upper)] = Status.SMALL_REDUCTION
    return solution


def _solve(
    residuals: Residuals,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    damping: np.ndarray,
    last: np.ndarray,
    max_iterations: int,
    tolerance: float,
    progress: Callable[[int, int], None] | None,
    *,
    single: bool = False,
    sums: bool = True,
) -> _Result:
    """:func:`solve` in one precision, from starts within the bounds; a first damping and last step of each."""
    import drjit as dr

    backend = get_backend()
    Float, UInt32 = backend.Float32 if single else backend.Float, backend.UInt32
    batch, size = start.shape
    result = _Result(batch, size, sums=sums)
    # a batch of one would be compiled apart, as a broadcast: double it
    lanes = np.arange(batch, dtype=np.uint32) if batch > 1 else np.zeros(2, dtype=np.uint32)
    doubled = [values if batch > 1 else values[lanes] for values in (start, lower, upper, damping, last)]
    state = _State.initial(backend, Float, *doubled)
    limit = dr.opaque(UInt32, max_iterations)
    small = dr.opaque(Float, tolerance)
    few = batch // FEW if single else 0
    while len(lanes) > few:
        active = backend.upload(UInt32, lanes)
        wide = len(lanes) <= SMALL_BATCH and len(lanes) * residuals.points > SLICE
        wide &= residuals.points >= MANY_POINTS
        state = (_wide_iteration if wide else _iterations)(residuals, state, active, small, limit)
        status = state.status.numpy()
        done = status != Status.RUNNING
        if done.any():
            result.store(lanes, np.flatnonzero(done), state, status)
            rest = np.flatnonzero(~done).astype(np.uint32)
            if len(rest) == 1:
                rest = rest.repeat(2)
            lanes = lanes[rest]
            if len(rest):
                state = state.gather(backend.upload(UInt32, rest))
        if progress is not None:
            progress(max(batch - len(lanes), 0), batch)
    if len(lanes):
        result.store(lanes, np.arange(len(lanes)), state, state.status.numpy())
    return result


def costs(residuals: Residuals, u: np.ndarray) -> np.ndarray:
    """½ Σ ρ(r²) of every lane over its points, penalties left out, in single precision where there are such residuals.

    Parameters
    ----------
    residuals
        The problem.
    u
        Unknowns, shape (B, P).

    Returns
    -------
    ndarray
        Shape (B,).
    """
    import drjit as dr

    backend = get_backend()
    single = residuals.single is not None
    used = residuals.single() if residuals.single is not None else residuals
    Float, UInt32 = backend.Float32 if single else backend.Float, backend.UInt32
    batch = len(u)
    # a batch of one would be compiled apart
    lanes = np.arange(batch, dtype=np.uint32) if batch > 1 else np.zeros(2, dtype=np.uint32)
    columns = [backend.upload(Float, column) for column in u[lanes].T]
    lane = backend.upload(UInt32, lanes)
    end = dr.opaque(UInt32, used.points)

    def body(point: Any, total: Any) -> tuple[Any, Any]:
        values, _ = used.function(columns, lane, point)
        for r in values:
            total = total + 0.5 * LOSSES[used.loss](Float(r) * r)[0]
        return point + 1, total

    with dr.suspend_grad():
        total = dr.while_loop(
            (dr.zeros(UInt32, len(lanes)), dr.zeros(Float, len(lanes))),
            lambda point, total: point < end,
            body,
            mode="symbolic",
            label="costs",
        )[1]
    return np.asarray(total.numpy()[:batch], dtype=float)


def linearise(function: Function, u: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Values of a function and their exact derivatives by the unknowns, lane by lane, at point 0 of each.

    Parameters
    ----------
    function
        As in :class:`Residuals`, returning ``size`` values.
    u
        Unknowns, shape (B, P).
    size
        Number of values.

    Returns
    -------
    values, jacobian
        Shapes (B, C) and (B, C, P).
    """
    import drjit as dr

    backend = get_backend()
    Float, UInt32 = backend.Float, backend.UInt32
    batch, unknowns = u.shape
    # a batch of one would be compiled apart
    padded = u if batch > 1 else u.repeat(2, axis=0)
    columns = [backend.upload(Float, padded[:, i]) for i in range(unknowns)]
    lane = dr.arange(UInt32, len(padded))
    turns = dr.opaque(UInt32, 1)
    zeros = [dr.zeros(Float, len(padded)) for _ in range(size)]

    # a loop of one turn: derivatives of loops inside the function need a loop around them
    def body(turn: Any, u: list[Any], lane: Any, values: list[Any], J: list[list[Any]]) -> tuple[Any, ...]:
        values, J = _jacobian(function, u, lane, turn)
        return turn + 1, u, lane, values, J

    out = dr.while_loop(
        (UInt32(0), columns, lane, zeros, [list(zeros) for _ in range(unknowns)]),
        lambda turn, *_: turn < turns,
        body,
        mode="symbolic",
        label="linearise",
    )
    dr.eval(out)
    values = np.stack([x.numpy() for x in out[3]], axis=-1)
    jacobian = np.stack([np.stack([x.numpy() for x in column], axis=-1) for column in out[4]], axis=-1)
    return values[:batch], jacobian[:batch]


@dataclass
class _State:
    """Everything that an iteration hands to the next, as Dr.Jit arrays over the running lanes."""

    u: list[Any]
    low: list[Any]
    high: list[Any]
    cost: Any
    A: list[Any]
    g: list[Any]
    damping: Any
    growth: Any
    status: Any
    iterations: Any
    slow: Any
    last: Any

    @classmethod
    def initial(
        cls,
        backend: Any,
        Float: Any,
        start: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        damping: np.ndarray,
        last: np.ndarray,
    ) -> _State:
        # infinite cost and an identity for JᵀJ: the first "step" has length 0 and is always accepted
        import drjit as dr

        batch, size = start.shape

        def full(value: float) -> Any:
            return dr.opaque(Float, value, batch)

        def columns(values: np.ndarray) -> list[Any]:
            return [backend.upload(Float, values[:, i]) for i in range(size)]

        return cls(
            u=columns(start),
            low=columns(lower),
            high=columns(upper),
            cost=full(np.inf),
            A=[full(1.0 if i == j else 0.0) for i in range(size) for j in range(i + 1)],
            g=[full(0.0) for _ in range(size)],
            damping=backend.upload(Float, damping),
            growth=full(2.0),
            status=dr.opaque(backend.UInt32, 0, batch),
            iterations=dr.opaque(backend.UInt32, 0, batch),
            slow=dr.opaque(backend.UInt32, 0, batch),
            last=backend.upload(Float, last),
        )

    def gather(self, index: Any) -> _State:
        """Only the lanes of ``index``."""
        import drjit as dr

        def take(value: Any) -> Any:
            return (
                [take(v) for v in value] if isinstance(value, list) else dr.gather(type(value), value, index)
            )

        state = _State(**{f.name: take(getattr(self, f.name)) for f in fields(self)})
        dr.eval(state)
        return state


#: Fields of a state that iterations leave as they are.
_FIXED = ("low", "high", "last")


class _Result:
    """Collects lanes as they stop, an unknown or a sum a row, as Dr.Jit has them; with or without the sums."""

    def __init__(self, batch: int, size: int, *, sums: bool) -> None:
        self._sums = sums
        self.u = np.empty((size, batch))
        self.cost = np.empty(batch)
        self.A = np.empty((size * (size + 1) // 2, batch))
        self.g = np.empty((size, batch))
        self.status = np.empty(batch, dtype=np.int64)
        self.iterations = np.empty(batch, dtype=np.int64)

    def store(self, lanes: np.ndarray, done: np.ndarray, state: _State, status: np.ndarray) -> None:
        target = lanes[done]
        rows = [(self.cost, state.cost), (self.status, state.status), (self.iterations, state.iterations)]
        rows += zip(self.u, state.u, strict=True)
        if self._sums:
            rows += [*zip(self.A, state.A, strict=True), *zip(self.g, state.g, strict=True)]
        # whole arrays are copied in a fraction of the time
        batch = len(self.cost)
        everything = len(target) == batch == len(status) and np.array_equal(target, np.arange(batch))
        for row, value in rows:
            if everything:
                row[:] = value.numpy()
            else:
                row[target] = value.numpy()[done]

    def solution(self) -> Solution:
        size = len(self.u)
        place = np.empty((size, size), dtype=int)
        for c, (i, j) in enumerate(zip(*np.tril_indices(size), strict=True)):
            place[i, j] = place[j, i] = c
        information = self.A[place].transpose(2, 0, 1)
        return Solution(self.u.T, self.cost, information, self.g.T, self.status, self.iterations)


def _iterations(
    residuals: Residuals,
    state: _State,
    lane: Any,
    tolerance: Any,
    limit: Any,
) -> _State:
    """Some iterations of the lanes that still run, in one kernel."""
    import drjit as dr

    UInt32 = type(lane)
    many = max(ROUNDS, LAUNCH // (len(lane) * residuals.points))
    rounds = dr.opaque(UInt32, ROUNDS if len(lane) > SMALL_BATCH else many)

    # what stays the same is captured: as state of the loop, Dr.Jit would record the body twice to find that out
    changing = {f.name: getattr(state, f.name) for f in fields(_State) if f.name not in _FIXED}

    def body(count: Any, changing: dict[str, Any]) -> tuple[Any, ...]:
        reached = _iterate(residuals, replace(state, **changing), lane, tolerance, limit)
        return count + 1, {name: getattr(reached, name) for name in changing}

    found = dr.while_loop(
        (UInt32(0), changing),
        lambda count, changing: (count < rounds) & (changing["status"] == int(Status.RUNNING)),
        body,
        mode="symbolic",
        label="Levenberg-Marquardt",
    )[1]
    dr.eval(found)
    return replace(state, **found)


def _iterate(
    residuals: Residuals,
    state: _State,
    lane: Any,
    tolerance: Any,
    limit: Any,
) -> _State:
    """One step of every lane."""
    trial, predicted = _propose(state)
    going = _arrived(state, trial, predicted, tolerance) == int(Status.RUNNING)
    evaluated = _normal_equations(residuals, trial, lane, going)
    return _judge(state, trial, predicted, evaluated, tolerance, limit)


def _wide_iteration(residuals: Residuals, state: _State, lane: Any, tolerance: Any, limit: Any) -> _State:
    """One step of every lane, where the lanes are few and the points many."""
    import drjit as dr

    trial, predicted = _propose(state)
    going = _arrived(state, trial, predicted, tolerance) == int(Status.RUNNING)
    dr.eval(trial, predicted, going)
    evaluated = _wide_normal_equations(residuals, trial, lane, going)
    state = _judge(state, trial, predicted, evaluated, tolerance, limit)
    dr.eval(state)
    return state


def _propose(state: _State) -> tuple[list[Any], Any]:
    """Where every lane goes next, and the reduction of the cost that the quadratic model promises there."""
    import drjit as dr

    u, g, size, low, high = state.u, state.g, len(state.u), state.low, state.high
    A = _unpack(state.A, size)
    step = _bounded_step(A, g, state.damping, u, low, high)
    trial = [dr.clip(u[i] + step[i], low[i], high[i]) for i in range(size)]
    delta = [trial[i] - u[i] for i in range(size)]
    # −(gᵀδ + ½ δᵀAδ), the reduction that the quadratic model promises for the projected step
    predicted = -sum(
        delta[i] * (g[i] + 0.5 * sum(A[max(i, j)][min(i, j)] * delta[j] for j in range(size)))
        for i in range(size)
    )
    return trial, predicted


def _arrived(state: _State, trial: list[Any], predicted: Any, tolerance: Any) -> Any:
    """Why a lane need not go where it would go next, as it stands at a minimum; RUNNING where it does."""
    import drjit as dr

    u, g, size, low, high = state.u, state.g, len(state.u), state.low, state.high
    A = _unpack(state.A, size)
    Float, U = type(predicted), type(state.status)
    tiny = _tiny(Float)
    length = dr.zeros(Float, 1)
    slope2 = dr.zeros(Float, 1)  # largest squared cosine between the residuals and a column of J
    leaving = _leaving(g, u, low, high)
    for i in range(size):
        length = dr.maximum(length, dr.abs(trial[i] - u[i]) / dr.maximum(high[i] - low[i], tiny))
        cosine2 = g[i] * g[i] / dr.maximum(2.0 * A[i][i] * state.cost, tiny)
        slope2 = dr.maximum(slope2, dr.select(leaving[i], 0.0, cosine2))
    # a step is small because the minimum is near only if damping has not made it so
    free = state.damping <= 1.0
    small = (predicted >= 0.0) & (predicted <= dr.maximum(tolerance * tolerance, state.last) * state.cost)
    status = dr.select(free & small, U(int(Status.SMALL_REDUCTION)), U(int(Status.RUNNING)))
    status = dr.select(free & (length < tolerance), U(int(Status.SMALL_STEP)), status)
    status = dr.select(slope2 <= tolerance * tolerance, U(int(Status.ZERO_GRADIENT)), status)
    return dr.select(dr.isfinite(state.cost), status, U(int(Status.RUNNING)))


def _judge(
    state: _State,
    trial: list[Any],
    predicted: Any,
    evaluated: tuple[Any, list[Any], list[Any]],
    tolerance: Any,
    limit: Any,
) -> _State:
    """See which lanes had arrived, and accept or reject what the others tried."""
    import drjit as dr

    arrived = _arrived(state, trial, predicted, tolerance)
    going = arrived == int(Status.RUNNING)
    cost, packed, gradient = evaluated
    first = ~dr.isfinite(state.cost)
    finite = dr.isfinite(cost)
    accepted = going & finite & (((cost < state.cost) & (predicted > 0.0)) | first)
    gain = dr.select(first, 1.0, (state.cost - cost) / dr.maximum(predicted, _tiny(type(cost))))
    factor = dr.clip(1.0 - (2.0 * gain - 1.0) ** 3, 1.0 / 5.0, 2.0)
    damping = dr.select(
        accepted,
        dr.select(first, state.damping, dr.maximum(state.damping * factor, 1e-12)),
        state.damping * state.growth,
    )
    growth = dr.select(accepted, 2.0, dr.minimum(2.0 * state.growth, 64.0))

    U = type(state.status)
    patience = PATIENCE_SINGLE if _is_single(type(cost)) else PATIENCE
    slow = dr.select(state.cost - cost > CREEPING * state.cost, U(0), state.slow + 1)
    status = dr.select((state.damping > 1e12) | (slow >= patience), U(int(Status.STALLED)), U(0))
    status = dr.select(going, status, arrived)
    status = dr.select((status == 0) & (state.iterations >= limit), U(int(Status.ITERATIONS)), status)
    # where every unknown is held there is nothing to try
    held = state.high[0] <= state.low[0]
    for low, high in zip(state.low[1:], state.high[1:], strict=True):
        held = held & (high <= low)
    begun = dr.select(held, U(int(Status.ZERO_GRADIENT)), U(int(Status.RUNNING)))
    status = dr.select(first, dr.select(finite, begun, U(int(Status.NOT_FINITE))), status)

    def keep(new: list[Any], old: list[Any]) -> list[Any]:
        return [dr.select(accepted, a, b) for a, b in zip(new, old, strict=True)]

    # the last step is so short that its end need not be looked at
    last = ((arrived == int(Status.SMALL_REDUCTION)) | (arrived == int(Status.SMALL_STEP))) & (
        predicted > 0.0
    )
    return _State(
        u=[dr.select(accepted | last, a, b) for a, b in zip(trial, state.u, strict=True)],
        low=state.low,
        high=state.high,
        cost=dr.select(accepted, cost, dr.select(last, dr.maximum(state.cost - predicted, 0.0), state.cost)),
        A=keep(packed, state.A),
        g=[
            dr.select(last, after, x)
            for after, x in zip(_gradient_after(state, trial), keep(gradient, state.g), strict=True)
        ],
        damping=damping,
        growth=growth,
        status=status,
        iterations=dr.select(going, state.iterations + 1, state.iterations),
        slow=dr.select(first, U(0), slow),
        last=state.last,
    )


def _gradient_after(state: _State, trial: list[Any]) -> list[Any]:
    """Gradient of the quadratic model after a step."""
    A = _unpack(state.A, len(trial))
    delta = [a - b for a, b in zip(trial, state.u, strict=True)]
    return [
        state.g[i] + sum(A[max(i, j)][min(i, j)] * delta[j] for j in range(len(delta)))
        for i in range(len(delta))
    ]


def _wide_normal_equations(
    residuals: Residuals, u: list[Any], lane: Any, going: Any
) -> tuple[Any, list[Any], list[Any]]:
    """What :func:`_normal_equations` gives, the points of each lane shared out, a slice of them in a launch."""
    import drjit as dr

    Float, UInt32 = type(u[0]), type(lane)
    points, batch = residuals.points, len(lane)
    share = max(1, min(WIDTH // batch, points))
    slice_ = max(SLICE // batch, share)
    places = dr.opaque(UInt32, share)
    order = dr.arange(UInt32, points) if residuals.order is None else UInt32(residuals.order)
    number = dr.arange(UInt32, batch * share)
    owner = number // places
    offset = number - owner * places
    shared_u, shared_lane = [dr.gather(Float, v, owner) for v in u], dr.gather(UInt32, lane, owner)
    wanted = dr.gather(type(going), going, owner)
    dr.eval(offset, shared_u, shared_lane, wanted)
    total: list[Any] | None = None
    for begin in range(0, points, slice_):
        end = dr.select(wanted, dr.opaque(UInt32, min(begin + slice_, points)), 0)
        cost, A, g = point_sums(
            residuals, shared_u, shared_lane, offset + dr.opaque(UInt32, begin), places, end, order
        )
        dr.eval(cost, A, g)
        sums = [dr.block_sum(x, share) for x in (cost, *A, *g)]
        total = sums if total is None else [a + b for a, b in zip(total, sums, strict=True)]
        dr.eval(total)
        dr.sync_thread()  # here an interrupt is heard
    assert total is not None
    size = len(u)
    return _with_penalty(residuals, u, total[0], total[1:-size], total[-size:])


def _normal_equations(
    residuals: Residuals, u: list[Any], lane: Any, going: Any
) -> tuple[Any, list[Any], list[Any]]:
    """½ Σ r², the lower triangle of JᵀJ by rows, and Jᵀr, in a symbolic loop over the points, of lanes that go on."""
    import drjit as dr

    UInt32 = type(lane)
    one = dr.opaque(UInt32, 1)
    end = dr.select(going, dr.opaque(UInt32, residuals.points), 0)
    cost, A, g = point_sums(residuals, u, lane, UInt32(0), one, end, None)
    return _with_penalty(residuals, u, cost, A, g)


def _with_penalty(
    residuals: Residuals, u: list[Any], cost: Any, A: list[Any], g: list[Any]
) -> tuple[Any, list[Any], list[Any]]:
    """The sums over the points, with the penalties added."""
    if residuals.penalty is not None:
        for i, r, slope in residuals.penalty(u):
            cost = cost + 0.5 * r * r
            diagonal = i * (i + 1) // 2 + i
            A[diagonal] = A[diagonal] + slope * slope
            g[i] = g[i] + slope * r
    return cost, A, g


def point_sums(
    residuals: Residuals, u: list[Any], lane: Any, first: Any, stride: Any, end: Any, order: Any | None
) -> tuple[Any, list[Any], list[Any]]:
    """½ Σ r², the lower triangle of JᵀJ by rows, and Jᵀr over the points first, first + stride, … before end."""
    import drjit as dr

    size = len(u)
    Float = type(u[0])
    triangle = [(i, j) for i in range(size) for j in range(i + 1)]

    # what a turn does not change is no state of the loop: with it Dr.Jit would record the turn twice
    def body(place: Any, cost: Any, A: list[Any], g: list[Any]) -> tuple[Any, ...]:
        point = place if order is None else dr.gather(type(lane), order, place)
        r, J = _jacobian(residuals.function, u, lane, point)
        if residuals.loss == "linear":
            cost = cost + 0.5 * _inner(r, r)
            weighted = J
        else:
            # Gauss-Newton for a loss: the gradient is exact, JᵀJ takes the weights ρ' without their derivative
            losses = [LOSSES[residuals.loss](x * x) for x in r]
            cost = cost + 0.5 * sum(value for value, _ in losses)
            weighted = [[x * slope for x, (_, slope) in zip(column, losses, strict=True)] for column in J]
        A = [a + _inner(weighted[i], J[j]) for a, (i, j) in zip(A, triangle, strict=True)]
        g = [b + _inner(weighted[i], r) for i, b in enumerate(g)]
        return place + stride, cost, A, g

    zero = Float(0.0)
    with dr.suspend_grad():
        u = [dr.detach(v) for v in u]
    out = dr.while_loop(
        (first, zero, [zero] * len(triangle), [zero] * size),
        lambda place, *_: place < end,
        body,
        mode="symbolic",
        label="points",
    )
    return out[1], list(out[2]), list(out[3])


def _jacobian(function: Function, u: list[Any], lane: Any, point: Any) -> tuple[list[Any], list[list[Any]]]:
    """Values at one point and their derivatives by each unknown (forward mode), inside a symbolic loop."""
    import drjit as dr

    Float = type(u[0])
    unknown = [Float(v) for v in u]
    dr.enable_grad(unknown)
    values, alive = function(unknown, lane, point)
    r = [Float(v) for v in values]
    J: list[list[Any]] = []
    for v in unknown:
        dr.set_grad(v, 1.0)
        dr.enqueue(dr.ADMode.Forward, v)
        dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearInterior)
        J.append([dr.grad(x) for x in r])
        dr.clear_grad(r)
        dr.clear_grad(v)
    del alive
    return [dr.detach(x) for x in r], J


def _is_single(Float: Any) -> bool:
    import drjit as dr

    return bool(dr.type_v(Float) == dr.VarType.Float32)


def _tiny(Float: Any) -> float:
    """What a divisor is at least."""
    return 1e-30 if _is_single(Float) else 1e-300


def _inner(a: Sequence[Any], b: Sequence[Any]) -> Any:
    import drjit as dr

    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = dr.fma(x, y, total)
    return total


def _unpack(packed: list[Any], size: int) -> list[list[Any]]:
    rows, start = [], 0
    for i in range(size):
        rows.append(packed[start : start + i + 1])
        start += i + 1
    return rows


def _leaving(g: list[Any], u: list[Any], low: list[Any], high: list[Any]) -> list[Any]:
    """Which unknowns stand on a bound and would leave through it: they are held."""
    return [
        ((x <= a) & (slope > 0.0)) | ((x >= b) & (slope < 0.0))
        for slope, x, a, b in zip(g, u, low, high, strict=True)
    ]


def _bounded_step(
    A: list[list[Any]], g: list[Any], damping: Any, u: list[Any], low: list[Any], high: list[Any]
) -> list[Any]:
    """Solve (A + λ diag A) δ = −g, then again with the unknowns on the bounds that they would cross."""
    import drjit as dr

    size = len(u)
    Float, UInt32 = type(u[0]), dr.uint32_array_t(type(u[0]))

    # a loop, so that the equations are compiled once
    def body(turn: Any, held: list[Any], known: list[Any], step: list[Any]) -> tuple[Any, ...]:
        outside = [~held[i] & ((u[i] + step[i] < low[i]) | (u[i] + step[i] > high[i])) for i in range(size)]
        known = [
            dr.select(outside[i], dr.clip(u[i] + step[i], low[i], high[i]) - u[i], known[i])
            for i in range(size)
        ]
        held = [held[i] | outside[i] for i in range(size)]
        return turn + 1, held, known, _damped_step(A, g, damping, held, known)

    zeros = [Float(0.0) for _ in range(size)]
    return dr.while_loop(
        (UInt32(0), _leaving(g, u, low, high), zeros, list(zeros)),
        lambda turn, *_: turn <= BOUND_PASSES,
        body,
        mode="symbolic",
        label="bounded step",
    )[3]


def _damped_step(
    A: list[list[Any]], g: list[Any], damping: Any, held: list[Any], known: list[Any]
) -> list[Any]:
    """Solve (A + λ diag A) δ = −g by Cholesky for the unknowns that are not held at ``known`` steps."""
    import drjit as dr

    size = len(g)
    # scale to a unit diagonal first: unknowns without influence get a unit row and no step
    tiny = _tiny(type(g[0]))
    scale = [
        dr.select(held[i] | (A[i][i] <= 0.0), 0.0, dr.rsqrt(dr.maximum(A[i][i], tiny))) for i in range(size)
    ]
    L: list[list[Any]] = [[None] * (i + 1) for i in range(size)]
    inverse: list[Any] = [None] * size
    for i in range(size):
        for j in range(i + 1):
            value = (1.0 + damping) if i == j else A[i][j] * scale[i] * scale[j]
            for q in range(j):
                value = value - L[i][q] * L[j][q]
            if i == j:
                inverse[i] = dr.rsqrt(dr.maximum(value, 1e-6 if _is_single(type(value)) else 1e-14))
            else:
                L[i][j] = value * inverse[j]
    y: list[Any] = []
    for i in range(size):
        value = g[i]
        for j in range(size):
            if j != i:
                value = dr.fma(A[max(i, j)][min(i, j)], known[j], value)
        value = -value * scale[i]
        for q in range(i):
            value = value - L[i][q] * y[q]
        y.append(value * inverse[i])
    x: list[Any] = [None] * size
    for i in reversed(range(size)):
        value = y[i]
        for q in range(i + 1, size):
            value = value - L[q][i] * x[q]
        x[i] = value * inverse[i]
    return [dr.select(held[i], known[i], x[i] * scale[i]) for i in range(size)]


def nothing_to_gain(solution: Solution, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Numbers of the lanes that stopped short though no step, however long, promises more than nothing."""
    found = []
    for lane in np.flatnonzero(np.isin(solution.status, (Status.STALLED, Status.ITERATIONS))):
        u, g, A = solution.u[lane], solution.gradient[lane], solution.information[lane]
        leaving = ((u <= lower[lane]) & (g > 0.0)) | ((u >= upper[lane]) & (g < 0.0))
        span = upper[lane] - lower[lane]
        idle = np.diag(A) * span**2 <= NO_INFLUENCE**2 * solution.cost[lane]
        free = np.flatnonzero(~(leaving | idle))
        scale = 1.0 / np.sqrt(np.diag(A)[free])
        step = np.linalg.lstsq(A[np.ix_(free, free)] * np.outer(scale, scale), g[free] * scale, rcond=1e-12)[
            0
        ]
        if 0.5 * float(step @ (g[free] * scale)) <= NOTHING_TO_GAIN * solution.cost[lane]:
            found.append(lane)
    return np.array(found, dtype=int)
