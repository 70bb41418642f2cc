"""A material: how its specimens are distributed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pbrdf.inversion.problem import Space

__all__ = ["Material"]


@dataclass(frozen=True)
class Material:
    """A normal distribution of the solver's unknowns over the specimens of a material.

    Attributes
    ----------
    name
        Of the material.
    space
        Its model, options, free parameters with their bounds and fixed ones.
    mean, covariance
        Of the unknowns (logarithms of logarithmic parameters), shapes (P,) and (P, P).
    specimens
        How many specimens stand behind it.
    """

    name: str
    space: Space
    mean: np.ndarray
    covariance: np.ndarray
    specimens: int = 1
    attrs: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def root(self) -> np.ndarray:
        """Lower triangle L with LLᵀ the covariance."""
        return np.linalg.cholesky(self.covariance)

    @property
    def form(self) -> tuple[Any, ...]:
        """What materials share that one kernel computes."""
        s = self.space
        return (
            s.model,
            tuple(sorted(s.options.items())),
            s.free,
            tuple(sorted(s.fixed.items())),
            tuple(s.lower),
            tuple(s.upper),
        )
