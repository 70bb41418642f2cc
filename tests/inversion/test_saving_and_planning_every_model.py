"""Every model can be fitted, saved, planned for and drawn, whatever its parameters are called."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from every_model import EVERY, example
from pbrdf.inversion.noise import InstrumentNoise
from pbrdf.planning.plan import plan


def exact_data(model):
    """Noiseless Stokes parameters in and out of the plane of incidence, uncertainties of 1 % of I."""
    rng = np.random.default_rng(4)
    i, r = (
        a.ravel() for a in np.meshgrid(np.deg2rad([15.0, 40.0, 60.0]), np.deg2rad(np.arange(0.0, 75.0, 5.0)))
    )
    phi = np.where(np.arange(i.size) % 3 == 0, rng.uniform(-np.pi, np.pi, i.size), 0.0)
    stokes = model.stokes(i, r, phi)
    std = dict.fromkeys("IQU", 0.01 * stokes[:, 0])
    return pbrdf.make_dataset(
        i, r, phi, quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1], U=stokes[:, 2], std=std
    )


@pytest.mark.slow
@EVERY
def test_its_own_data_are_described_exactly_and_the_fit_comes_back(cls, tmp_path):
    pbrdf.register(cls)
    truth = example(cls)
    result = pbrdf.fit(exact_data(truth), truth, starts=8)
    assert result.goodness.chi2 < 1e-6 * result.goodness.data
    for name, estimate in result.estimates.items():
        if estimate.verdict == "determined":
            assert abs(estimate.value - truth.values[name]) < 1e-3 * estimate.std + 1e-9, name
    result.save(tmp_path / "fit")
    assert pbrdf.load_fit(tmp_path / "fit").model == result.model


@pytest.mark.slow
@EVERY
def test_a_plan_is_made_for_it(cls):
    made = plan(example(cls), InstrumentNoise(linear=0.01, circular=0.05), 24, starts=1)
    assert made.names == tuple(p.name for p in cls.parameters if p.fitted)
    assert np.isfinite(made.std).all() and len(made.protocol) == 24
