import numpy as np
import pytest

import pbrdf
from pbrdf.report.dataset.points import Points, dolp_uncertainty
from pbrdf.report.fit.subject import Report


def test_uncertainty_of_dolp_agrees_with_random_draws():
    stokes, std = np.array([2.0, 0.5, -0.3]), np.array([0.02, 0.01, 0.015])
    draws = stokes + std * np.random.default_rng(0).standard_normal((200_000, 3))
    drawn = (np.hypot(draws[:, 1], draws[:, 2]) / draws[:, 0]).std()
    found = dolp_uncertainty(*(np.array([x]) for x in (*stokes, *std)))
    assert found[0] == pytest.approx(drawn, rel=0.01)


def test_uncertainty_of_dolp_with_correlated_errors_agrees_with_random_draws():
    """Light and polarised light that flicker together: the DoLP is known better than either."""
    stokes, std = np.array([2.0, 0.5, -0.3]), np.array([0.04, 0.012, 0.01])
    correlation = np.eye(4)
    correlation[0, :3] = correlation[:3, 0] = [1.0, 0.8, -0.5]
    draws = np.random.default_rng(0).multivariate_normal(
        stokes, correlation[:3, :3] * np.outer(std, std), 200_000, check_valid="raise"
    )
    drawn = (np.hypot(draws[:, 1], draws[:, 2]) / draws[:, 0]).std()
    one_row = [np.array([x]) for x in (*stokes, *std)]
    assert dolp_uncertainty(*one_row, correlation=correlation[None])[0] == pytest.approx(drawn, rel=0.01)
    assert drawn < 0.6 * dolp_uncertainty(*one_row)[0]


def test_covariances_of_the_data_count_in_the_error_bars_of_dolp():
    """I and Q known together only: Q/I is certain. Unless the fit was told to take another noise."""
    paint = pbrdf.load_paint("cd-back")
    angles = np.deg2rad(20.0), np.deg2rad(np.arange(15.0, 78.0, 5.0)), 0.0
    stokes = paint.stokes(*(np.broadcast_to(a, 13) for a in angles))
    covariance = 1e-4 * np.einsum("gi,gj->gij", stokes, stokes) + np.diag([1e-10, 1e-10, np.nan, np.nan])
    covariance[:, 2:, :] = covariance[:, :, 2:] = np.nan
    ds = pbrdf.make_dataset(*angles, quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1], covariance=covariance)
    alone = Points.from_dataset(ds.drop_vars("covariance")).dolp.std
    assert (Points.from_dataset(ds).dolp.std < 0.2 * alone).all()
    for noise, bars in ((None, Points.from_dataset(ds).dolp.std), ("0.02,0.001", None)):
        result = pbrdf.fit(ds, starts=1, noise=noise, fix={"b": 0.2, "n": 1.7})
        found = Points.from_fit(Report(result, ds, "data", {"noise": noise})).dolp.std
        if bars is None:
            assert (found > alone).all()
        else:
            np.testing.assert_allclose(found, bars, rtol=1e-6)


def test_uncertainty_of_no_polarisation_is_that_of_q_over_i():
    zero, one = np.zeros(1), np.ones(1)
    assert dolp_uncertainty(2 * one, zero, np.full(1, np.nan), 0.1 * one, 0.02 * one, np.full(1, np.nan))[
        0
    ] == pytest.approx(0.01)


def test_the_three_forms_of_data_give_the_same_points():
    paint = pbrdf.load_paint("cd-back")
    angles = np.deg2rad([30.0, 40.0]), np.deg2rad([20.0, 50.0]), np.deg2rad([0.0, 200.0])
    M, S = paint.mueller(*angles), paint.stokes(*angles)
    forms = [
        {"mueller": M},
        {"I": S[:, 0], "Q": S[:, 1], "U": S[:, 2]},
        {"I": S[:, 0], "dolp": pbrdf.dolp(S)},
    ]
    for form in forms:
        points = Points.from_dataset(pbrdf.make_dataset(*angles, quantity="brdf", group=[1, 2], **form))
        np.testing.assert_allclose(points.intensity.measured, S[:, 0])
        np.testing.assert_allclose(points.dolp.measured, pbrdf.dolp(S))
        np.testing.assert_allclose(points.phi, [0.0, -160.0])
        assert points.group.tolist() == ["1", "2"]
        assert np.isnan(points.intensity.std).all()


def test_digital_numbers_have_an_arbitrary_scale():
    ds = pbrdf.make_dataset(np.deg2rad(60.0), 0.3, 0.0, quantity="dn", I=[100.0])
    points = Points.from_dataset(ds)
    assert points.arbitrary_scale
    assert points.dolp is None
    assert points.intensity.measured[0] == pytest.approx(200.0)


def test_assumed_noise_is_no_error_bar(report, hemisphere_report):
    assert np.isfinite(Points.from_fit(report).intensity.std).all()
    assert np.isfinite(Points.from_fit(report).dolp.std).all()
    assert np.isnan(Points.from_fit(hemisphere_report).intensity.std).all()
