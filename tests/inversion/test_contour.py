"""Joint regions against the ellipses of linear problems and against profiles of the model."""

from __future__ import annotations

import numpy as np
import pytest
from linear_helpers import design, linear_fit
from scipy import stats

from pbrdf.errors import FitError
from pbrdf.inversion.contour import contour
from pbrdf.inversion.profile import profile


def test_contours_are_the_joint_ellipses_of_two_parameters(monkeypatch, measured):
    result = linear_fit(monkeypatch, design(), measured)
    found = contour(result, "x", "z", levels=(0.68, 0.95), points=21)
    np.testing.assert_allclose(list(found.rises.values()), [2.2789, 5.9915], atol=1e-4)
    cov = np.linalg.inv(result.information)[np.ix_([0, 2], [0, 2])]
    grid = np.stack(np.meshgrid(found.grid["x"], found.grid["z"], indexing="ij"), axis=-1)
    away = grid - result.unknowns[[0, 2]]
    expected = np.einsum("abi,ij,abj->ab", away, np.linalg.inv(cov), away)
    near = expected < 2.0 * 5.9915
    np.testing.assert_allclose(found.grid["chi2_rise"].values[near], expected[near], rtol=1e-6, atol=1e-8)
    assert (expected[np.isnan(found.grid["chi2_rise"])] > 2.0 * 5.9915).all()
    # the grid holds the whole 95 % region, which on each axis is √(5.99/3.84) as wide as a single interval
    for name, variance in zip(("x", "z"), np.diag(cov), strict=True):
        span = np.ptp(found.grid[name].values)
        np.testing.assert_allclose(span, 2.0 * np.sqrt(5.9915 * variance) * 1.25, rtol=1e-3)


def test_contour_thresholds_follow_f_where_the_scale_is_estimated(monkeypatch, measured):
    result = linear_fit(monkeypatch, design(), measured, std_known=False)
    found = contour(result, "x", "y", levels=(0.9,), points=3)
    expected = 2.0 * stats.f.ppf(0.9, 2, 27) * result.goodness.reduced_chi2
    np.testing.assert_allclose(found.rises[0.9], expected)


@pytest.mark.slow
def test_contour_on_the_model_touches_its_profile_intervals(small_fit):
    """The lowest χ² along one parameter of the grid is that parameter's profile."""
    found = contour(small_fit, "t", "n", points=41)
    curve = profile(small_fit, ["t"], level=0.99).curves.sel(parameter="t")
    shadow = np.interp(curve["value"], found.grid["t"], found.grid["chi2_rise"].min("n"))
    near = curve["chi2_rise"].values < 4.0
    np.testing.assert_allclose(shadow[near], curve["chi2_rise"].values[near], atol=0.15)
    assert found.notes == []


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: contour(r, "n", "n"), "two different parameters"),
        (lambda r: contour(r, "n", "q"), "'q' is not a free parameter"),
        (lambda r: contour(r, "n", "t", levels=()), "at least one level"),
    ],
)
def test_errors_say_what_to_do(small_fit, call, message):
    with pytest.raises(FitError, match=message):
        call(small_fit)
