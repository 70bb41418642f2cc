"""Degree and angle of polarisation: standard errors and bias, against simulated noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarization_errors import (
    UNKNOWN_ANGLE,
    debiased_dolp,
    normalized_covariance,
    polarization,
    unbiased_dolp_squared,
)
from pbrdf.optics import stokes as degrees

MIXED = np.array([[4.0, 1.0, -0.5, 0.3], [1.0, 3.0, 0.8, -0.4], [-0.5, 0.8, 2.0, 0.6], [0.3, -0.4, 0.6, 5.0]])


def noisy(light, covariance, n, seed=0):
    return np.random.default_rng(seed).multivariate_normal(light, covariance, n).T


@pytest.mark.parametrize("light", [(900, 300, 200, 100), (900, -50, 20, -400), (500, 0, 80, 30)])
def test_errors_are_the_scatter(light):
    """200 000 noisy Stokes vectors with a full covariance, correlations with the intensity included: the scatter of
    each quantity is its stated standard error within 2 %."""
    found = polarization(light, MIXED)
    seen = noisy(light, MIXED, 200_000)
    scattered = polarization(seen, np.zeros((4, 4, seen.shape[1])))
    for name in ("dolp", "docp", "dop", "aolp"):
        values = getattr(scattered, name)
        if name == "aolp":
            values = (values - found.aolp + np.pi / 2) % np.pi
        assert values.std() == pytest.approx(float(getattr(found, f"{name}_std")), rel=0.02), name


def test_correlation_with_the_intensity_counts():
    """A source that flickers scales the whole Stokes vector: no degree and no angle of polarisation notices."""
    light = np.array([900.0, 300.0, 200.0, 100.0])
    found = polarization(light, 0.01**2 * np.outer(light, light))
    for error in (found.dolp_std, found.docp_std, found.dop_std, found.aolp_std):
        assert error == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(normalized_covariance(light, np.outer(light, light)), 0, atol=1e-15)


@given(st.integers(0, 10**6))
def test_jacobian_by_finite_differences(seed):
    """The variances are gᵀ C g with the gradients of the definitions in pbrdf.optics.stokes."""
    rng = np.random.default_rng(seed)
    light = np.array([10.0, *rng.uniform(-5, 5, 3)])
    root = rng.normal(size=(4, 4))
    covariance = root @ root.T
    found = polarization(light, covariance)
    for name in ("dolp", "docp", "dop", "aolp"):
        function = getattr(degrees, name)
        h = 1e-5
        steps = h * np.eye(4)
        change = np.array([function(light + s) - function(light - s) for s in steps])
        if name == "aolp":
            change = (change + np.pi / 2) % np.pi - np.pi / 2
        g = change / (2 * h)
        expected = np.sqrt(g @ covariance @ g)
        expected = min(expected, UNKNOWN_ANGLE) if name == "aolp" else expected
        assert getattr(found, f"{name}_std") == pytest.approx(expected, rel=1e-4), name


def test_without_polarisation():
    """p = 0: the error of a degree is the mean over all directions, that of the angle of which nothing is known
    π/√12."""
    found = polarization([10.0, 0, 0, 0], np.diag([1.0, 4.0, 2.0, 9.0]))
    assert found.dolp_std == pytest.approx(np.sqrt(3) / 10)
    assert found.dop_std == pytest.approx(np.sqrt(5) / 10)
    assert found.docp_std == pytest.approx(0.3)
    assert found.aolp_std == pytest.approx(np.pi / np.sqrt(12))
    assert np.random.default_rng(0).uniform(-np.pi / 2, np.pi / 2, 10**6).std() == pytest.approx(
        UNKNOWN_ANGLE, rel=0.01
    )


# SNR p/σ: bias of the plain degree, of Wardle & Kronberg, of the modified asymptotic estimator, in σ (LITERATURE 2.11)
BIAS = {
    0: (1.25, 0.76, 0.99),
    1: (0.55, 0.12, 0.29),
    2: (0.27, -0.02, 0.05),
    3: (0.18, -0.01, 0.005),
    5: (0.10, 0.0, 0.001),
}


@pytest.mark.parametrize("snr", BIAS)
def test_bias_of_the_estimators(snr):
    """Equal errors σ of q and u, 400 000 draws (standard error 0.0016 σ): the table to its printed digits."""
    n, sigma = 400_000, 0.01
    covariance = np.zeros((4, 4, n))
    covariance[1, 1] = covariance[2, 2] = sigma**2
    rng = np.random.default_rng(snr)
    psi = 0.4
    S = np.zeros((4, n))
    S[0] = 1.0
    S[1] = sigma * (snr * np.cos(2 * psi) + rng.standard_normal(n))
    S[2] = sigma * (snr * np.sin(2 * psi) + rng.standard_normal(n))
    plain, kronberg, mas = BIAS[snr]
    assert polarization(S, covariance).dolp.mean() / sigma - snr == pytest.approx(plain, abs=0.01)
    assert debiased_dolp(S, covariance, "wardle-kronberg").mean() / sigma - snr == pytest.approx(
        kronberg, abs=0.01
    )
    assert debiased_dolp(S, covariance).mean() / sigma - snr == pytest.approx(mas, abs=0.01)
    # the variance of p² is 4p²σ² + 4σ⁴
    error = 5 * np.sqrt((4 * snr**2 + 4) / n)
    assert unbiased_dolp_squared(S, covariance).mean() / sigma**2 - snr**2 == pytest.approx(0, abs=error)


@pytest.mark.slow
@pytest.mark.parametrize("psi", [0.0, 0.5, 1.2])
def test_unequal_errors(psi):
    """Errors of q and u that differ by 2 and are correlated, at p = 4 σ: the plain degree is too high, by an amount
    that depends on the direction; without the b² of the covariance a correction could not follow. What remains is
    below a tenth of that."""
    n, sigma, p = 300_000, 0.01, 0.06
    C = np.zeros((4, 4))
    C[1:3, 1:3] = sigma**2 * np.array([[2.0, 0.5], [0.5, 0.5]])
    light = np.array([1.0, p * np.cos(2 * psi), p * np.sin(2 * psi), 0.0])
    S = noisy(light, C, n, seed=3)
    C = C[..., None] * np.ones(n)
    across = np.array([-np.sin(2 * psi), np.cos(2 * psi)])
    expected = across @ C[1:3, 1:3, 0] @ across / (2 * p)
    plain = polarization(S, C).dolp.mean() - p
    assert plain == pytest.approx(expected, rel=0.15)
    for method in ("mas", "wardle-kronberg"):
        assert abs(debiased_dolp(S, C, method).mean() - p) < 0.15 * plain + 5 * sigma * 1.5 / np.sqrt(n)


@given(st.floats(0, 20), st.floats(0, 3))
def test_estimators_stay_physical(p, b):
    """Between 0 and the plain degree, and without noise the plain degree itself."""
    S = np.array([1.0, p, 0.0, 0.0])
    C = np.diag([0.0, b**2, b**2, 0.0])
    for method in ("mas", "wardle-kronberg"):
        assert 0 <= debiased_dolp(S, C, method) <= p
    assert debiased_dolp(S, np.zeros((4, 4))) == pytest.approx(p)


def test_shapes_and_missing_components():
    """Arrays of any shape, the components first. An instrument blind to V still has DoLP and AoLP; DoP and DoCP are
    NaN."""
    S = np.ones((4, 2, 3)) * np.array([10.0, 3.0, 2.0, np.nan])[:, None, None]
    C = np.tile(np.eye(4)[..., None, None], (1, 1, 2, 3))
    C[3], C[:, 3] = np.nan, np.nan
    found = polarization(S, C)
    assert found.dolp.shape == (2, 3)
    assert np.isfinite(found.dolp_std).all() and np.isfinite(found.aolp_std).all()
    assert np.isnan(found.docp).all() and np.isnan(found.dop).all() and np.isnan(found.dop_std).all()
    assert np.isfinite(debiased_dolp(S, C)).all() and np.isfinite(unbiased_dolp_squared(S, C)).all()
    none = polarization(np.zeros(4), np.eye(4))
    assert np.isnan(none.dolp) and np.isnan(none.dolp_std) and np.isnan(none.aolp_std)


def test_errors():
    with pytest.raises(DataError, match=r"\(4, …\)"):
        polarization(np.ones(3), np.eye(4))
    with pytest.raises(DataError, match=r"\(4, 4, …\)"):
        debiased_dolp(np.ones((4, 5)), np.eye(4))
    with pytest.raises(DataError, match="mas or wardle-kronberg"):
        debiased_dolp(np.ones(4), np.eye(4), "median")
