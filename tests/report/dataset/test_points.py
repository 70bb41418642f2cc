import numpy as np
import pytest

import pbrdf
from pbrdf.report.dataset.points import Points, dolp_uncertainty


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
