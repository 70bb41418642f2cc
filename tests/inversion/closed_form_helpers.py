"""Optima of a χ² in closed form, whose refits are a formula: no solver and no model behind them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pbrdf.inversion.refits import Optima, Refit


@dataclass(frozen=True)
class ClosedForm(Optima):
    """``formula`` takes held mask (S, P) and unknowns (D, S, P), and returns refitted unknowns and χ² (D, S)."""

    formula: Callable
    calls: list[np.ndarray] = field(default_factory=list)

    @functools.cached_property
    def chi2(self):
        return self.formula(np.ones((1, self.u.shape[1]), dtype=bool), self.u[:, None])[1][:, 0]

    def refit(self, held, start):
        self.calls.append(start.copy())
        u, chi2 = self.formula(held, np.clip(start, self.low, self.high))
        return Refit(u, chi2, np.ones(chi2.shape, dtype=bool))


def closed_form(formula, u, error, tangent, low, high):
    """Optima at ``u``, shape (D, P), with standard errors of that shape."""
    u, error = np.asarray(u, dtype=float), np.asarray(error, dtype=float)
    size = u.shape[1]
    low, high = np.broadcast_to(low, size) * 1.0, np.broadcast_to(high, size) * 1.0
    tangent = np.broadcast_to(tangent, (len(u), size, size)) * 1.0
    at_bound = (u <= low) | (u >= high)
    return ClosedForm(None, [None] * len(u), low, high, u, at_bound, None, tangent, error, formula)


def one_unknown(chi2, u=0.0, error=1.0, low=-50.0, high=50.0):
    """One unknown with χ² a function of it, for as many data sets as there are optima ``u``."""
    u, error = np.atleast_1d(u)[:, None], np.atleast_1d(error)[:, None]
    return closed_form(lambda held, v: (v, chi2(v[..., 0])), u, error, np.eye(1), low, high)


def quadratic(information, low=-50.0, high=50.0):
    """Two unknowns x and y with χ² = uᵀ M u, one data set, its optimum at 0."""
    M = np.asarray(information, dtype=float)
    low, high = np.broadcast_to(low, 2), np.broadcast_to(high, 2)

    def formula(held, u):
        u = u.copy()
        for i, j in ((0, 1), (1, 0)):
            free = ~held[:, i] & held[:, j]
            u[:, free, i] = np.clip(-M[i, j] / M[i, i] * u[:, free, j], low[i], high[i])
        return u, np.einsum("dsi,ij,dsj->ds", u, M, u)

    cov = np.linalg.inv(M)
    error = np.sqrt(np.diag(cov))
    return closed_form(formula, np.zeros((1, 2)), [error], cov / np.diag(cov)[:, None], low, high)
