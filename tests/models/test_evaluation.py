"""Evaluation in pieces: the same numbers, and no copies of everything."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss, double_gauss, evaluation

MODEL = DoubleGauss(sigma=0.04, n=1.5, a=1.0, k=1.2, b=0.2, t=0.5)
GRID = np.linspace(0.0, 1.4, 30)[:, None], np.linspace(0.0, 1.3, 50)[None, :], 0.7


@pytest.fixture(params=[40, 500, 1499, 1500])
def pieces(request, monkeypatch):
    """Number of pieces in which ``GRID`` is evaluated."""
    monkeypatch.setattr(evaluation, "CHUNK", request.param)
    return math.ceil(1500 / request.param)


def test_pieces_give_the_same(pieces, monkeypatch):
    """Angles that broadcast, along an axis that runs fast or slowly, and in any order of memory."""
    found = MODEL.mueller(*GRID)
    turned = MODEL.mueller(*(np.asfortranarray(a) for a in np.broadcast_arrays(*GRID)))
    monkeypatch.setattr(evaluation, "CHUNK", 1 << 20)
    expected = MODEL.mueller(*GRID)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)
    np.testing.assert_array_equal(turned, found)


def test_pieces_are_as_long_as_each_other(pieces, monkeypatch):
    """Each then takes the memory of the one before."""
    sizes = []
    launch = evaluation._launch

    def counted(*args):
        sizes.append(args[5])
        launch(*args)

    monkeypatch.setattr(evaluation, "_launch", counted)
    monkeypatch.setattr(DoubleGauss, "lane_groups", lambda self, *_: [(self, None)])
    MODEL.mueller(*GRID)
    assert len(sizes) == pieces and sum(sizes) == 1500 and max(sizes) - min(sizes) <= 1


def test_nothing_to_evaluate():
    assert MODEL.mueller(np.zeros((0, 3)), 0.1, 0.0).shape == (0, 3, 4, 4)


def test_no_copies(monkeypatch):
    """In pieces, NumPy holds the result and little more: no angles of the whole grid, no second result."""
    monkeypatch.setattr(evaluation, "CHUNK", 4000)
    angles = np.linspace(0.0, 1.4, 100)[:, None], np.linspace(0.0, 1.3, 200)[None, :], 0.7
    MODEL.mueller(*angles)
    tracemalloc.start()
    try:
        result = MODEL.mueller(*angles)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1.1 * result.nbytes


@pytest.mark.parametrize("kind", [DoubleGauss, ReciprocalDoubleGauss])
@pytest.mark.parametrize(
    ("sigma", "options"),
    [(0.1, {}), (np.linspace(0.02, 0.1, 2000), {"kappa": 0.7}), (0.1, {"accuracy": "draft"}), (0.25, {})],
)
def test_averages_found_beforehand(monkeypatch, kind, sigma, options):
    """Of many directions those of one rule are averaged together: the matrices are the same, horizon included."""
    rng = np.random.default_rng(4)
    theta = rng.uniform(0.0, 0.5 * np.pi, (2, 2000))
    theta[0, :7] = 0.5 * np.pi
    model = kind(sigma, 1.6, 1.0, 1.3, 0.2, 0.7, **options)
    angles = (*theta, rng.uniform(-np.pi, np.pi, 2000))
    expected = model.mueller(*angles)
    monkeypatch.setattr(double_gauss, "_FEW", 1)
    found = model.mueller(*angles)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
    assert np.all(found[:7] == 0.0)


def test_averages_found_beforehand_where_one_ray_is_the_same(monkeypatch):
    """Scalars among the angles, and no direction that takes the rule of fewest points."""
    monkeypatch.setattr(double_gauss, "_FEW", 1)
    angles = 1.25, np.linspace(0.0, 1.4, 500), np.linspace(0.0, 3.0, 500)
    model = DoubleGauss(0.1, 1.6, 1.0, 1.3, 0.2, 0.7, normalization="visible")
    parts = [model.mueller(1.25, r, phi) for r, phi in zip(*angles[1:], strict=True)][::50]
    np.testing.assert_allclose(model.mueller(*angles)[::50], parts, rtol=1e-10, atol=1e-12)
