"""Reports of fits of ratios: axes with their own names, drawn values, words that speak of no intensity."""

from __future__ import annotations

import numpy as np
import pytest
from figure_helpers import lines, numbers_drawn

import pbrdf
from pbrdf.report.dataset.describe import describe
from pbrdf.report.dataset.figure import data_figure
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.fit.page import page_text
from pbrdf.report.fit.polarisation_figure import polarisation_figure
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import summary_text

PAINT = pbrdf.DoubleGauss(sigma=0.1, n=1.6, a=0.5, k=1.1, b=0.2, t=0.5)


def plane():
    """In the plane of incidence, radians."""
    theta_i, s = (np.deg2rad(a.ravel()) for a in np.meshgrid([20.0, 50.0], np.arange(-75.0, 76.0, 10.0)))
    return theta_i, np.abs(s), np.where(s < 0.0, np.pi, 0.0)


@pytest.fixture(scope="module")
def stokes_report():
    angles = plane()
    stokes = PAINT.stokes(*angles)
    shares = {f"{c}_over_I": stokes[:, i] / stokes[:, 0] for i, c in ((1, "Q"), (2, "U"))}
    dataset = pbrdf.make_dataset(*angles, **shares, std=dict.fromkeys(shares, 0.002))
    return Report(pbrdf.fit(dataset, PAINT, starts=1), dataset, "shares", {})


@pytest.fixture(scope="module")
def mirror_report():
    """Two elements over m00 in the mirror direction, nothing else."""
    theta = np.deg2rad(np.arange(10.0, 85.0, 5.0))
    M = np.asarray(PAINT.mueller(theta, theta, 0.0, part="specular"))
    kept = np.full(M.shape, np.nan)
    for i, j in ((0, 1), (2, 2)):
        kept[:, i, j] = M[:, i, j] / M[:, 0, 0] + 1e-5 * np.cos(7.0 * np.arange(len(M)))
    dataset = pbrdf.make_dataset(theta, theta, 0.0, mueller_over_m00=kept)
    smooth = {"a": 0.0, "k": 1.0, "b": 0.0, "t": 0.0, "sigma": 0.1}
    return Report(pbrdf.fit(dataset, fix=smooth, starts=2), dataset, "mirror", {})


def test_figures_of_shares_have_their_own_axes(stokes_report):
    assert {ax.get_ylabel() for ax in fit_figure(stokes_report).axes} == {
        "degree of linear polarisation",
        "difference of DoLP",
    }
    figure = polarisation_figure(stokes_report)
    assert [ax.get_ylabel() for ax in figure.axes[:2]] == ["Q/I", "U/I"]
    drawn = np.concatenate([line.get_ydata() for line in lines(figure.axes[0], "measured")])
    expected = stokes_report.dataset["Q_over_I"].values
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected), rtol=1e-12)
    curve = np.concatenate([line.get_ydata() for line in lines(figure.axes[0], "model")])
    assert np.nanmax(np.abs(curve)) == pytest.approx(np.abs(expected).max(), abs=0.05)


def test_elements_alone_are_drawn_over_the_angle_of_incidence(mirror_report):
    figure = fit_figure(mirror_report)
    assert [ax.get_ylabel() for ax in figure.axes[::2]] == ["m01/m00", "m22/m00"]
    assert "angle of incidence" in figure.axes[0].get_xlabel()
    assert numbers_drawn(lines(figure.axes[0], "measured")) == 15
    assert len(data_figure(mirror_report.dataset, "mirror").axes) == 2


@pytest.mark.parametrize("name", ["stokes_report", "mirror_report"])
def test_words_speak_of_ratios(request, name):
    report = request.getfixturevalue(name)
    text = summary_text(report)
    assert "No intensity was measured, only ratios" in text
    assert "ratios" in text and "median error of the intensity" not in text
    assert "which hold no scale" in text or report.checks is None
    page = page_text(report, {}, {})
    assert "_over_" not in page and "_over_" not in text
    assert "(ratios, 1)" in " ".join(describe(report.dataset))


def test_sizes_of_the_errors_are_those_of_the_ratios(mirror_report):
    result = mirror_report.result
    found = result.fitted["all"]
    assert np.isnan(found.intensity_rms) and np.isnan(found.dolp_rms)
    table = result.comparison
    residuals = [table[f"m{e}_over_m00_residual"].values for e in ("01", "22")]
    assert found.ratio_rms == pytest.approx(np.sqrt(np.mean(np.square(residuals))))
    assert result.estimates["n"].value == pytest.approx(1.6, abs=1e-3)
