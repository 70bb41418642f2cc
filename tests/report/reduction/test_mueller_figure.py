"""The figure of measured Mueller matrices: over what it draws them, and what it leaves out."""

from __future__ import annotations

import numpy as np
import pytest
from figure_helpers import legend, lines

from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.reduction.mueller_properties import mueller_properties
from pbrdf.instruments.reduction.mueller_reduction import MuellerMeans
from pbrdf.optics.elements import diattenuator, retarder
from pbrdf.report.reduction.mueller_figure import properties_figure

RETARDANCES = np.deg2rad([10.0, 30.0, 50.0, 70.0])


def means_of(matrices, noise=1e-4):
    count = len(matrices)
    names, zero = tuple(f"s{k}" for k in range(count)), np.zeros(count)
    covariance = np.broadcast_to(noise**2 * np.eye(16), (count, 16, 16))
    return MuellerMeans(names, np.asarray(matrices), covariance, zero, zero, ({"good": 1},) * count)


def drawn(means, angles=None):
    found = {"paint": means} if isinstance(means, MuellerMeans) else means
    return properties_figure(found, {r: mueller_properties(m) for r, m in found.items()}, angles, "t")


def table(theta_i, theta_r, **more):
    names = tuple(f"s{k}" for k in range(len(theta_i)))
    return AngleTable(names, np.deg2rad(theta_i), np.deg2rad(theta_r), **more)


def test_over_series():
    figure = drawn(means_of(retarder(0.3, RETARDANCES)))
    ax = figure.axes[2]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["s0", "s1", "s2", "s3"]
    (line,) = lines(ax, "paint")
    np.testing.assert_allclose(line.get_ydata(), [10, 30, 50, 70])
    assert line.get_linestyle() == "None"
    assert not figure.legends


def test_over_angles():
    """In the plane of incidence: over θr with a curve for each θi, negative on the source's side, in order; over θi
    where that is another each time. Out of the plane, or at several wavelengths, over the series."""
    means = means_of(retarder(0.3, RETARDANCES))
    figure = drawn(means, table([20, 20, 50, 50], [30, 10, 10, 30], phi=[0.0, np.pi, 0.0, 0.0]))
    assert legend(figure) == ["paint, θi = 20°", "paint, θi = 50°"]
    (first,), (second,) = (lines(figure.axes[2], label) for label in legend(figure))
    np.testing.assert_allclose(first.get_xydata(), [[-10, 30], [30, 10]])
    np.testing.assert_allclose(second.get_xydata(), [[10, 50], [30, 70]])
    mirror = drawn(means, table([20, 30, 40, 50], [20, 30, 40, 50]))
    np.testing.assert_allclose(lines(mirror.axes[2], "paint")[0].get_xdata(), [20, 30, 40, 50])
    for angles in (
        table([20, 20, 50, 50], [30, 10, 10, 30], phi=0.5),
        table([20, 20, 50, 50], [30, 10, 10, 30], wavelength=[400.0, 500, 400, 500]),
        table([20, 20, 50], [30, 10, 10]),
    ):
        assert drawn(means, angles).axes[2].get_xlabel() == "series"


def test_regions_have_colours():
    means = means_of(retarder(0.3, RETARDANCES))
    figure = drawn({"one": means, "two": means})
    assert legend(figure) == ["one", "two"]


@pytest.mark.parametrize(("noise", "shown"), [(1e-4, [True, False]), (0.3, [False, False])])
def test_retardances_that_are_not_known_are_not_drawn(noise, shown):
    figure = drawn(means_of([retarder(0.3, 1.0), diattenuator(0.3)], noise))
    (line,) = lines(figure.axes[2], "paint")
    assert list(np.isfinite(line.get_ydata())) == shown
    assert np.isfinite(lines(figure.axes[0], "paint")[0].get_ydata()).all()


def test_many_series_have_names_for_some():
    count = 200
    figure = drawn(means_of(np.broadcast_to(retarder(0.3, 1.0), (count, 4, 4))))
    assert len(figure.axes[2].get_xticklabels()) <= 12
    low, high = figure.axes[2].get_ylim()
    assert high - low == pytest.approx(2.0)
