"""Distinct optima among the ends of many starts."""

from __future__ import annotations

import numpy as np

__all__ = ["cluster"]


def cluster(
    points: np.ndarray, cost: np.ndarray, span: np.ndarray, distance: float, cost_difference: float
) -> list[list[int]]:
    """Group points that are the same optimum, best first.

    A point joins the first group whose best member lies within ``distance`` in every unknown, in units of its
    range, and whose cost differs by at most ``cost_difference``, relative. Points of infinite cost are left
    out.

    Parameters
    ----------
    points
        Shape (S, P).
    cost
        Shape (S,).
    span
        Range of each unknown, shape (P,).
    distance, cost_difference
        Tolerances.

    Returns
    -------
    list
        Indices of the members of each group, its best member first.
    """
    groups: list[list[int]] = []
    for index in np.argsort(cost, kind="stable"):
        if not np.isfinite(cost[index]):
            break
        for members in groups:
            best = members[0]
            near = np.abs(points[index] - points[best]) <= distance * span
            if near.all() and cost[index] - cost[best] <= cost_difference * cost[best] + 1e-9:
                members.append(int(index))
                break
        else:
            groups.append([int(index)])
    return groups
