"""Standard errors of many pixels against those of one fit."""

from __future__ import annotations

import numpy as np

from pbrdf.inversion.parameter_map.layout import FLAGS
from pbrdf.inversion.parameter_map.spread import spread_of
from pbrdf.inversion.statistics import covariance, prior_spread


def cases():
    """Unknowns, information matrices of all kinds, bounds."""
    random = np.random.default_rng(7)
    J = random.standard_normal((12, 30, 4)) * [1.0, 100.0, 1e-3, 1.0]
    information = J.swapaxes(1, 2) @ J
    u = np.tile([0.5, 0.5, 0.5, 0.5], (12, 1))
    u[1, 0], u[2, 3], u[3] = 0.0, 1.0, [0.0, 1.0, 0.0, 0.5]
    # directions of which nothing is known: an unknown without influence, two that only count together, nearly so
    information[4, 2], information[4, :, 2] = 0.0, 0.0
    v = np.array([1.0, -1.0, 0.0, 0.0]) / np.sqrt(2.0)
    for number, part in ((5, 1.0), (6, 1.0 - 1e-13)):
        same = random.standard_normal((4, 4))
        same = same @ same.T
        information[number] = same - part * np.outer(same @ v, same @ v) / (v @ same @ v)
    information[7] = 0.0
    return u, information, np.zeros((12, 4)), np.ones((12, 4))


def test_many_spreads_are_those_of_single_fits():
    u, information, low, high = cases()
    scale = np.linspace(1.0, 2.0, 12)
    found = spread_of(u, information, low, high, scale)
    prior = prior_spread(low[0], high[0])
    for b in range(12):
        inside = np.flatnonzero((u[b] > 0.0) & (u[b] < 1.0))
        one = scale[b] * covariance(information[b][np.ix_(inside, inside)], prior[inside])
        error = np.sqrt(np.diag(one))
        large = error >= prior[inside]
        np.testing.assert_array_equal(found.flags[b, inside] == FLAGS["undetermined"], large)
        np.testing.assert_allclose(found.error[b, inside][~large], error[~large], rtol=1e-5)
        assert np.isnan(np.delete(found.error[b], inside)).all()
        assert (np.delete(found.flags[b], inside) & 3 > 0).all()
    assert found.flags[3].tolist() == [1, 2, 1, 0]


def test_shared_unknowns_spread_into_those_of_a_pixel():
    random = np.random.default_rng(9)
    # three pixels with an unknown of their own and two shared ones, as one problem
    J = random.standard_normal((3, 20, 3))
    each = J.swapaxes(1, 2) @ J
    whole = np.zeros((5, 5))
    for b in range(3):
        at = np.ix_([b, 3, 4], [b, 3, 4])
        whole[at] += each[b]
    expected = np.linalg.inv(whole)
    u, low, high = np.full((3, 3), 0.5), np.full((3, 3), -50.0), np.full((3, 3), 50.0)
    common = np.broadcast_to(expected[3:, 3:], (3, 2, 2))
    found = spread_of(u, each, low, high, np.ones(3), (np.array([1, 2]), common))
    for b in range(3):
        np.testing.assert_allclose(found.covariance[b], expected[np.ix_([b, 3, 4], [b, 3, 4])], rtol=1e-10)
