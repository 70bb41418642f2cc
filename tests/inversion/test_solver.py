"""The batched Levenberg-Marquardt against SciPy and closed forms."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest
from scipy.optimize import least_squares

from pbrdf.backend import get_backend
from pbrdf.inversion.solver import Residuals, Status, linearise, solve


def exponential_problem(data: np.ndarray, x: np.ndarray) -> Residuals:
    """r = u0 exp(−u1 x) + u2 − y for lanes with their own data, shape (B, G)."""
    backend = get_backend()
    Float = backend.Float
    y, abscissa = backend.upload(Float, data.ravel()), backend.upload(Float, x)
    count = len(x)

    def function(u, lane, point):
        at = dr.gather(Float, abscissa, point)
        return [u[0] * dr.exp(-u[1] * at) + u[2] - dr.gather(Float, y, lane * count + point)], None

    return Residuals(function, count)


def exponential_residual(u: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return u[0] * np.exp(-u[1] * x) + u[2] - y


@pytest.fixture(scope="module")
def noisy_exponentials() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 4.0, 25)
    truth = np.column_stack([rng.uniform(1, 3, 40), rng.uniform(0.5, 2, 40), rng.uniform(-0.5, 0.5, 40)])
    y = truth[:, :1] * np.exp(-truth[:, 1:2] * x) + truth[:, 2:] + 0.02 * rng.standard_normal((40, 25))
    return x, y


def test_every_lane_reaches_scipys_optimum(noisy_exponentials):
    x, y = noisy_exponentials
    lower, upper = np.array([0.1, 0.05, -2.0]), np.array([10.0, 5.0, 2.0])
    solution = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.0], (40, 1)), lower, upper)
    assert solution.converged.all()
    for lane in range(40):
        peer = least_squares(
            exponential_residual,
            [1.0, 1.0, 0.0],
            bounds=(lower, upper),
            args=(x, y[lane]),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        np.testing.assert_allclose(solution.u[lane], peer.x, rtol=1e-6)
        np.testing.assert_allclose(solution.cost[lane], peer.cost, rtol=1e-10)
        np.testing.assert_allclose(solution.information[lane], peer.jac.T @ peer.jac, rtol=1e-4)


def test_bounds_that_bind_are_kept_and_agree_with_scipy(noisy_exponentials):
    x, y = noisy_exponentials
    lower, upper = np.array([0.1, 0.05, 0.2]), np.array([1.5, 5.0, 2.0])
    solution = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.5], (40, 1)), lower, upper)
    assert solution.converged.all()
    assert ((solution.u >= lower) & (solution.u <= upper)).all()
    on_bound = (solution.u == lower) | (solution.u == upper)
    assert on_bound.any(axis=1).sum() > 20, "the bounds of this problem are meant to bind"
    for lane in range(40):
        peer = least_squares(
            exponential_residual,
            [1.0, 1.0, 0.5],
            bounds=(lower, upper),
            args=(x, y[lane]),
            xtol=1e-15,
            ftol=1e-15,
        )
        # SciPy's reflective method stays a little inside a bound; ours stands on it
        np.testing.assert_allclose(solution.u[lane], peer.x, atol=2e-5)
        assert solution.cost[lane] <= peer.cost * (1.0 + 1e-9)


def test_gradient_vanishes_at_the_optimum_and_is_jt_r(noisy_exponentials):
    x, y = noisy_exponentials
    wide = np.array([-10.0, -10.0, -10.0]), np.array([10.0, 10.0, 10.0])
    solution = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.0], (40, 1)), *wide)
    scale = np.sqrt(np.einsum("bii->bi", solution.information) * 2.0 * solution.cost[:, None])
    assert (np.abs(solution.gradient) <= 1e-7 * scale).all()
    stopped = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.0], (40, 1)), *wide, max_iterations=1)
    u = stopped.u[0]
    r = exponential_residual(u, x, y[0])
    J = np.column_stack([np.exp(-u[1] * x), -u[0] * x * np.exp(-u[1] * x), np.ones_like(x)])
    np.testing.assert_allclose(stopped.gradient[0], J.T @ r, rtol=1e-10)
    np.testing.assert_allclose(stopped.information[0], J.T @ J, rtol=1e-10)
    assert (stopped.status == Status.ITERATIONS).any()
    assert not stopped.converged.all()


def test_a_large_batch_gives_what_its_lanes_give_alone(noisy_exponentials):
    """More lanes than run in one launch: lanes that have stopped leave, the others keep their own data."""
    x, y = noisy_exponentials
    rng = np.random.default_rng(0)
    start = np.column_stack(
        [rng.uniform(0.2, 9, 1600), rng.uniform(0.1, 4.5, 1600), rng.uniform(-1, 1, 1600)]
    )
    lower, upper = np.array([0.1, 0.05, -2.0]), np.array([10.0, 5.0, 2.0])
    many = solve(exponential_problem(np.tile(y, (40, 1)), x), start, lower, upper)
    few = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.0], (40, 1)), lower, upper)
    assert many.converged.mean() > 0.99
    best = many.cost.reshape(40, 40).min(axis=0)
    np.testing.assert_allclose(best, few.cost, rtol=1e-9)
    assert len(np.unique(many.iterations)) > 3


def test_a_batch_of_one_lane(noisy_exponentials):
    x, y = noisy_exponentials
    wide = np.full(3, -10.0), np.full(3, 10.0)
    one = solve(exponential_problem(y[:1], x), np.array([[1.0, 1.0, 0.0]]), *wide)
    peer = least_squares(exponential_residual, [1.0, 1.0, 0.0], args=(x, y[0]), xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(one.u[0], peer.x, rtol=1e-6)
    assert one.u.shape == (1, 3)


def test_rosenbrock_valley():
    """r = (10 (u1 − u0²), 1 − u0): the minimum at (1, 1) with cost 0."""

    def function(u, lane, point):
        return [10.0 * (u[1] - u[0] * u[0]), 1.0 - u[0]], None

    start = np.array([[-1.2, 1.0], [2.0, -2.0], [0.0, 3.0]])
    solution = solve(Residuals(function, 1), start, np.full(2, -5.0), np.full(2, 5.0))
    np.testing.assert_allclose(solution.u, 1.0, atol=1e-7)
    assert solution.converged.all()


def test_an_unknown_without_influence_stays_where_it_started(noisy_exponentials):
    x, y = noisy_exponentials
    problem = exponential_problem(y, x)
    padded = Residuals(lambda u, lane, point: problem.function(u[:3], lane, point), problem.points)
    start = np.tile([1.0, 1.0, 0.0, 0.7], (40, 1))
    solution = solve(padded, start, np.full(4, -10.0), np.full(4, 10.0))
    assert solution.converged.all()
    np.testing.assert_array_equal(solution.u[:, 3], 0.7)


def test_residuals_that_are_not_finite_are_reported():
    def function(u, lane, point):
        return [dr.log(u[0])], None

    solution = solve(Residuals(function, 1), np.array([[-1.0], [2.0]]), np.array([-2.0]), np.array([5.0]))
    assert solution.status[0] == Status.NOT_FINITE
    assert solution.converged[1] and abs(solution.u[1, 0] - 1.0) < 1e-8


def test_progress_counts_up_to_all_lanes(noisy_exponentials):
    x, y = noisy_exponentials
    seen: list[tuple[int, int]] = []
    solve(
        exponential_problem(y, x),
        np.tile([1.0, 1.0, 0.0], (40, 1)),
        np.full(3, -10.0),
        np.full(3, 10.0),
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen[-1] == (40, 40)


def test_lanes_may_have_bounds_of_their_own(noisy_exponentials):
    """A lane whose bounds of one unknown are equal holds it: SciPy without that unknown agrees."""
    x, y = noisy_exponentials
    lower, upper = np.tile([-10.0, -10.0, -10.0], (40, 1)), np.tile([10.0, 10.0, 10.0], (40, 1))
    held = np.linspace(0.5, 2.0, 40)
    lower[:, 1] = upper[:, 1] = held
    solution = solve(exponential_problem(y, x), np.tile([1.0, 1.0, 0.0], (40, 1)), lower, upper)
    assert solution.converged.all()
    np.testing.assert_array_equal(solution.u[:, 1], held)
    for lane in range(0, 40, 7):
        design = np.column_stack([np.exp(-held[lane] * x), np.ones_like(x)])
        expected = np.linalg.lstsq(design, y[lane], rcond=None)[0]
        np.testing.assert_allclose(solution.u[lane, [0, 2]], expected, rtol=1e-7)


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_robust_losses_agree_with_scipy_and_resist_outliers(noisy_exponentials, loss):
    x, y = noisy_exponentials
    spoilt = y / 0.02
    spoilt[:, 7] += 100.0
    scale = 1.0 / 0.02
    backend = get_backend()
    data, abscissa = backend.upload(backend.Float, spoilt.ravel()), backend.upload(backend.Float, x)

    def function(u, lane, point):
        at = dr.gather(backend.Float, abscissa, point)
        modelled = (u[0] * dr.exp(-u[1] * at) + u[2]) * scale
        return [modelled - dr.gather(backend.Float, data, lane * 25 + point)], None

    wide = np.full(3, -10.0), np.full(3, 10.0)
    solution = solve(Residuals(function, 25, loss=loss), np.tile([1.0, 1.0, 0.0], (40, 1)), *wide)
    for lane in (0, 11, 39):
        peer = least_squares(
            lambda u, lane=lane: exponential_residual(u, x, 0.0) * scale - spoilt[lane],
            [1.0, 1.0, 0.0],
            loss=loss,
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        np.testing.assert_allclose(solution.u[lane], peer.x, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(solution.cost[lane], peer.cost, rtol=1e-9)


def test_a_gaussian_prior_counts_like_one_more_measurement(noisy_exponentials):
    x, y = noisy_exponentials
    problem = exponential_problem(y, x)

    def penalty(u):
        return [(1, (u[1] - 1.2) / 0.05, 1.0 / 0.05)]

    with_prior = Residuals(problem.function, problem.points, penalty=penalty)
    wide = np.full(3, -10.0), np.full(3, 10.0)
    solution = solve(with_prior, np.tile([1.0, 1.0, 0.0], (40, 1)), *wide)
    for lane in (0, 17):
        peer = least_squares(
            lambda u, lane=lane: np.append(exponential_residual(u, x, y[lane]), (u[1] - 1.2) / 0.05),
            [1.0, 1.0, 0.0],
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        np.testing.assert_allclose(solution.u[lane], peer.x, rtol=1e-6)
        np.testing.assert_allclose(solution.information[lane], peer.jac.T @ peer.jac, rtol=1e-4)


@pytest.mark.parametrize("batch", [1, 7])
def test_linearise_gives_values_and_their_derivatives(batch):
    """r = u0 exp(−u1 x) + u2 at x = 0.7: derivatives exp(−u1 x), −u0 x exp(−u1 x), 1."""
    u = np.random.default_rng(1).uniform(0.5, 2.0, (batch, 3))
    problem = exponential_problem(np.zeros((batch, 1)), np.array([0.7]))
    values, jacobian = linearise(problem.function, u, 1)
    decay = np.exp(-0.7 * u[:, 1])
    np.testing.assert_allclose(values[:, 0], u[:, 0] * decay + u[:, 2], rtol=1e-12)
    expected = np.stack([decay, -0.7 * u[:, 0] * decay, np.ones(batch)], axis=-1)
    np.testing.assert_allclose(jacobian[:, 0], expected, rtol=1e-12)


def test_lanes_that_share_out_their_points_reach_the_same(noisy_exponentials, monkeypatch):
    """Slices of points and lanes for parts of them: the sums are the same but for rounding."""
    from pbrdf.inversion import solver

    x, y = noisy_exponentials
    start, wide = np.tile([1.0, 1.0, 0.0], (5, 1)), (np.full(3, -10.0), np.full(3, 10.0))
    penalty = lambda u: [(1, (u[1] - 1.2) / 0.05, 1.0 / 0.05)]  # noqa: E731
    problem = exponential_problem(y[:5], x)
    problem = Residuals(problem.function, problem.points, penalty=penalty, order=np.arange(25)[::-1])
    alone = solve(problem, start, *wide)
    monkeypatch.setattr(solver, "SLICE", 40)  # 8 points of each lane in a launch
    monkeypatch.setattr(solver, "WIDTH", 15)  # shared by 3
    shared = solve(problem, start, *wide)
    assert shared.converged.all()
    np.testing.assert_allclose(shared.u, alone.u, rtol=1e-7)
    np.testing.assert_allclose(shared.cost, alone.cost, rtol=1e-12)
    np.testing.assert_allclose(shared.information, alone.information, rtol=1e-7)


def test_a_kink_is_a_minimum_though_its_gradient_does_not_vanish():
    """r = |u| + 1: the step from 0 promises what it never keeps; the lane stops soon, and stalled."""

    def function(u, lane, point):
        return [dr.abs(u[0]) + 1.0], None

    low, high = np.array([-2.0]), np.array([2.0])
    solution = solve(Residuals(function, 1), np.array([[0.7], [-0.4]]), low, high)
    assert (solution.iterations < 70).all()
    assert np.abs(solution.u).max() < 1e-6
    assert solution.best(low, high) in (0, 1)


def test_of_equal_ends_the_best_is_one_inside_the_bounds():
    """r = u + v − 3 on 0 … 2: all of the valley is as good; its ends at a bound would look as if v were determined."""

    def function(u, lane, point):
        return [u[0] + u[1] - 3.0, 1.0 + 0.0 * u[0]], None

    low, high = np.zeros(2), np.full(2, 2.0)
    start = np.array([[2.0, 1.5], [2.0, 0.2], [1.4, 1.5], [0.1, 2.0]])
    solution = solve(Residuals(function, 1), start, low, high)
    assert solution.converged.all()
    np.testing.assert_allclose(solution.cost, 0.5, rtol=1e-9)
    inside = ((solution.u > 1e-6) & (solution.u < 2.0 - 1e-6)).all(axis=1)
    assert inside.any() and not inside.all()
    assert inside[solution.best(low, high)]
