"""Covariances of a data set in the fit: generalised least squares, and everything that simulates or leaves data out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.bootstrap import simulate
from pbrdf.inversion.crossvalidation import cross_validate
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import residuals
from pbrdf.inversion.solver import solve

PAINT = "matte-white-thick"
NAMES = ("I", "Q", "U", "V")


def stated_covariance(stokes):
    """A source that flickers by 2 %, which all components share, and a detector whose Q and U readings trade off.

    Where the light is polarised, I and Q go up and down together: their ratio is known better than either.
    """
    detector = np.diag([2.0, 3.0, 3.0, 5.0]) ** 2
    detector[1, 2] = detector[2, 1] = -0.6 * 9.0
    return (0.02**2) * np.einsum("gi,gj->gij", stokes, stokes) + (1e-3 * stokes[:, :1, None]) ** 2 * detector


@pytest.fixture(scope="module")
def truth():
    bundled = pbrdf.open_experiment(PAINT)
    angles = [bundled[name].values for name in ("theta_i", "theta_r", "phi")]
    return angles, bundled["group"].values, pbrdf.load_paint(PAINT).stokes(*angles)


def measured(truth, errors, **more):
    """A data set of I, Q and U; some U were not measured, and for some rows only the standard uncertainties are known.

    The errors have the stated covariance, those of the latter rows its diagonal.
    """
    angles, group, stokes = truth
    covariance = stated_covariance(stokes)
    covariance[:, 3, :] = covariance[:, :, 3] = np.nan
    covariance[::9] = np.where(np.eye(4, dtype=bool), covariance[::9], np.nan)
    exact = np.nan_to_num(covariance)[:, :3, :3]
    values = stokes[:, :3] + np.einsum("gij,gj->gi", np.linalg.cholesky(exact), errors)
    values[4::7, 2] = np.nan
    columns = {c: values[:, i] for i, c in enumerate("IQU")}
    return pbrdf.make_dataset(*angles, quantity="brdf", **columns, covariance=covariance, group=group, **more)


@pytest.fixture(scope="module")
def one(truth):
    return measured(truth, np.random.default_rng(8).standard_normal((63, 3)))


@pytest.fixture(scope="module")
def fitted(one):
    return pbrdf.fit(one, starts=8)


def chi2_by_hand(ds, comparison, rows):
    """Σ rᵀ C⁻¹ r over the measured components of each of the rows, from the data set's own numbers."""
    total = 0.0
    for row in rows:
        there = [i for i, c in enumerate("IQU") if np.isfinite(ds[c].values[row])]
        C = np.nan_to_num(ds["covariance"].values[row][np.ix_(there, there)])
        r = np.array([comparison[f"{'IQU'[i]}_residual"].values[row] for i in there])
        total += r @ np.linalg.solve(C, r)
    return total


@pytest.mark.slow
def test_the_covariance_of_the_data_counts_in_the_fit(one, fitted):
    """χ² is rᵀ C⁻¹ r of the measured components; where only standard uncertainties are known, C is diagonal."""
    assert fitted.goodness.chi2 == pytest.approx(chi2_by_hand(one, fitted.comparison, range(63)), rel=1e-9)
    assert fitted.noise == "covariances of the data set" and fitted.std_known
    assert fitted.goodness.data == 63 * 3 - 9
    assert 0.7 < fitted.goodness.reduced_chi2 < 1.3


def monte_carlo(start, sets):
    """Standardised errors and scatter of all free parameters over fits of many data sets, and their χ²."""
    space = start.space
    low, high = space.box
    solution = solve(residuals(space, sets, 1), np.tile(start.unknowns, (len(sets), 1)), low, high)
    true = pbrdf.load_paint(PAINT).values
    u = space.to_unknowns(np.array([true[n] for n in space.names]))
    error = solution.u - u
    std = np.sqrt([np.diag(np.linalg.inv(information)) for information in solution.information])
    return error / std, error.std(axis=0), 2.0 * solution.cost


@pytest.mark.slow
def test_standard_errors_with_the_covariance_are_right_and_smaller(truth, one, fitted):
    """400 measurements with correlated errors: with the covariance the errors are as large as stated, and smaller than
    with the standard uncertainties alone, whose stated errors are wrong."""
    count = 400
    rng = np.random.default_rng(20)
    many = [measured(truth, rng.standard_normal((63, 3))) for _ in range(count)]
    full = [Observations.from_dataset(ds) for ds in many]
    diagonal = [replace(data, correlation=None) for data in full]
    z, scatter, chi2 = monte_carlo(fitted, full)
    # a mean of N standard normal numbers is known to 1/√N, their standard deviation to 1/√(2N); four of those
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=4.0 / math.sqrt(count))
    np.testing.assert_allclose(z.std(axis=0), 1.0, atol=4.0 / math.sqrt(2.0 * count))
    freedom = fitted.goodness.data - len(fitted.space.free)
    assert chi2.mean() == pytest.approx(freedom, abs=4.0 * math.sqrt(2.0 * freedom / count))

    z_diagonal, scatter_diagonal, _ = monte_carlo(fitted, diagonal)
    names = fitted.space.names
    assert (np.abs(z_diagonal.std(axis=0) - 1.0) > 4.0 / math.sqrt(2.0 * count)).any()
    for name in ("n", "t"):  # what rests on the polarisation gains most
        assert scatter[names.index(name)] < 0.8 * scatter_diagonal[names.index(name)], name
    assert (scatter < 1.1 * scatter_diagonal).all()


@pytest.mark.parametrize("quantity", ["reflectance_factor", "radiance"])
def test_correlations_do_not_depend_on_the_unit(truth, one, quantity):
    angles, group, _ = truth
    factor = np.pi if quantity == "reflectance_factor" else np.cos(angles[0])
    scaled = pbrdf.make_dataset(
        *angles,
        quantity=quantity,
        **{c: one[c].values * factor for c in "IQU"},
        covariance=one["covariance"].values * np.broadcast_to(factor, 63)[:, None, None] ** 2,
        group=group,
    )
    here, there = Observations.from_dataset(scaled), Observations.from_dataset(one)
    np.testing.assert_allclose(here.std, there.std, rtol=1e-12)
    np.testing.assert_allclose(here.correlation, there.correlation, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(here.whitening, there.whitening, rtol=1e-9, atol=1e-9 * there.whitening.max())


def test_whitened_residuals_are_independent(one):
    """W C Wᵀ = 1 for the measured components, and nothing of what was not measured enters."""
    data = Observations.from_dataset(one)
    there = np.isfinite(data.std)
    W = data.whitening.transpose(2, 0, 1)
    covariance = np.nan_to_num(one["covariance"].values[:, :3, :3])
    found = W @ covariance @ W.transpose(0, 2, 1)
    expected = np.einsum("ig,ij->gij", there, np.eye(3))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert (~there).sum() == 9 and (W[4::7, :, 2] == 0.0).all()


def test_other_statements_of_noise_replace_the_covariance(one):
    assert Observations.from_dataset(one, pbrdf.NoiseModel()).correlation is None
    assert Observations.from_dataset(one, objective="paper").correlation is None
    assert Observations.from_dataset(one.drop_vars("covariance")).correlation is None
    stated = np.tile(np.diag([0.1, 0.2, 0.3]) ** 2, (63, 1, 1))
    data = Observations.from_dataset(one).with_covariance(stated)
    np.testing.assert_allclose(data.std[:, 0], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(data.factor[0], np.eye(3))


def test_an_argument_overrides_what_the_data_set_says(one):
    """χ² with the argument's covariance, half as large as the data set's: twice as large."""
    half = np.nan_to_num(one["covariance"].values[:, :3, :3]) / 2.0
    half[4::7, 2, :] = half[4::7, :, 2] = np.nan  # of what was not measured nothing need be known
    result = pbrdf.fit(one, starts=8, covariance=half)
    by_hand = chi2_by_hand(one, result.comparison, range(63))
    assert result.goodness.chi2 == pytest.approx(2.0 * by_hand, rel=1e-9)
    assert result.noise == "stated: the covariance of the components"


def test_a_diagonal_covariance_is_the_standard_uncertainties(one):
    ds = one.copy(deep=True)
    ds["covariance"][:] = np.where(np.eye(4, dtype=bool), ds["covariance"], np.nan)
    data, plain = Observations.from_dataset(ds), Observations.from_dataset(ds.drop_vars("covariance"))
    assert data.correlation is None
    np.testing.assert_array_equal(data.std, plain.std)


def test_a_singular_covariance_is_refused_with_its_row(one):
    """A component that is a fixed multiple of another would be known exactly, given the other."""
    ds = one.copy(deep=True)
    std = np.array([float(ds[f"{c}_std"][5]) for c in "IQU"])
    ds["covariance"][5, :3, :3] = np.outer(std, std)
    pbrdf.validate(ds)
    with pytest.raises(
        FitError, match=r"covariance at index 5 is singular, as if some combination of I, Q, U were"
    ):
        pbrdf.fit(ds)
    ds["Q"][5] = ds["U"][5] = np.nan
    assert np.isfinite(Observations.from_dataset(ds).whitening).all(), "I alone is not singular"
    pbrdf.fit(ds, starts=1, noise="0.02")


# --- what leaves data out, and what simulates them ------------------------------------------------


def test_held_out_rows_leave_with_their_covariance(one):
    result = pbrdf.fit(one, starts=8, hold_out="group=2")
    kept = np.flatnonzero(one["group"].values != 2)
    assert result.goodness.chi2 == pytest.approx(chi2_by_hand(one, result.comparison, kept), rel=1e-9)
    np.testing.assert_array_equal(result.data.correlation, Observations.from_dataset(one).correlation[kept])


@pytest.mark.slow
def test_the_steps_of_the_papers_strategy_keep_the_covariance(one, fitted):
    result = pbrdf.fit(one, starts=8, strategy="stepwise")
    assert result.goodness.chi2 == pytest.approx(fitted.goodness.chi2, rel=1e-6)
    rows = np.flatnonzero(result.comparison["used_for_diffuse"].values)
    step = [stage for stage in result.stages if stage.name == "diffuse"][-1]
    diffuse = pbrdf.fit(
        one.isel(geometry=rows),
        starts=8,
        fix={n: step.held[n] for n in ("sigma", "n")},
        options={"accuracy": "draft"},
    )
    assert step.chi2 == pytest.approx(diffuse.goodness.chi2, rel=1e-4)


@pytest.mark.slow
def test_folds_keep_the_covariance_of_the_rest(one):
    validation = cross_validate(one, starts=4)
    for number, fold in enumerate(validation.folds, start=1):
        rest = pbrdf.fit(one, starts=4, hold_out=f"group={number}")
        assert fold.chi2 == pytest.approx(rest.goodness.chi2, rel=1e-6)
        assert fold.values["n"] == pytest.approx(rest.estimates["n"].value, rel=1e-4)


@pytest.mark.slow
def test_simulated_errors_have_the_stated_covariance(one):
    data = Observations.from_dataset(one)
    count = 20_000
    sets = simulate(data, np.zeros_like(data.values), count, np.random.default_rng(3), scale=2.0)
    row = 8  # all measured
    drawn = np.cov([s.values[:, row] for s in sets], rowvar=False)
    expected = 4.0 * one["covariance"].values[row, :3, :3]
    size = np.sqrt(np.outer(*[np.diag(expected)] * 2))
    # Var(s_ij) = (σ_ii σ_jj + σ_ij²)/N ≤ 2 σ_ii σ_jj/N
    np.testing.assert_allclose(drawn / size, expected / size, atol=5.0 * math.sqrt(2.0 / count))
    assert abs(expected[0, 1] / size[0, 1]) > 0.3
    assert all(s.values[2, 4] == 0.0 for s in sets[:9]), "U was not measured there"


@pytest.mark.slow
def test_the_bootstrap_agrees_with_the_standard_errors(fitted):
    count = 400
    sampled = fitted.bootstrap(count, seed=2)
    error = [fitted.estimates[n].std for n in fitted.space.names]
    spread = np.sqrt(np.diag(sampled.covariance))
    np.testing.assert_allclose(spread / error, 1.0, atol=4.0 / math.sqrt(2.0 * count))


@pytest.mark.slow
def test_the_profile_of_a_nearly_linear_fit_agrees_with_the_standard_error(fitted):
    interval = fitted.profile(["n"]).intervals["n"]
    estimate = fitted.estimates["n"]
    assert interval.upper - interval.lower == pytest.approx(2 * 1.96 * estimate.std, rel=0.05)
