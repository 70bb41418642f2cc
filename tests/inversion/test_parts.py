"""The small parts of the inversion: noise, starts, clusters, covariance, hold-out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.clusters import cluster
from pbrdf.inversion.holdout import HoldOut, prediction_errors
from pbrdf.inversion.noise import EqualNoise, InstrumentNoise, NoiseModel, parse_noise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.starts import sobol_starts
from pbrdf.inversion.statistics import covariance, goodness, prior_spread


def test_noise_is_relative_in_the_bright_and_absolute_in_the_dark():
    noise = NoiseModel(relative=0.02, absolute=0.001)
    intensity = np.array([1e-6, 0.5, 0.5, 0.5, 1000.0])
    std = noise.standard_uncertainty("Q", intensity, np.ones(5))
    assert std[0] == pytest.approx(0.001 * 0.5, rel=1e-3)
    assert std[-1] == pytest.approx(20.0, rel=1e-6)
    dolp = noise.standard_uncertainty("dolp", intensity, np.ones(5))
    assert dolp[-1] == pytest.approx(0.02, rel=1e-6) and dolp[0] > 100.0


def test_noise_is_read_as_numbers_or_percentages():
    assert NoiseModel.parse("2%,0.1%") == NoiseModel(0.02, 0.001)
    assert NoiseModel.parse("0.02") == NoiseModel(0.02, 0.02)
    with pytest.raises(FitError, match=r"relative part is -1\.0"):
        NoiseModel.parse("-1")


@given(count=st.integers(1, 40), size=st.integers(1, 7), seed=st.integers(0, 99))
def test_starts_fill_the_box_and_keep_off_its_walls(count, size, seed):
    lower, upper = -np.arange(1.0, size + 1), np.arange(1.0, size + 1) ** 2
    points = sobol_starts(lower, upper, count, seed)
    assert points.shape == (count, size)
    share = (points - lower) / (upper - lower)
    assert (share >= 0.05).all() and (share <= 0.95).all()


@pytest.mark.parametrize("size", [1, 2, 7, 64])
def test_the_sobol_sequence_is_scipys(size):
    from scipy.stats import qmc

    from pbrdf.inversion.starts import _sobol_integers

    np.testing.assert_array_equal(
        _sobol_integers(size, 256) / 2**30, qmc.Sobol(size, scramble=False).random_base2(8)
    )


def test_more_dimensions_than_the_table_has_are_scipys():
    points = sobol_starts(np.zeros(70), np.ones(70), 16, 3)
    assert points.shape == (16, 70) and (points >= 0.05).all() and (points <= 0.95).all()


def test_starts_are_space_filling_and_repeatable():
    points = sobol_starts(np.zeros(2), np.ones(2), 64, 1)
    cells = np.unique(np.floor((points - 0.05) / 0.9 * 8).clip(0, 7) @ [8, 1])
    assert len(cells) > 40, "64 random points would fill about 40 of 64 cells"
    np.testing.assert_array_equal(points, sobol_starts(np.zeros(2), np.ones(2), 64, 1))


def test_clusters_join_equal_ends_and_keep_distinct_ones():
    points = np.array([[0.5], [0.50001], [0.9], [0.5], [0.2]])
    cost = np.array([1.0, 1.0, 1.0, 2.0, np.inf])
    assert cluster(points, cost, np.ones(1), 1e-3, 1e-6) == [[0, 1], [2], [3]]


def test_covariance_is_the_inverse_and_large_where_nothing_is_known():
    A = np.array([[4.0, 1.0], [1.0, 9.0]])
    np.testing.assert_allclose(covariance(A, np.array([1.0, 10.0])), np.linalg.inv(A), rtol=1e-12)
    singular = np.array([[4.0, 0.0], [0.0, 0.0]])
    C = covariance(singular, np.ones(2))
    assert C[0, 0] == pytest.approx(0.25) and C[1, 1] > 1e12


def test_prior_spread_is_that_of_a_uniform_density():
    x = np.random.default_rng(0).uniform(2.0, 5.0, 200_000)
    assert prior_spread(np.array([2.0]), np.array([5.0]))[0] == pytest.approx(x.std(), rel=5e-3)


def test_goodness_by_hand():
    """Three values, std 1, residuals 1, 0, −1 and one hole: χ² = 2."""
    values = np.array([[1.0, 2.0, 3.0, 0.0]])
    std = np.array([[1.0, 1.0, 1.0, np.inf]])
    modelled = np.array([[2.0, 2.0, 2.0, 7.0]])
    g = goodness(2.0, values, modelled, std, ("I",), 1, std_known=True)
    assert (g.data, g.free, g.reduced_chi2) == (3, 1, 1.0)
    assert g.r_squared["I"] == pytest.approx(0.0)
    assert g.aic == pytest.approx(2.0 + 2.0) and g.bic == pytest.approx(2.0 + math.log(3.0))
    unknown = goodness(2.0, values, modelled, std, ("I",), 1, std_known=False)
    assert unknown.aic == pytest.approx(3.0 * math.log(2.0 / 3.0) + 2.0)


def test_hold_out_by_group_angle_wavelength_and_fraction():
    dataset = pbrdf.open_experiment("white")
    assert HoldOut.parse("group=3,1").mask(dataset).sum() == 42
    assert HoldOut.parse("theta_i=50").mask(dataset).sum() == 1
    fraction = HoldOut.parse("fraction=0.25").mask(dataset, seed=4)
    assert fraction.sum() == 16
    assert (fraction == HoldOut.parse("fraction=0.25").mask(dataset, seed=4)).all()
    with pytest.raises(FitError, match="nothing is left to fit"):
        HoldOut.parse("wavelength=476").mask(dataset)
    with pytest.raises(FitError, match="no such data; the values of wavelength are 476"):
        HoldOut.parse("wavelength=500").mask(dataset)
    with pytest.raises(FitError, match="'x' is not a number"):
        HoldOut.parse("theta_i=x").mask(dataset)


def test_prediction_errors_by_hand():
    import xarray as xr

    table = xr.Dataset(
        {
            "I_measured": ("geometry", [1.0, 2.0, 0.0, np.nan]),
            "I_modelled": ("geometry", [1.1, 1.8, 0.005, 1.0]),
            "dolp_measured": ("geometry", [0.1, 0.2, np.nan, 0.0]),
            "dolp_modelled": ("geometry", [0.1, 0.1, 0.5, 0.0]),
        }
    )
    errors = prediction_errors(table, np.array([True, True, True, True]))
    assert errors.count == 4
    # 10 %, −10 %, and 0.005 against 0, relative to 5 % of the median 1
    assert errors.intensity_rms == pytest.approx(0.1) and errors.intensity_max == pytest.approx(0.1)
    assert errors.dolp_max == pytest.approx(0.1) and errors.dolp_rms == pytest.approx(0.1 / math.sqrt(3.0))


def test_instrument_noise_adds_read_noise_and_quantisation_on_the_datas_scale():
    """8-bit digital numbers: quantisation alone gives 0.289 DN; radiance DN = f cosθ_i here."""
    noise = parse_noise("instrument:linear=1%,circular=5%,read=0.5,quantum=1")
    assert noise == InstrumentNoise(0.01, 0.05, 0.5, 1.0)
    cosine = np.array([1.0, 0.5])
    std = noise.standard_uncertainty("Q", np.array([0.0, 100.0]) / cosine, 1.0 / cosine)
    floor = math.hypot(0.5, 0.2887)
    np.testing.assert_allclose(std * cosine, [floor, math.hypot(1.0, floor)], rtol=1e-3)
    assert noise.standard_uncertainty("V", np.array([100.0]), np.ones(1))[0] == pytest.approx(5.03, rel=1e-2)
    with pytest.raises(FitError, match="give instrument:linear"):
        parse_noise("instrument:gain=3")


def test_equal_weights_are_equal_and_their_scale_unknown():
    dataset = pbrdf.open_experiment("cd-back")
    data = Observations.from_dataset(dataset, EqualNoise())
    assert np.ptp(data.std) == 0.0 and not data.std_known
    stated = Observations.from_dataset(dataset, InstrumentNoise())
    assert stated.std_known
    np.testing.assert_allclose(stated.std[0], 0.01 * np.abs(dataset["I"]))


@pytest.mark.slow
def test_the_papers_objective_compares_intensity_and_dolp():
    dataset = pbrdf.open_experiment("matte-white-thick")
    data = Observations.from_dataset(dataset, objective="paper")
    assert data.channels == ("I", "dolp") and not data.std_known
    for row, std in zip(data.values, data.std, strict=True):
        np.testing.assert_allclose(std, np.sqrt((row**2).mean()))
    result = pbrdf.fit(dataset, objective="paper", starts=16)
    signed = pbrdf.fit(dataset, starts=16)
    truth = pbrdf.PAINTS["matte-white-thick"][5]
    for fitted in (result, signed):
        assert abs(fitted.estimates["t"].value - truth) < 4.0 * fitted.estimates["t"].std
    # equal weights let the bright lobe count more than the weak diffuse polarisation that t rests on
    assert result.estimates["t"].std > signed.estimates["t"].std


@pytest.mark.slow
def test_a_full_covariance_counts_as_generalised_least_squares():
    """χ² = Σ rᵀ C⁻¹ r; a diagonal covariance is the standard uncertainties."""
    dataset = pbrdf.open_experiment("cd-back")
    names = ("I", "Q", "U", "V")
    std = np.stack([dataset[f"{c}_std"].values for c in names])
    plain = pbrdf.fit(dataset, starts=8)
    diagonal = pbrdf.fit(dataset, starts=8, covariance=np.einsum("cg,cd->gcd", std**2, np.eye(4)))
    for name, estimate in plain.estimates.items():
        assert diagonal.estimates[name].value == pytest.approx(estimate.value, rel=1e-8)
    correlation = np.eye(4)
    correlation[0, 1] = correlation[1, 0] = 0.8
    covariance = np.einsum("cg,cd,dg->gcd", std, correlation, std)
    full = pbrdf.fit(dataset, starts=8, covariance=covariance)
    residual = np.stack([full.comparison[f"{c}_residual"].values for c in names], axis=1)
    chi2 = np.einsum("gc,gcd,gd->", residual, np.linalg.inv(covariance), residual)
    assert full.goodness.chi2 == pytest.approx(chi2, rel=1e-9)
    assert full.estimates["n"].std != pytest.approx(plain.estimates["n"].std, rel=0.05)
    with pytest.raises(FitError, match=r"it must be \(63, 4, 4\)"):
        pbrdf.fit(dataset, covariance=np.ones((3, 4, 4)))
    with pytest.raises(FitError, match="covariance at index 0 is not symmetric and positive definite"):
        pbrdf.fit(dataset, covariance=np.ones((63, 4, 4)))
