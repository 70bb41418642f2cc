"""Integrated likelihoods of fitted parameters, against SciPy's normal density."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pbrdf
from pbrdf.errors import FitError
from pbrdf.identification.library import bundled_library
from pbrdf.identification.material import material_from_model
from pbrdf.identification.parameter_evidence import parameter_evidence

MATERIALS = bundled_library().materials


def estimates(count, seed=1):
    random = np.random.default_rng(seed)
    size = len(MATERIALS[0].mean)
    factor = 0.05 * random.standard_normal((count, size, size))
    covariance = factor @ factor.transpose(0, 2, 1) + 1e-4 * np.eye(size)
    return MATERIALS[1].mean + 0.1 * random.standard_normal((count, size)), covariance


def packed(covariance):
    i, j = np.tril_indices(covariance.shape[-1])
    return covariance[:, i, j]


def test_the_normal_density():
    unknowns, covariance = estimates(7)
    log_evidence, distance = parameter_evidence(MATERIALS, unknowns, packed(covariance))
    for n in range(7):
        for c, material in enumerate(MATERIALS):
            total = material.covariance + covariance[n]
            off = unknowns[n] - material.mean
            assert distance[n, c] == pytest.approx(off @ np.linalg.solve(total, off), rel=1e-5)
            density = multivariate_normal.logpdf(unknowns[n], material.mean, total)
            constant = 0.5 * len(off) * np.log(2.0 * np.pi)
            assert log_evidence[n, c] == pytest.approx(density + constant, rel=1e-5, abs=1e-4)


def test_a_parameter_that_is_not_determined_says_nothing():
    unknowns, covariance = estimates(50)
    without = [
        replace(
            m,
            mean=m.mean[1:],
            covariance=m.covariance[1:, 1:],
            space=replace(
                m.space, free=m.space.free[1:], lower=m.space.lower[1:], upper=m.space.upper[1:], terms=()
            ),
        )
        for m in MATERIALS
    ]
    wide = covariance.copy()
    wide[:, 0, :], wide[:, :, 0] = 0.0, 0.0
    wide[:, 0, 0] = 1e8
    found, distance = parameter_evidence(MATERIALS, unknowns, packed(wide))
    expected, short = parameter_evidence(without, unknowns[:, 1:], packed(covariance[:, 1:, 1:]))
    assert distance == pytest.approx(short, rel=1e-4)
    assert found - found[:, :1] == pytest.approx(expected - expected[:, :1], rel=1e-4, abs=1e-3)


def test_more_pixels_than_a_block(monkeypatch):
    import pbrdf.identification.parameter_evidence as module

    unknowns, covariance = estimates(37)
    whole = parameter_evidence(MATERIALS, unknowns, packed(covariance))
    monkeypatch.setattr(module, "BLOCK", 10)
    parts = parameter_evidence(MATERIALS, unknowns, packed(covariance))
    assert np.array_equal(whole[0], parts[0])
    assert np.array_equal(whole[1], parts[1])


def test_materials_of_different_models():
    other = material_from_model("other", pbrdf.ReciprocalDoubleGauss(*pbrdf.PAINTS["white"]))
    with pytest.raises(FitError, match="materials white and other have different models"):
        parameter_evidence([MATERIALS[0], other], *[np.zeros((1, 6)), np.zeros((1, 21))])
