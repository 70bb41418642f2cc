"""Held-out errors: definitions by hand, units, weighted medians, and whether paired uncertainties cover."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

from pbrdf.inversion.heldout_errors import PointErrors, Resampling, score, units_of


def table(**columns):
    return xr.Dataset({name: ("geometry", np.asarray(values, float)) for name, values in columns.items()})


def intensities(errors):
    return PointErrors(np.asarray(errors, float), np.empty((0, len(errors))))


def test_errors_by_hand():
    comparison = table(
        I_measured=[1.0, 2.0, 4.0, 0.01, np.nan],
        I_modelled=[1.1, 1.0, np.nan, 0.02, 1.0],
        Q_measured=[0.1, np.nan, 0.4, 0.009, 0.1],
        Q_modelled=[0.22, 0.5, 0.4, 0.0, 0.1],
    )
    errors = PointErrors.of(comparison, ("I", "Q"), np.ones(5, bool))
    # the median of the measured is 1.5: what is darker than 5 % of it is compared with that
    np.testing.assert_allclose(errors.intensity, [0.1, -0.5, np.inf, 0.01 / 0.075, np.nan])
    # 0.22/1.1 − 0.1 and, where the model gives no intensity, infinity; none where it is dark or was not measured
    np.testing.assert_allclose(errors.polarised, [[0.1, np.nan, np.inf, np.nan, np.nan]])
    chosen = errors.take(np.array([0, 1, 3]))
    assert chosen.intensity_median == pytest.approx(0.01 / 0.075)
    assert chosen.polarisation_rms == pytest.approx(0.1)
    assert score(chosen) == pytest.approx(math.hypot(0.01 / 0.075, 0.1))
    assert score(errors) == math.inf


def test_degree_of_polarisation_alone_is_compared_as_it_is():
    comparison = table(dolp_measured=[0.1, 0.3], dolp_modelled=[0.2, 0.1])
    errors = PointErrors.of(comparison, ("dolp",), np.ones(2, bool))
    assert math.isnan(errors.intensity_median)
    assert score(errors) == pytest.approx(math.sqrt((0.01 + 0.04) / 2))


def test_ratios_are_compared_as_they_are_with_and_without_an_intensity():
    columns = {"Q_over_I_measured": [0.1, 0.3], "Q_over_I_modelled": [0.2, 0.1]}
    alone = PointErrors.of(table(**columns), ("Q_over_I",), np.ones(2, bool))
    assert math.isnan(alone.intensity_median)
    np.testing.assert_allclose(alone.polarised, [[0.1, -0.2]])
    beside = table(I_measured=[8.0, np.nan], I_modelled=[4.0, 4.0], **columns)
    errors = PointErrors.of(beside, ("I", "Q_over_I"), np.ones(2, bool))
    np.testing.assert_allclose(errors.polarised, [[0.1, -0.2]])  # also where no intensity was measured
    np.testing.assert_allclose(errors.intensity, [-0.5, np.nan])


def test_enough_folds_are_the_units():
    fold = np.repeat([3, 5, 9, 11, 12, 40], 4)
    unit, words = units_of(fold, *np.zeros((3, 24)))
    np.testing.assert_array_equal(unit, np.repeat(np.arange(6), 4))
    assert words == "6 folds"


def test_few_folds_are_cut_into_bands_that_both_sides_of_the_plane_share():
    theta_r, phi = (
        a.ravel()
        for a in np.meshgrid(np.deg2rad(np.arange(5.0, 80.0, 5.0)), np.deg2rad([-120, -40, 40, 120]))
    )
    fold = np.repeat([0, 1], 30)
    unit, words = units_of(fold, np.full(60, 0.5), theta_r, phi)
    assert words == "12 bands of neighbouring directions"
    assert set(unit) == set(range(12))
    assert not set(unit[fold == 0]) & set(unit[fold == 1])
    for i in range(60):
        mirror = np.isclose(theta_r, theta_r[i]) & np.isclose(phi, -phi[i]) & (fold == fold[i])
        assert (unit[mirror] == unit[i]).all()
    counts = np.bincount(unit)
    assert counts.min() >= 2 and counts.max() <= 8


def test_resampled_scores_are_medians_and_mean_squares_of_the_drawn_units():
    rng = np.random.default_rng(1)
    unit = np.repeat(np.arange(4), [3, 5, 2, 7])
    errors = PointErrors(rng.standard_normal(17), rng.standard_normal((2, 17)))
    errors.intensity[4] = errors.polarised[0, 9] = np.nan
    resampling = Resampling(unit, seed=3)
    found = resampling.scores(errors)
    drawn = np.random.default_rng(3).integers(0, 4, (500, 4))
    for k in (0, 7, 499):
        rows = np.concatenate([np.flatnonzero(unit == u) for u in drawn[k]])
        size = np.sort(np.abs(errors.intensity[rows]))
        size = size[~np.isnan(size)]
        squares = errors.polarised[:, rows].ravel() ** 2
        expected = math.hypot(size[(len(size) - 1) // 2], math.sqrt(np.nanmean(squares)))
        assert found[k] == pytest.approx(expected)


def test_a_model_is_not_apart_from_itself_and_apart_from_one_twice_as_far_off():
    rng = np.random.default_rng(2)
    one = intensities(0.05 * rng.standard_normal(200))
    resampling = Resampling(np.repeat(np.arange(10), 20))
    same = resampling.paired(one, one)
    assert (same.difference, same.uncertainty, same.apart) == (0.0, 0.0, False)
    twice = resampling.paired(intensities(2.0 * one.intensity), one)
    assert twice.apart and twice.difference == pytest.approx(score(one))
    back = resampling.paired(one, intensities(2.0 * one.intensity))
    assert back.apart and back.difference == pytest.approx(-twice.difference)


def test_without_units_to_resample_nothing_is_told_apart():
    paired = Resampling(np.zeros(9, int)).paired(intensities(np.full(9, 0.5)), intensities(np.full(9, 0.1)))
    assert math.isnan(paired.uncertainty)
    assert not paired.apart


def test_a_model_without_numbers_is_apart():
    resampling = Resampling(np.repeat(np.arange(6), 3))
    assert resampling.paired(intensities(np.full(18, np.inf)), intensities(np.full(18, 0.1))).apart


def folds_of_two_models(rng, units, each, ratio=1.3):
    """Relative errors of two models that share most of what they miss; the second's are larger by a ratio.

    The size of the errors differs between units, as folds differ in difficulty.
    """
    size = 0.05 * np.exp(0.3 * np.repeat(rng.standard_normal(units), each))
    shared, own = rng.standard_normal((2, units * each))
    first = size * shared
    second = ratio * size * (0.95 * shared + math.sqrt(1.0 - 0.95**2) * own)
    return first, second


def polarisations(errors):
    return PointErrors(np.full(len(errors), np.nan), np.asarray(errors)[None])


@pytest.mark.parametrize("kind", [intensities, polarisations])
@pytest.mark.parametrize(("units", "each"), [(6, 30), (12, 15)])
def test_paired_uncertainties_cover(units, each, kind):
    """The interval of 95 % holds the true difference in about as many simulations, and is narrower than unpaired."""
    rng = np.random.default_rng(11)
    truth = np.diff([score(kind(e)) for e in folds_of_two_models(rng, 20000, 20)])[0]
    resampling = Resampling(np.repeat(np.arange(units), each))
    covered, widths, unpaired = 0, [], []
    runs = 200
    for _ in range(runs):
        first, second = map(kind, folds_of_two_models(rng, units, each))
        scores = resampling.scores(second), resampling.scores(first)
        paired = resampling.paired(second, first, scores)
        covered += paired.lower <= truth <= paired.upper
        widths.append(paired.uncertainty)
        unpaired.append(math.hypot(*map(resampling.uncertainty, scores)))
    assert covered >= 0.88 * runs
    assert np.median(widths) < 0.6 * np.median(unpaired)


@pytest.mark.parametrize("kind", [intensities, polarisations])
def test_two_models_that_are_as_good_are_seldom_told_apart(kind):
    """With equal errors on average, and a ratio of 1.3 nearly always."""
    rng = np.random.default_rng(5)
    resampling = Resampling(np.repeat(np.arange(8), 22))
    apart = {}
    for ratio in (1.0, 1.3):
        pairs = [map(kind, folds_of_two_models(rng, 8, 22, ratio)) for _ in range(150)]
        apart[ratio] = np.mean([resampling.paired(*pair).apart for pair in pairs])
    assert apart[1.0] < 0.12
    assert apart[1.3] > 0.6
