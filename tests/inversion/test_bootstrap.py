"""The parametric bootstrap against the inverse information matrix and simulated noise."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.bootstrap import bootstrap, simulate

COUNT = 400


@pytest.fixture(scope="module")
def full_fit():
    return pbrdf.fit(pbrdf.open_experiment("matte-white-thick"), starts=16)


@pytest.fixture(scope="module")
def sampled(full_fit):
    return bootstrap(full_fit, COUNT, seed=1)


@pytest.mark.slow
def test_covariance_is_the_inverse_information(full_fit, sampled):
    names = full_fit.space.names
    error = np.array([full_fit.estimates[n].std for n in names])
    spread = np.sqrt(np.diag(sampled.covariance))
    # a standard deviation from N samples is known to 1/√(2N); four of those
    np.testing.assert_allclose(spread / error, 1.0, atol=4.0 / np.sqrt(2.0 * COUNT))
    correlation = sampled.covariance.values / np.outer(spread, spread)
    expected = full_fit.correlation.sel(parameter=names, other=names).values
    np.testing.assert_allclose(correlation, expected, atol=4.0 / np.sqrt(COUNT))


def test_bias_and_percentiles_of_a_nearly_linear_fit(full_fit, sampled):
    for name in full_fit.space.names:
        estimate = full_fit.estimates[name]
        assert abs(float(sampled.bias.sel(parameter=name))) < 4.0 * float(
            sampled.bias_error.sel(parameter=name)
        )
        tails = (sampled.percentiles.sel(parameter=name).values - estimate.value) / estimate.std
        # the standard error of a 2.5 % quantile of N normal samples is 2.67/√N
        np.testing.assert_allclose(tails, [-1.96, 1.96], atol=4.0 * 2.67 / np.sqrt(COUNT))
    assert sampled.samples.shape == (COUNT, 6)
    assert sampled.failed == 0 and sampled.notes == []


@pytest.mark.slow
def test_the_seed_decides_the_samples(full_fit):
    first, again, other = (bootstrap(full_fit, 5, seed=s).samples for s in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


@pytest.mark.slow
def test_a_guessed_scale_is_replaced_by_that_of_the_residuals():
    """Stated uncertainties thirty times too large, of unknown scale: the samples scatter like the true noise."""
    dataset = pbrdf.open_experiment("pearl-white")
    known = pbrdf.fit(dataset, starts=16)
    guessed = pbrdf.fit(dataset.drop_vars([f"{c}_std" for c in "IQUV"]), starts=16, noise="0.3,0")
    assert not guessed.std_known
    samples = bootstrap(guessed, 200).samples
    for name in known.space.names:
        spread = float(samples.sel(parameter=name).std(ddof=1))
        np.testing.assert_allclose(spread / guessed.estimates[name].std, 1.0, atol=0.2)
        assert spread < 6.0 * known.estimates[name].std


@pytest.mark.slow
def test_samples_that_end_on_a_bound_are_counted():
    """t is bounded within its scatter: part of the samples stand there, the rest are inside."""
    dataset = pbrdf.open_experiment("pearl-white")
    free = pbrdf.fit(dataset, starts=16).estimates["t"]
    result = pbrdf.fit(dataset, starts=16, bounds={"t": (0.0, free.value + 0.5 * free.std)})
    found = bootstrap(result, 200)
    # the share beyond half a standard error, 31 %, within four of its own standard errors
    assert abs(float(found.at_bound.sel(parameter="t")) - 0.31) < 0.13
    assert float(found.samples.sel(parameter="t").max()) == result.estimates["t"].upper
    assert any("On a bound in many samples: t" in note for note in found.notes)


def test_simulated_values_scatter_by_their_std_and_leave_gaps_alone(full_fit):
    std = full_fit.data.std.copy()
    std[0, 3] = np.inf
    data = pbrdf.inversion.Observations(
        **{**vars(full_fit.data), "std": std},
    )
    truth = np.full_like(std, 2.0)
    sets = simulate(data, truth, 500, np.random.default_rng(0), scale=3.0)
    values = np.stack([s.values for s in sets])
    gap = ~np.isfinite(std)
    assert (values[:, gap] == 0.0).all()
    pulls = (values[:, ~gap] - 2.0) / std[~gap]
    np.testing.assert_allclose(pulls.std(), 3.0, rtol=0.01)
    np.testing.assert_allclose(pulls.mean(), 0.0, atol=0.03)


@pytest.mark.parametrize(("arguments", "message"), [({"count": 1}, "count=1"), ({"level": 95.0}, "level=95")])
def test_errors_say_what_to_do(full_fit, arguments, message):
    with pytest.raises(FitError, match=message):
        bootstrap(full_fit, **arguments)
