"""The rule for packets of rays: about the errors of ``default``, for 0.06 < σ ≤ 0.12 as in the plugin."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.stats import norm

import pbrdf
from pbrdf.backend import get_backend
from pbrdf.models.double_gauss import FAST_SIGMA, PACKET_SIGMA
from pbrdf.optics import quadrature
from pbrdf.optics.quadrature import PACKET_RULE


@pytest.fixture(scope="module")
def single():
    return sys.modules[get_backend().Float.__module__].Float32


def errors(sigma, smallest, largest, count=4000, cls=pbrdf.DoubleGauss, **options):
    """|Δ|/f00 of what a renderer takes against ``high``, random paints, zenith angles of both rays in degrees."""
    rng = np.random.default_rng(8)
    angles = (*np.radians(rng.uniform(smallest, largest, (2, count))), rng.uniform(0.0, 2.0 * np.pi, count))
    p = {
        "sigma": rng.uniform(FAST_SIGMA, sigma, count),
        "n": rng.uniform(1.3, 2.2, count),
        "a": np.ones(count),
        "k": rng.uniform(0.7, 4.0, count),
        "b": rng.uniform(-1.0, 2.0, count),
        "t": rng.uniform(0.0, 1.0, count),
    }
    model = cls(**p, **options).for_rendering()
    assert model.facet_rule == PACKET_RULE
    found, high = model.mueller(*angles), cls(**p, **options, accuracy="high").mueller(*angles)
    return np.abs(found - high).max((1, 2)) / high[:, 0, 0]


def test_where_a_renderer_takes_it():
    rules = {
        sigma: pbrdf.DoubleGauss(sigma, 1.6, 1.0, 1.2, 0.0, 0.5).for_rendering()
        for sigma in (FAST_SIGMA, PACKET_SIGMA, PACKET_SIGMA + 1e-6)
    }
    assert [model.facet_rule for model in rules.values()] == [None, PACKET_RULE, None]
    assert [model.chosen["accuracy"] for model in rules.values()] == ["fast", "default", "default"]


@pytest.mark.slow
def test_stated_accuracy():
    """docs/model.md, section 4, as for ``default``: 1e-5 of f00 for σ ≤ 0.1 to 75° but for few cases, 1e-3 to 83°."""
    found = errors(0.1, 0.0, 75.0, 40_000)
    assert np.quantile(found, 0.999) < 1e-5 and found.max() < 1e-4
    # both rays near grazing
    found = errors(0.1, 60.0, 75.0, 20_000)
    assert np.quantile(found, 0.99) < 1e-5 and found.max() < 3e-4
    found = errors(PACKET_SIGMA, 60.0, 83.0, 20_000)
    assert np.quantile(found, 0.999) < 1e-3 and found.max() < 6e-3


def test_accuracy():
    assert np.quantile(errors(0.1, 0.0, 75.0), 0.999) < 1e-5


@pytest.mark.parametrize(
    "options",
    [
        {"kappa": 1.0, "transmittance": "amplitude"},
        {"normalization": "visible"},
        {"cls": pbrdf.ReciprocalDoubleGauss},
    ],
    ids=["metal", "visible", "reciprocal"],
)
def test_accuracy_of_every_reading(options):
    found = errors(0.1, 0.0, 75.0, 2000, **options)
    assert np.quantile(found, 0.99) < 2e-5 and found.max() < 1e-4


def test_few_nodes(jit):
    """One row of 28 nodes in all where the farther edge is far out, whatever the nearer one does."""
    assert len(quadrature._PACKET_ROWS) * 2 * len(quadrature._PACKET_PAIRS) == 28
    assert sum(w for _, w in quadrature._PACKET_ROWS) == pytest.approx(1.0, abs=1e-5)
    assert sum(2.0 * w for _, w in quadrature._PACKET_PAIRS) == pytest.approx(1.0, abs=1e-5)


def test_truncated_normal_variable_in_single_precision(single):
    """The map between two bounds to 2e-5 wherever single precision holds the probabilities."""
    z = np.linspace(-4.0, 4.0, 101)
    for low, high in ((-9.0, 9.0), (-9.0, 2.0), (-0.3, 0.1), (-2.5, 3.0)):
        share = norm.cdf(high) - norm.cdf(low)
        tails = single(np.float32(norm.cdf(low))), single(np.float32(norm.sf(high)))
        found, part = quadrature._between(single(norm.cdf(z)), single(norm.sf(z)), *tails)
        expected = norm.ppf(norm.cdf(low) + share * norm.cdf(z))
        upper = norm.isf(norm.sf(high) + share * norm.sf(z))
        expected = np.where(z > 0.0, upper, expected)
        np.testing.assert_allclose(found.numpy(), expected, atol=2e-5)
        assert part.numpy()[0] == pytest.approx(share, rel=1e-6)
