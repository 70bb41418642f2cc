"""Least-squares Stokes parameters of many pixels, against dense linear algebra one pixel at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarimeter import lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.polarimeter.stokes_solution import (
    BLOCK,
    determined_components,
    row_space,
    solve_stokes,
)

SIX = lcvr(retardance_set("six_states")).analyzer
LINEAR = rotating_polarizer(np.deg2rad([0, 30, 60, 90, 120])).analyzer


def reference(intensities, variance, W, weighted):
    """One pixel: minimum-norm weighted least squares by an SVD of the scaled problem."""
    root = 1 / np.sqrt(variance) if weighted else np.ones_like(variance)
    inverse = np.linalg.pinv(W * root[:, None], rcond=1e-9) * root
    return inverse @ intensities, (inverse * variance) @ inverse.T


@pytest.mark.parametrize("weighted", [False, True])
@given(seed=st.integers(0, 10**6), states=st.integers(4, 8))
def test_every_pixel_is_the_dense_solution(weighted, seed, states):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(5, states, 4))
    values, variance = rng.normal(size=(states, 5)), 10.0 ** rng.uniform(-3, 3, size=(states, 5))
    found, covariance = solve_stokes(values, variance, W, weighted=weighted)
    same, same_covariance = solve_stokes(values, variance, W[0], weighted=weighted)
    for p in range(5):
        for vectors, S, C in ((W[p], found, covariance), (W[0], same, same_covariance)):
            expected, expected_covariance = reference(values[:, p], variance[:, p], vectors, weighted)
            scale = np.sqrt(np.diag(expected_covariance))
            np.testing.assert_allclose(S[:, p], expected, rtol=1e-6, atol=1e-6 * scale.max())
            np.testing.assert_allclose(
                C[:, :, p], expected_covariance, rtol=1e-6, atol=1e-6 * scale.max() ** 2
            )


@pytest.mark.parametrize("weighted", [False, True])
def test_noiseless_intensities_give_the_light_back(weighted):
    rng = np.random.default_rng(0)
    S = rng.normal(size=(4, 3, 7))
    for W, known in ((SIX, 4), (LINEAR, 3)):
        values = np.tensordot(W, S, axes=(1, 0))
        found, covariance = solve_stokes(values, rng.uniform(1, 100, values.shape), W, weighted=weighted)
        np.testing.assert_allclose(found[:known], S[:known], atol=1e-12)
        assert np.isnan(found[known:]).all() and np.isnan(covariance[known:]).all()
        assert np.isnan(covariance[:, known:]).all() and np.isfinite(covariance[:known, :known]).all()


def test_weighted_solution_has_the_least_variance():
    """Gauss–Markov: no component is known better without the weights."""
    rng = np.random.default_rng(1)
    variance = 10.0 ** rng.uniform(-2, 2, size=(6, 50))
    _, best = solve_stokes(np.zeros((6, 50)), variance, SIX)
    _, plain = solve_stokes(np.zeros((6, 50)), variance, SIX, weighted=False)
    assert (np.einsum("iip->ip", best) <= np.einsum("iip->ip", plain) * (1 + 1e-9)).all()


def test_what_is_determined_changes_over_the_field():
    """Where a cell of a map does not see V, only V is missing there."""
    W = np.stack([SIX, SIX * [1, 1, 1, 0], SIX * [0, 0, 0, 0]])
    light = np.array([2.0, 0.5, -0.3, 0.1])
    values = (W @ light).T
    for weighted in (False, True):
        found, covariance = solve_stokes(values, np.ones((6, 3)), W, weighted=weighted)
        np.testing.assert_allclose(found[:, 0], light, atol=1e-12)
        np.testing.assert_allclose(found[:3, 1], light[:3], atol=1e-12)
        assert np.isnan(found[3, 1]) and np.isnan(found[:, 2]).all()
        np.testing.assert_allclose(np.diag(covariance[:3, :3, 1]), [2 / 3, 2, 2])


@pytest.mark.parametrize("shrink", [1e-20, 1e-30, 1e20])
def test_extreme_weights_raise_nothing(shrink):
    """A state a very great deal better (or worse) known than the others makes the normal matrix singular in floating
    point; the solution stays right: that state is matched exactly, the others as before."""
    light = np.array([2.0, 0.5, -0.3, 0.1])
    values = np.repeat((SIX @ light)[:, None], 3, axis=1)
    variance = np.ones((6, 3))
    variance[0, 1] = shrink
    found, covariance = solve_stokes(values, variance, SIX)
    np.testing.assert_allclose(found, np.repeat(light[:, None], 3, axis=1), atol=1e-6)
    assert np.isfinite(covariance).all()


def test_bad_numbers_are_nan_in_their_pixel_only():
    values, variance = np.ones((6, 5)), np.ones((6, 5))
    values[0, 0], values[1, 1], variance[2, 2], variance[3, 3] = np.nan, np.inf, 0.0, -1.0
    for weighted in (False, True):
        found, covariance = solve_stokes(values, variance, SIX, weighted=weighted)
        assert np.isnan(found[:, :4]).all() and np.isnan(covariance[..., :4]).all()
        assert np.isfinite(found[:, 4]).all() and np.isfinite(covariance[..., 4]).all()


def test_more_pixels_than_are_worked_on_at_a_time():
    rng = np.random.default_rng(3)
    values, variance = rng.normal(size=(6, BLOCK + 5)), rng.uniform(1, 2, size=(6, BLOCK + 5))
    found, covariance = solve_stokes(values, variance, SIX)
    for p in (0, BLOCK - 1, BLOCK, BLOCK + 4):
        expected, expected_covariance = reference(values[:, p], variance[:, p], SIX, True)
        np.testing.assert_allclose(found[:, p], expected, atol=1e-12)
        np.testing.assert_allclose(covariance[..., p], expected_covariance, atol=1e-12)


def test_one_pixel_has_no_pixel_dimension():
    found, covariance = solve_stokes(SIX @ [1, 0, 0, 0.5], np.ones(6), SIX)
    assert found.shape == (4,) and covariance.shape == (4, 4)
    np.testing.assert_allclose(found, [1, 0, 0, 0.5], atol=1e-15)


@given(st.integers(0, 10**6), st.integers(1, 4))
def test_row_space_is_a_projector_on_the_analyser_vectors(seed, rank):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(3, 6, rank)) @ rng.normal(size=(3, rank, 4))
    P = row_space(W)
    np.testing.assert_allclose(P @ P, P, atol=1e-7)
    np.testing.assert_allclose(W @ P, W, atol=1e-7)
    np.testing.assert_allclose(np.trace(P, axis1=1, axis2=2), rank, atol=1e-7)
    assert determined_components(P).all() == (rank == 4)


def test_errors():
    with pytest.raises(DataError, match="do not fit"):
        solve_stokes(np.ones((5, 3)), np.ones((5, 3)), SIX)
    with pytest.raises(DataError, match="do not fit"):
        solve_stokes(np.ones((6, 3)), np.ones((6, 2)), SIX)
    with pytest.raises(DataError, match="do not fit"):
        solve_stokes(np.ones((6, 3)), np.ones((6, 3)), np.stack([SIX] * 2))
