"""Large batches are searched in single precision: the end is that of double precision, where little is left to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion import solver
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import residuals
from pbrdf.inversion.solver import solve
from pbrdf.inversion.unknowns import space_of

PAINT = pbrdf.DoubleGauss(sigma=0.05, n=1.55, a=0.5, k=1.1, b=0.1, t=0.6)
GUESS = np.array([0.06, 1.5, 0.6, 1.0, 0.0, 0.5])
SETS = 24


@pytest.fixture(scope="module")
def problem():
    """Space and data sets of one paint with noise of their own: 30 geometries, (I, Q, U) to 1 %."""
    rng = np.random.default_rng(3)
    theta_i = np.deg2rad(np.repeat([20.0, 40.0, 60.0], 10))
    theta_r = np.deg2rad(np.tile(np.linspace(0.0, 78.0, 10), 3))
    phi = np.where(np.arange(30) % 2, 0.3, 2.5)
    stokes = PAINT.stokes(theta_i, theta_r, phi)[:, :3].T
    std = np.broadcast_to(0.01 * stokes[0], stokes.shape)
    data = [
        Observations(
            theta_i,
            theta_r,
            phi,
            ("I", "Q", "U"),
            stokes + std * rng.standard_normal(stokes.shape),
            std,
            (1.0, 0.0, 0.0, 0.0),
            True,
        )
        for _ in range(SETS)
    ]
    return space_of("double-gauss", {}, {}, (), {}, {}, data[0])[0], data


def fitted(problem, monkeypatch, worth, **changes):
    """Solution, and iterations of each of the solver's runs."""
    space, data = problem
    runs = []
    inner = solver._solve

    def counted(*args, **named):
        found = inner(*args, **named)
        runs.append(found.iterations.copy())
        return found

    monkeypatch.setattr(solver, "_solve", counted)
    monkeypatch.setattr(solver, "WORTH_SINGLE", worth)
    start = np.tile(space.to_unknowns(GUESS), (SETS, 1))
    solution = solve(replace(residuals(space, data), **changes), start, *space.box)
    monkeypatch.undo()
    return solution, runs


@pytest.fixture
def in_double(problem, monkeypatch):
    solution, runs = fitted(problem, monkeypatch, 1 << 30)
    assert len(runs) == 1 and solution.converged.all()
    return solution


@pytest.mark.slow
def test_same_end_after_one_or_two_evaluations_in_double(problem, in_double, monkeypatch):
    solution, (rough, fine) = fitted(problem, monkeypatch, 1)
    assert solution.converged.all()
    std = np.sqrt([np.diag(np.linalg.inv(A)) for A in in_double.information])
    assert (np.abs(solution.u - in_double.u) < 1e-4 * std).all()
    np.testing.assert_allclose(solution.cost, in_double.cost, rtol=1e-9)
    errors = np.sqrt([np.diag(np.linalg.inv(A)) for A in solution.information])
    np.testing.assert_allclose(errors, std, rtol=1e-4)
    assert np.mean(fine) < 2.0 < np.mean(rough)
    np.testing.assert_array_equal(solution.iterations, rough + fine)


@pytest.mark.slow
def test_where_single_precision_finds_nothing_double_does(problem, in_double, monkeypatch):
    space, data = problem

    def blind():
        single = residuals(space, data, single=True)

        def function(u, lane, point):
            values, alive = single.function(u, lane, point)
            return [value * float("nan") for value in values], alive

        return replace(single, function=function)

    solution, _ = fitted(problem, monkeypatch, 1, single=blind)
    assert solution.converged.all()
    np.testing.assert_array_equal(solution.u, in_double.u)


def test_the_last_step_is_not_looked_at(in_double):
    """From a rough guess to the optimum in six evaluations, the first included, of which each costs alike."""
    assert in_double.iterations.mean() < 7.0
