"""Fits of linear problems, whose profiles are known in closed form: no model behind them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace

import drjit as dr
import numpy as np
from scipy.optimize import lsq_linear

from pbrdf.backend import get_backend
from pbrdf.inversion import refits
from pbrdf.inversion.solver import Residuals
from pbrdf.models.parameters import Parameter

NAMES = ("x", "y", "z")


@dataclass(frozen=True)
class PlainSpace:
    """Unknowns that are their own parameters."""

    names: list[str]
    lower: np.ndarray
    upper: np.ndarray

    unit: str = "1"

    @property
    def free(self):
        return [
            Parameter(name, name, self.unit, "", low, high, (-math.inf, math.inf), 0.0)
            for name, low, high in zip(self.names, self.lower, self.upper, strict=True)
        ]

    def to_unknowns(self, values):
        return np.array(values, dtype=float)

    to_parameters = to_unknowns

    @property
    def box(self):
        return self.lower, self.upper


def design() -> np.ndarray:
    """30 measurements of three correlated unknowns, shape (30, 3)."""
    s = np.linspace(0.0, 1.0, 30)
    return np.column_stack([np.ones_like(s), s, s**2]) * 3.0


def linear_fit(monkeypatch, matrix, measured, lower=-50.0, upper=50.0, std_known=True, unit="1"):
    """A fit of measured = matrix · u with unit standard uncertainties, its optimum by SciPy."""
    count, size = matrix.shape
    space = PlainSpace(
        list(NAMES[:size]), np.broadcast_to(lower, size) * 1.0, np.broadcast_to(upper, size) * 1.0, unit
    )

    def residuals(space, data, starts=1):
        backend = get_backend()
        columns = [backend.upload(backend.Float, column) for column in matrix.T]
        y = backend.upload(backend.Float, np.concatenate(data))

        def function(u, lane, point):
            total = sum(dr.gather(backend.Float, c, point) * v for c, v in zip(columns, u, strict=True))
            return [total - dr.gather(backend.Float, y, (lane // starts) * count + point)], None

        return Residuals(function, count)

    monkeypatch.setattr(refits, "residuals", residuals)
    best = lsq_linear(matrix, measured, (space.lower, space.upper), method="bvls", tol=1e-15)
    chi2 = 2.0 * best.cost
    return SimpleNamespace(
        space=space,
        data=measured,
        unknowns=best.x,
        information=matrix.T @ matrix,
        std_known=std_known,
        settled=True,
        goodness=SimpleNamespace(data=count, free=size, chi2=chi2, reduced_chi2=chi2 / (count - size)),
    )
