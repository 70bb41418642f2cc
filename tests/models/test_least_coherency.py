"""The search for Mueller matrices of no passive surface finds one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import pbrdf
from pbrdf.models.realisability import least_coherency


def test_least_coherency_finds_the_printed_sign_of_m43():
    good = pbrdf.DoubleGauss(0.1, 2 - 1.5j, 0.3, 1.2, 0.5, 0.5)
    assert least_coherency(good)[0] > -1e-12

    def printed(theta_i, theta_r, phi):
        f = np.array(good.mueller(theta_i, theta_r, phi))
        f[:, 3, 2] = f[:, 2, 3]
        return f

    value, (theta_i, theta_r, _) = least_coherency(SimpleNamespace(mueller=printed))
    assert value < -0.05
    assert np.rad2deg(theta_i) > 30.0 and theta_r == pytest.approx(theta_i, abs=0.2)
