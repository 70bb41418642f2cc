"""Every model can be fitted: to its own noisy Stokes vectors, until only the noise is left."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.models import MODELS

#: Away from the defaults.
TRUTH = {"sigma": 0.15, "roughness": 0.2, "a": 0.3, "k": 0.9, "b": 0.2, "albedo": 0.4, "n": 1.55}


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_only_the_noise_is_left(name):
    cls = MODELS[name]
    held = {p.name: p.default for p in cls.parameters if not p.fitted}
    middle = {p.name: (0.6 * p.default + 0.4 * p.upper if not p.amplitude else 0.8) for p in cls.parameters}
    truth = cls(**{p.name: held.get(p.name, TRUTH.get(p.name, middle[p.name])) for p in cls.parameters})
    theta_r = np.tile(np.radians(np.linspace(-75.0, 75.0, 40)), 3)
    theta_i = np.repeat(np.radians([20.0, 40.0, 60.0]), 40)
    angles = theta_i, np.abs(theta_r), np.where(theta_r < 0.0, np.pi, 0.0)
    stokes = truth.stokes(*angles)
    noise = 0.01 * stokes[:, 0]
    rng = np.random.default_rng(1)
    noisy = {c: stokes[:, j] + noise * rng.normal(size=120) for j, c in enumerate("IQU")}
    data = pbrdf.make_dataset(*angles, quantity="brdf", **noisy, std=dict.fromkeys("IQU", noise))
    # lobes beside each other have local minima
    result = pbrdf.fit(data, cls, starts=64)
    assert result.goodness.reduced_chi2 == pytest.approx(1.0, abs=0.25)
    clean = result.model.stokes(*angles)
    assert np.abs((clean - stokes)[:, :3] / noise[:, None]).max() < 3.0
