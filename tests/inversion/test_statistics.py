"""What a typical value is where most of the data are black."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.statistics import typical


def test_typical_value():
    assert typical(np.array([1.0, -2.0, np.nan, 4.0])) == 2.0
    assert typical(np.array([0.0, 0.0, 0.0, 3.0, 5.0])) == 4.0
    assert typical(np.array([0.0, np.nan])) == 0.0
    assert typical(np.array([])) == 0.0


def test_a_lobe_on_black_is_fitted():
    """A glossy black paint, as a camera sees it that reads 0 off the lobe: most intensities are exactly 0."""
    theta_r = np.radians(np.arange(0.0, 75.0, 2.5))
    angles = np.full_like(theta_r, np.radians(30.0)), theta_r, np.zeros_like(theta_r)
    model = pbrdf.DoubleGauss(sigma=0.05, n=1.5, a=1e-4, k=1.0, b=0.0, t=0.5)
    intensity = model.stokes(*angles)[:, 0]
    black = np.where(intensity < 0.02, 0.0, intensity)
    assert np.median(black) == 0.0
    with np.errstate(all="raise"):
        found = pbrdf.fit(pbrdf.make_dataset(*angles, quantity="brdf", I=black), starts=8)
    assert found.model.values["sigma"] == pytest.approx(0.05, rel=0.02)
    assert found.fitted["all"].intensity_rms < 10.0
