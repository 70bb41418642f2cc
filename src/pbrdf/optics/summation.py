"""Sums over nodes of a rule, whose derivatives are summed up in the same loop.

Dr.Jit differentiates a loop forwards by running it again, with its values, once for each variable that the derivative
is taken by. Here one loop sums up the values and all their derivatives: what both need, roots and exponentials, is
computed once a node. The sums are then tied to what they depend on by these derivatives, which holds forwards and in
reverse, also where the sum itself stands inside a loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import drjit as dr

__all__ = ["differentiated", "summed"]


def summed(
    term: Callable[..., Sequence[Any]],
    count: Any,
    size: int,
    state: tuple[Any, ...],
    by: Sequence[Any] | None = None,
    label: str = "sum",
) -> list[Any]:
    """Σ_j term(j, *state) over 0 ≤ j < count, differentiable.

    Parameters
    ----------
    term
        Returns the ``size`` floats that are summed up. What it captures rather than gets from ``state`` counts as
        constant.
    count
        Number of terms, an integer of the lane's own. Where it is a Python number there is no loop in what is compiled,
        and ``term`` gets Python numbers: faster, where the terms are few.
    size
        Number of sums.
    state
        What the terms depend on: floats in nested tuples and lists, and None.
    by
        Variables that derivatives are taken by; None for what of ``state`` has derivatives. Inside the term of another
        sum, that one's :func:`differentiated` state: the derivatives are then as many as there.
    label
        Name of the loop in a listing.

    Returns
    -------
    list
        The ``size`` sums.
    """
    if isinstance(count, int):
        terms = [term(j, *state) for j in range(count)]
        return [sum(values[1:], values[0]) for values in zip(*terms, strict=True)] if terms else [0.0] * size
    leaves = list(_leaves(state))
    kind: Any = next((type(x) for x in leaves if dr.is_jit_v(x)), float)
    UInt = dr.uint32_array_t(kind)
    moving = [i for i, x in enumerate(leaves) if _moves(x)]
    if by is None:
        by = differentiated(state)
        seeds = [{i: kind(1.0) for i in moving if leaves[i].index_ad == x.index_ad} for x in by]
    else:
        by = by if moving else []
        seeds = [dict(zip(moving, _tangents(x, [leaves[i] for i in moving]), strict=True)) for x in by]

    constants = [dr.detach(x) for x in leaves]
    width = dr.width(constants, count)
    for i in moving:
        # a derivative that is wider than its variable would be added up over the lanes
        constants[i] = constants[i] + dr.zeros(kind, width)

    # what stays the same is captured: as state of the loop, Dr.Jit would record the body twice to find that out
    def body(j: Any, total: Any, slopes: Any) -> tuple[Any, ...]:
        own = list(constants)
        for i in moving:
            own[i] = kind(constants[i])
            dr.enable_grad(own[i])
        # the sign makes variables that nothing else depends on: a sweep clears the derivatives of all others
        values = [-kind(v) for v in term(j, *_filled(state, iter(own)))]
        found = []
        for seed, slope in zip(seeds, slopes, strict=True):
            for i, tangent in seed.items():
                dr.set_grad(own[i], tangent)
                dr.enqueue(dr.ADMode.Forward, own[i])
            dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearInterior)
            found.append([s - dr.grad(v) for s, v in zip(slope, values, strict=True)])
            dr.clear_grad(values)
            dr.clear_grad(own)
        total = [t - dr.detach(v) for t, v in zip(total, values, strict=True)]
        return j + 1, total, found

    zeros = [dr.zeros(kind, 1) for _ in range(size)]
    _, total, slopes = dr.while_loop(
        (UInt(0), zeros, [list(zeros) for _ in by]),
        lambda j, *_: j < count,
        body,
        label=label,
        max_iterations=-1,
    )
    tied: Any = dr.replace_grad  # its stub says that it returns nothing
    for x, slope in zip(by, slopes, strict=True):
        total = [tied(t, dr.fma(s, x, t)) for s, t in zip(slope, total, strict=True)]
    return list(total)


def differentiated(state: Any) -> list[Any]:
    """The floats of a nested state that have derivatives, each once."""
    found = {x.index_ad: x for x in _leaves(state) if _moves(x)}
    return list(found.values())


def _moves(x: Any) -> bool:
    return bool(dr.is_jit_v(x)) and dr.grad_enabled(x)


def _tangents(x: Any, targets: list[Any]) -> list[Any]:
    """Derivatives of variables by another that they were computed from."""
    ends = [-t for t in targets]
    dr.set_grad(x, 1.0)
    dr.enqueue(dr.ADMode.Forward, x)
    dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearInterior)
    dr.clear_grad(x)
    return [-dr.grad(end) for end in ends]


def _leaves(state: Any) -> Iterator[Any]:
    if isinstance(state, tuple | list):
        for item in state:
            yield from _leaves(item)
    elif state is not None:
        yield state


def _filled(state: Any, leaves: Iterator[Any]) -> Any:
    """A state of the same form with other leaves."""
    if isinstance(state, tuple | list):
        return tuple(_filled(item, leaves) for item in state)
    return None if state is None else next(leaves)
