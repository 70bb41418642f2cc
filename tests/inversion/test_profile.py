"""Profile likelihood against closed forms of linear problems and against SciPy on the model."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest
from linear_helpers import NAMES, design, linear_fit
from scipy import stats
from scipy.optimize import brentq, least_squares, lsq_linear

from pbrdf.errors import FitError
from pbrdf.inversion import refits
from pbrdf.inversion.profile import profile
from pbrdf.inversion.solver import Residuals


@pytest.mark.parametrize("level", [0.68, 0.95, 0.999])
def test_a_linear_problem_gives_the_normal_interval(monkeypatch, measured, level):
    result = linear_fit(monkeypatch, design(), measured)
    found = profile(result, level=level)
    error = np.sqrt(np.diag(np.linalg.inv(result.information)))
    z = stats.norm.ppf(0.5 + 0.5 * level)
    for i, name in enumerate(NAMES):
        interval = found.intervals[name]
        # to 1e-3 of a standard error, as promised
        assert abs(interval.lower - (result.unknowns[i] - z * error[i])) < 1e-3 * error[i]
        assert abs(interval.upper - (result.unknowns[i] + z * error[i])) < 1e-3 * error[i]
        assert not interval.lower_at_bound and not interval.upper_at_bound
    assert found.notes == []
    assert found.better is None


def test_an_estimated_scale_gives_students_interval(monkeypatch, measured):
    """With ν degrees of freedom the exact interval of a linear model is value ± t(ν) s √C."""
    result = linear_fit(monkeypatch, design(), 7.0 * measured, std_known=False)
    found = profile(result)
    error = np.sqrt(np.diag(np.linalg.inv(result.information)) * result.goodness.reduced_chi2)
    t = stats.t.ppf(0.975, 27)
    ends = np.array([[found.intervals[n].lower, found.intervals[n].upper] for n in NAMES])
    np.testing.assert_allclose(ends[:, 0], result.unknowns - t * error, atol=1e-3 * error.min())
    np.testing.assert_allclose(ends[:, 1], result.unknowns + t * error, atol=1e-3 * error.min())


def test_curves_are_parabolas_with_the_others_refitted(monkeypatch, measured):
    result = linear_fit(monkeypatch, design(), measured)
    curves = profile(result, ["y"], points=11).curves
    value = curves["value"].sel(parameter="y").values
    variance = np.linalg.inv(result.information)[1, 1]
    np.testing.assert_allclose(
        curves["chi2_rise"].sel(parameter="y"), (value - result.unknowns[1]) ** 2 / variance, atol=1e-9
    )
    for held, refitted in zip(value, curves["refitted"].sel(parameter="y").values, strict=True):
        rest = np.linalg.lstsq(design()[:, [0, 2]], measured - design()[:, 1] * held, rcond=None)[0]
        np.testing.assert_allclose(refitted, [rest[0], held, rest[1]], atol=1e-8)
    assert curves.sizes == {"parameter": 1, "point": 11, "other": 3}


def test_an_interval_that_reaches_a_bound_says_so(monkeypatch, measured):
    free = linear_fit(monkeypatch, design(), measured)
    error = np.sqrt(np.diag(np.linalg.inv(free.information)))
    upper = np.array([50.0, free.unknowns[1] + 0.5 * error[1], 50.0])
    result = linear_fit(monkeypatch, design(), measured, upper=upper)
    found = profile(result)
    assert found.intervals["y"].upper == upper[1]
    assert found.intervals["y"].upper_at_bound and not found.intervals["y"].lower_at_bound
    expected = free.unknowns[1] - stats.norm.ppf(0.975) * error[1]
    assert abs(found.intervals["y"].lower - expected) < 1e-3 * error[1]
    assert any("y: the interval reaches the upper bound" in note for note in found.notes)
    # y rises as x falls and meets its bound: the profile of x is then steeper than the Jacobian says
    assert any(note.startswith("x: at the lower end") and "y lies on a bound" in note for note in found.notes)


def test_an_optimum_on_a_bound_gives_one_sided_intervals(monkeypatch, measured):
    """Against a brute-force profile of the constrained problem with SciPy."""
    free = linear_fit(monkeypatch, design(), measured)
    error = np.sqrt(np.diag(np.linalg.inv(free.information)))
    lower = np.array([-50.0, free.unknowns[1] + 0.7 * error[1], -50.0])
    result = linear_fit(monkeypatch, design(), measured, lower=lower)
    assert result.unknowns[1] == lower[1]
    found = profile(result)

    def rise(i, held):
        others = [j for j in range(3) if j != i]
        best = lsq_linear(
            design()[:, others],
            measured - design()[:, i] * held,
            (lower[others], np.full(2, 50.0)),
            method="bvls",
            tol=1e-15,
        )
        return 2.0 * best.cost - result.goodness.chi2 - stats.chi2.ppf(0.95, 1)

    for i, name in enumerate(NAMES):
        best, interval = result.unknowns[i], found.intervals[name]
        upper_end = brentq(lambda v, i=i: rise(i, v), best, best + 5.0 * error[i])
        assert abs(interval.upper - upper_end) < 2e-3 * error[i]
        if i != 1:
            lower_end = brentq(lambda v, i=i: rise(i, v), best - 5.0 * error[i], best)
            assert abs(interval.lower - lower_end) < 2e-3 * error[i]
    assert found.intervals["y"].lower == lower[1] and found.intervals["y"].lower_at_bound


def test_beside_a_bound_that_the_data_pull_at_intervals_are_those_with_that_parameter_fixed(
    monkeypatch, measured
):
    """The data want y thirty errors below its bound: x and z are as in the problem where y is known to be there."""
    free = linear_fit(monkeypatch, design(), measured)
    held = free.unknowns[1] + 30.0 * np.sqrt(np.linalg.inv(free.information)[1, 1])
    inside = [0, 2]
    fixed = linear_fit(monkeypatch, design()[:, inside], measured - design()[:, 1] * held)
    error = np.sqrt(np.diag(np.linalg.inv(fixed.information)))
    bounded = linear_fit(monkeypatch, design(), measured, lower=np.array([-50.0, held, -50.0]))
    found = profile(bounded, ["x", "z"])
    for name, value, std in zip("xz", fixed.unknowns, error, strict=True):
        interval, z = found.intervals[name], stats.norm.ppf(0.975)
        assert abs(interval.lower - (value - z * std)) < 2e-3 * std
        assert abs(interval.upper - (value + z * std)) < 2e-3 * std
    as_if_free = np.sqrt(np.diag(np.linalg.inv(free.information)))[inside]
    assert (as_if_free / error).min() > 1.5


def test_a_curved_problem_gives_an_asymmetric_interval(monkeypatch, measured):
    """r = eᵘ − 3: the ends are ln(3 ± 1.96) in closed form, the lower one four times as far away."""
    result = linear_fit(monkeypatch, design()[:, :1], measured)
    monkeypatch.setattr(
        refits,
        "residuals",
        lambda space, data, starts=1: Residuals(lambda u, lane, point: ([dr.exp(u[0]) - 3.0], None), 1),
    )
    result.unknowns, result.information = np.log([3.0]), np.array([[9.0]])
    interval = profile(result).intervals["x"]
    np.testing.assert_allclose(
        [interval.lower, interval.upper], np.log([3 - 1.95996, 3 + 1.95996]), atol=3e-4
    )


def test_a_better_optimum_on_the_way_is_reported(monkeypatch, measured):
    """Two wells, at u = ±1, with a barrier below the threshold; the fit ended in the worse one."""
    result = linear_fit(monkeypatch, design()[:, :1], measured)

    def residuals(space, data, starts=1):
        return Residuals(lambda u, lane, point: ([1.5 * (u[0] * u[0] - 1.0), 0.3 * (u[0] - 1.0)], None), 1)

    monkeypatch.setattr(refits, "residuals", residuals)
    worse = least_squares(lambda u: [1.5 * (u[0] ** 2 - 1.0), 0.3 * (u[0] - 1.0)], [-1.0], xtol=1e-15)
    result.unknowns, result.information = worse.x, worse.jac.T @ worse.jac
    found = profile(result)
    np.testing.assert_allclose(found.better["x"], 1.0, atol=1e-6)
    assert abs(found.better_chi2) < 1e-10
    assert "better optimum" in found.notes[0]


@pytest.mark.slow
def test_ends_on_the_model_are_where_scipys_profile_crosses_the_threshold(small_fit):
    data, names = small_fit.data, small_fit.space.names
    rows = ["IQUV".index(c) for c in data.channels]
    best = small_fit.space.to_parameters(small_fit.unknowns)
    found = profile(small_fit)

    def chi2(values):
        model = small_fit.model.replace(**dict(zip(names, values, strict=True)))
        S = model.stokes(data.theta_i, data.theta_r, data.phi)
        return ((S.T[rows] - data.values) * data.weights).ravel()

    lowest = (chi2(best) ** 2).sum()
    for i, name in enumerate(names):
        for end in (found.intervals[name].lower, found.intervals[name].upper):

            def residual(free, i=i, end=end):
                return chi2(np.insert(free, i, end))

            peer = least_squares(
                residual, np.delete(best, i), x_scale=np.delete(best, i), xtol=1e-14, ftol=1e-14
            )
            # 1e-3 of a standard error in the end is 4e-3 in χ² there
            np.testing.assert_allclose(2.0 * peer.cost - lowest, 3.8415, atol=4e-3)


def test_intervals_reach_along_a_branch_that_other_parameters_find(monkeypatch, measured):
    """y = x², x pulled to −0.3, five times harder from the left: y > 0 is cheaper with x > 0, beyond y = 0.

    From the optimum, y held at higher values leaves x on the branch x < 0, where y would end at 1.6; x by itself
    passes over to the other.
    """
    result = linear_fit(monkeypatch, design()[:, :2], measured)

    def pull(x, tanh):
        return (x + 0.3) * (1.2 - 0.8 * tanh(x + 0.3))

    def function(u, lane, point):
        return [10.0 * (u[1] - u[0] * u[0]), pull(u[0], dr.tanh)], None

    monkeypatch.setattr(refits, "residuals", lambda space, data, starts=1: Residuals(function, 1))
    result.unknowns = np.array([-0.3, 0.09])
    J = np.array([[6.0, 10.0], [1.2, 0.0]])
    result.information = J.T @ J
    found = profile(result, ["y"], points=41)
    x = np.linspace(-8.0, 8.0, 400_001)

    def rise(y):
        return ((10.0 * (y - x * x)) ** 2 + pull(x, np.tanh) ** 2).min()

    interval = found.intervals["y"]
    assert interval.upper > 20.0
    np.testing.assert_allclose([rise(interval.lower), rise(interval.upper)], 3.8415, atol=0.01)
    curve = found.curves.sel(parameter="y")
    np.testing.assert_allclose(curve["chi2_rise"], [rise(y) for y in curve["value"].values], atol=5e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: profile(r, ["m"]), "not a free parameter of this fit: free are n, a, t"),
        (lambda r: profile(r, ["sigma"]), "'sigma' is not a free parameter"),
        (lambda r: profile(r, []), "no parameter was named"),
        (lambda r: profile(r, level=1.0), "level=1"),
        (lambda r: profile(r, points=2), "points=2"),
    ],
)
def test_errors_say_what_to_do(small_fit, call, message):
    with pytest.raises(FitError, match=message):
        call(small_fit)
