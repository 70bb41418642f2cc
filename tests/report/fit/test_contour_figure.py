"""Joint confidence regions as they are drawn."""

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.report.fit.checks import Checks, run_checks
from pbrdf.report.fit.contour_figure import contour_figure
from pbrdf.report.fit.folder import write_report
from pbrdf.report.fit.subject import Report

pytestmark = pytest.mark.slow

RISE = 5.991  # χ² with two degrees of freedom, 95 %


def drawn_alone(result, dataset, *pairs):
    """The figure of a coarse grid, without the other checks."""
    contours = [result.contour(a, b, points=21) for a, b in pairs]
    return contour_figure(Report(result, dataset, "paint", {}, Checks([], None, None, contours=contours)))


def edges(ax):
    """Vertices of the drawn edges, one array for each region from the smallest on."""
    from matplotlib.contour import ContourSet

    found = [c for c in ax.collections if isinstance(c, ContourSet) and not c.filled]
    return [np.concatenate([path.vertices for path in c.get_paths()]) for c in found]


@pytest.fixture(scope="module")
def drawn(report):
    dataset = report.dataset
    whole = pbrdf.fit(dataset, starts=4, nuisances=["angle"])
    return whole, drawn_alone(whole, dataset, ("t", "n"), ("angle", "sigma"))


def test_regions_of_a_nearly_linear_fit_are_the_ellipses_of_its_standard_errors(drawn):
    """The region's shadow on an axis is √5.99 standard errors on either side for 95 %, √2.28 for 68 %."""
    result, figure = drawn
    for ax, (a, b) in zip(figure.axes, (("t", "n"), ("angle", "sigma")), strict=True):
        for vertices, rise in zip(edges(ax), (2.279, RISE), strict=True):
            for column, name in enumerate((a, b)):
                estimate = result.estimates[name]
                factor = np.rad2deg(1.0) if name == "angle" else 1.0
                away = (vertices[:, column] / factor - estimate.value) / estimate.std
                assert away.max() == pytest.approx(math.sqrt(rise), rel=0.06), (name, rise)
                assert -away.min() == pytest.approx(math.sqrt(rise), rel=0.06), (name, rise)


def test_axes_say_what_and_in_which_unit(drawn):
    result, figure = drawn
    first, second = figure.axes
    assert first.get_xlabel().startswith("t: ") and first.get_ylabel().startswith("n: ")
    assert "(°)" in second.get_xlabel()
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["68% for the pair (χ² + 2.28)", "95% for the pair (χ² + 5.99)", "best"]
    (best,) = first.get_lines()
    assert best.get_xydata()[0] == pytest.approx([result.estimates[n].value for n in ("t", "n")])


def test_a_bound_that_ends_a_region_is_drawn(report):
    """n is not allowed above a value within its error: the region ends there."""
    free = pbrdf.fit(report.dataset, starts=4).estimates["n"]
    bound = free.value + 0.5 * free.std
    result = pbrdf.fit(report.dataset, starts=4, bounds={"n": (1.3, bound)})
    figure = drawn_alone(result, report.dataset, ("n", "t"))
    bars = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 2]
    assert len(bars) == 1
    assert list(bars[0].get_xdata()) == pytest.approx([bound, bound])
    assert edges(figure.axes[0])[-1][:, 0].max() == pytest.approx(bound)
    assert "bound of the fit" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_figure_and_the_thresholds_are_part_of_the_report(report, tmp_path):
    result, dataset = report.result, report.dataset
    whole = Report(result, dataset, "paint", {}, run_checks(result, dataset, contours=[("t", "n")]))
    names = [path.name for path in write_report(whole, tmp_path / "fit")]
    assert "contours.png" in names
    assert (tmp_path / "fit" / "contours.png").stat().st_size > 10_000
    (record,) = whole.checks.record(report.result)["contours"]
    assert record["parameters"] == ["t", "n"]
    assert record["chi2_rise"]["0.95"] == pytest.approx(RISE, rel=1e-3)
