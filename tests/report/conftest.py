"""Fits that the report tests look at, made once."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.report.fit.subject import Report

SETTINGS = {"starts": 8, "noise": None}


@pytest.fixture(scope="session")
def report():
    """A bundled paint, the third camera position held out."""
    dataset = pbrdf.open_experiment("matte-white-thick")
    return Report(pbrdf.fit(dataset, hold_out="group=3", starts=8), dataset, "matte-white-thick", SETTINGS)


@pytest.fixture(scope="session")
def hemisphere():
    """Intensities of a matte paint over the hemisphere at three angles of incidence, without uncertainties."""
    theta_i, theta_r, phi = (
        np.deg2rad(a.ravel())
        for a in np.meshgrid([20.0, 40.0, 60.0], np.arange(0.0, 80.0, 10.0), np.arange(0.0, 360.0, 45.0))
    )
    paint = pbrdf.DoubleGauss(sigma=0.15, n=1.5, a=0.5, k=1.1, b=0.2, t=0.5)
    return pbrdf.make_dataset(
        theta_i,
        theta_r,
        phi,
        quantity="brdf",
        I=paint.stokes(theta_i, theta_r, phi)[:, 0] * (1.0 + 0.02 * np.sin(np.arange(theta_i.size))),
        group=np.round(np.rad2deg(theta_i)).astype(int),
        wavelength=550.0,
        attrs={"assumptions": ["the file does not say where phi = 0 lies; forward was assumed"]},
    )


@pytest.fixture(scope="session")
def hemisphere_report(hemisphere):
    """The hemisphere fitted, one incidence held out; noise assumed."""
    result = pbrdf.fit(hemisphere, hold_out="theta_i=60", starts=4, fix={"t": 0.5})
    return Report(result, hemisphere, "some/where/hemisphere.csv", SETTINGS)
