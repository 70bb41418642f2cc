import numpy as np

import pbrdf
from pbrdf.report.dataset.points import Points
from pbrdf.report.fit.fitted_points import FittedPoints
from pbrdf.report.fit.subject import Report


def test_covariances_of_the_data_count_in_the_error_bars_of_dolp():
    """I and Q known together only: Q/I is certain. Unless the fit was told to take another noise."""
    paint = pbrdf.load_paint("cd-back")
    angles = np.deg2rad(20.0), np.deg2rad(np.arange(15.0, 78.0, 5.0)), 0.0
    stokes = paint.stokes(*(np.broadcast_to(a, 13) for a in angles))
    covariance = 1e-4 * np.einsum("gi,gj->gij", stokes, stokes) + np.diag([1e-10, 1e-10, np.nan, np.nan])
    covariance[:, 2:, :] = covariance[:, :, 2:] = np.nan
    ds = pbrdf.make_dataset(*angles, quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1], covariance=covariance)
    alone = Points.from_dataset(ds.drop_vars("covariance")).dolp.std
    assert (Points.from_dataset(ds).dolp.std < 0.2 * alone).all()
    for noise, bars in ((None, Points.from_dataset(ds).dolp.std), ("0.02,0.001", None)):
        result = pbrdf.fit(ds, starts=1, noise=noise, fix={"b": 0.2, "n": 1.7})
        found = FittedPoints.from_report(Report(result, ds, "data", {"noise": noise})).measured.dolp.std
        if bars is None:
            assert (found > alone).all()
        else:
            np.testing.assert_allclose(found, bars, rtol=1e-6)


def test_assumed_noise_is_no_error_bar(report, hemisphere_report):
    assert np.isfinite(FittedPoints.from_report(report).measured.intensity.std).all()
    assert np.isfinite(FittedPoints.from_report(report).measured.dolp.std).all()
    assert np.isnan(FittedPoints.from_report(hemisphere_report).measured.intensity.std).all()
