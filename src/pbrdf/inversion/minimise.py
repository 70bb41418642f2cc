"""Bounded least squares by the method that suits the form of a problem."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pbrdf.inversion.block_solver import BlockResiduals, solve_blocks
from pbrdf.inversion.solver import Residuals, Solution
from pbrdf.inversion.solver import solve as solve_whole

__all__ = ["solve"]


def solve(
    residuals: Residuals | BlockResiduals,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    max_iterations: int = 100,
    tolerance: float = 1e-10,
    progress: Callable[[int, int], None] | None = None,
) -> Solution:
    """Minimise within bounds; parameters and result as of :func:`pbrdf.inversion.solver.solve`."""
    options: dict[str, Any] = {"max_iterations": max_iterations, "tolerance": tolerance, "progress": progress}
    if isinstance(residuals, BlockResiduals):
        return solve_blocks(residuals, start, lower, upper, **options)
    return solve_whole(residuals, start, lower, upper, **options)
