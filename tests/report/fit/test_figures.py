import numpy as np
import pytest

import pbrdf
from pbrdf.errors import DataError, ModelError
from pbrdf.report.fit.figures import data_figure, fit_figure, save_figure, starts_figure
from pbrdf.report.fit.subject import Report
from pbrdf.report.model.figure import model_figure
from pbrdf.report.style import DISTINCT_COLOURS, looks_of


def lines(ax, label):
    """Lines of an axes with this label, those of error bars included."""
    found = [line for line in ax.get_lines() if line.get_label() == label]
    return found + [c.lines[0] for c in ax.containers if c.get_label() == label]


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def numbers_drawn(drawn):
    return sum(np.isfinite(line.get_ydata()).sum() for line in drawn)


@pytest.fixture(scope="module")
def figure(report):
    return fit_figure(report)


def test_every_point_and_one_curve_per_group_are_drawn(figure):
    for ax in figure.axes[0], figure.axes[2]:
        assert numbers_drawn(lines(ax, "measured")) == 42
        assert numbers_drawn(lines(ax, "held out")) == 21
        curves = lines(ax, "model")
        assert len(curves) == 3
        assert [curve.get_linestyle() for curve in curves] == ["-", "-", "--"]
        assert min(len(curve.get_xdata()) for curve in curves) > 500


def test_curves_are_the_model(figure, report):
    curve = lines(figure.axes[0], "model")[0]
    x, y = curve.get_xdata(), curve.get_ydata()
    stokes = report.result.model.stokes(
        np.deg2rad(60.0 - x), np.deg2rad(np.abs(x)), np.where(x < 0.0, np.pi, 0.0)
    )
    np.testing.assert_allclose(y, stokes[:, 0], rtol=1e-9)
    dolp = lines(figure.axes[2], "model")[0].get_ydata()
    np.testing.assert_allclose(dolp, pbrdf.dolp(stokes), atol=1e-9)


def test_held_out_points_have_open_markers(figure):
    for line in lines(figure.axes[0], "held out"):
        assert line.get_markerfacecolor() == "white"
    for line in lines(figure.axes[0], "measured"):
        assert line.get_markerfacecolor() == line.get_color()
    assert legend(figure)[:3] == [
        "group 1: θi + θr = 60°",
        "group 2: θi + θr = 80°",
        "group 3: θi + θr = 100° (held out)",
    ]
    assert "measured ± standard uncertainty" in legend(figure)


def test_axes_have_names_and_units(figure):
    intensity, difference, dolp, _ = figure.axes
    assert intensity.get_ylabel() == "intensity (arbitrary scale)"
    assert "(°)" in intensity.get_xlabel()
    assert dolp.get_ylabel() == "degree of linear polarisation"
    assert "%" in difference.get_ylabel()
    assert "group=3 held out" in figure.get_suptitle()
    assert "476 nm" in figure.get_suptitle()


def test_differences_are_those_of_the_comparison(figure, report):
    drawn = np.concatenate([line.get_ydata() for line in lines(figure.axes[1], "held out")])
    comparison = report.result.comparison.isel(geometry=report.result.comparison["held_out"].values)
    expected = 100.0 * comparison["I_residual"] / comparison["I_measured"]
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected.values))


def test_points_out_of_plane_are_compared_with_the_model(hemisphere_report):
    figure = fit_figure(hemisphere_report)
    cut, agreement = figure.axes
    assert legend(figure)[:3] == ["θi = 20°", "θi = 40°", "θi = 60° (held out)"]
    assert "measured" in legend(figure)  # the noise was assumed: no error bars
    total = hemisphere_report.dataset.sizes["geometry"]
    assert numbers_drawn(lines(agreement, "measured") + lines(agreement, "held out")) == total
    assert numbers_drawn(lines(agreement, "held out")) == total / 3
    assert len(lines(agreement, "equal")) == 1
    assert agreement.get_title() == f"All {total} geometries"
    assert "hemisphere.csv, 550 nm" in figure.get_suptitle()
    assert "/" not in figure.get_suptitle()
    assert len(lines(cut, "model")) == 3


def test_intensity_is_logarithmic_only_over_decades():
    s = np.linspace(-60.0, 60.0, 13)
    for peak, scale in ((1.2, "linear"), (5.0, "linear"), (100.0, "log")):
        ds = pbrdf.make_dataset(
            np.deg2rad(30.0),
            np.deg2rad(np.abs(s)),
            np.where(s < 0.0, np.pi, 0.0),
            quantity="brdf",
            I=np.where(s == 30.0, peak, 1.0),
        )
        ax = data_figure(ds, "x").axes[0]
        assert ax.get_yscale() == scale
        if peak == 5.0:
            assert ax.get_ylim()[0] == 0.0


def test_values_that_a_logarithm_cannot_show_are_counted():
    s = np.linspace(-60.0, 60.0, 25)
    I = np.where(s == 30.0, 100.0, 1.0)  # noqa: E741
    I[3] = -0.01
    I[4] = 0.0
    ds = pbrdf.make_dataset(
        np.deg2rad(30.0), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0), quantity="brdf", I=I
    )
    texts = [text.get_text() for text in data_figure(ds, "x").axes[0].texts]
    assert texts == ["2 measured values ≤ 0 not shown"]


def test_data_without_a_plane_are_drawn_over_the_hemisphere(hemisphere):
    aside = hemisphere.isel(geometry=np.abs(np.sin(hemisphere["phi"].values)) > 0.5)
    figure = data_figure(aside, "aside")
    discs = [ax for ax in figure.axes if ax.name == "polar"]
    assert [ax.get_title() for ax in discs] == ["group 20", "group 40", "group 60"]
    assert sum(len(ax.collections[0].get_offsets()) for ax in discs) == aside.sizes["geometry"]
    assert "intensity (1/sr)" in {ax.get_ylabel() for ax in figure.axes}


def test_data_have_no_model_lines(report):
    figure = data_figure(report.dataset, "paint.csv")
    assert len(figure.axes) == 2
    assert lines(figure.axes[0], "model") == []
    assert numbers_drawn(lines(figure.axes[0], "measured")) == 63


def test_a_partly_held_out_cut_says_so(report):
    from pbrdf.report.fit.subject import Report

    result = pbrdf.fit(report.dataset, hold_out="fraction=0.3", starts=2)
    figure = fit_figure(Report(result, report.dataset, "x"))
    assert "held out" in legend(figure)
    assert numbers_drawn(lines(figure.axes[0], "held out")) == 19


def test_too_many_curves_are_thinned_out():
    theta_i, s = (a.ravel() for a in np.meshgrid(np.arange(2.0, 82.0, 4.0), np.arange(-60.0, 61.0, 10.0)))
    ds = pbrdf.make_dataset(
        np.deg2rad(theta_i), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0), quantity="brdf", I=1.0
    )
    figure = data_figure(ds, "x")
    assert figure.axes[0].get_title().startswith("Plane of incidence (10 of ")
    assert len(legend(figure)) == 10


def test_every_start_is_drawn_from_begin_to_end(report):
    figure = starts_figure(report)
    free = [e.parameter.symbol for e in report.result.estimates.values() if e.verdict != "fixed"]
    assert [ax.get_title().split(":")[0] for ax in figure.axes] == free
    drawn = np.concatenate([line.get_ydata().reshape(-1, 3) for line in figure.axes[1].get_lines()])
    found = drawn[np.argsort(drawn[:, 0]), :2]
    expected = np.stack([report.result.start_values[:, 1], report.result.end_values[:, 1]], axis=1)
    np.testing.assert_allclose(found, expected[np.argsort(expected[:, 0])])
    assert figure.axes[0].get_yscale() == "log"
    assert "reached the best optimum" in legend(figure)[0]


def test_a_model_is_drawn_over_the_hemisphere_and_in_plane():
    paint = pbrdf.load_paint("cd-back")
    figure = model_figure(paint, 35.0, "cd-back")
    plane, polarisation = figure.axes[2:4]
    assert {line.get_label() for line in plane.get_lines()} >= {"total", "specular", "diffuse"}
    total = lines(plane, "total")[0]
    at = int(np.argmin(np.abs(total.get_xdata() - 35.0)))
    assert total.get_ydata()[at] == pytest.approx(paint.stokes(np.deg2rad(35.0), np.deg2rad(35.0))[0])
    signed = lines(polarisation, "total")[0].get_ydata()
    assert signed.min() < -0.1 < 0.05 < signed.max()
    assert [ax.name for ax in figure.axes[:2]] == ["polar", "polar"]
    assert "35°" in figure.get_suptitle()


def test_a_figure_of_a_model_needs_one_model_and_an_angle():
    paint = pbrdf.load_paint("cd-back")
    with pytest.raises(ModelError, match="must be at least 0"):
        model_figure(paint, 90.0, "x")
    with pytest.raises(ModelError, match="arrays"):
        model_figure(paint.replace(n=np.array([1.5, 1.6])), 30.0, "map")


@pytest.mark.slow
def test_figures_are_saved_alike_and_by_extension(figure, tmp_path):
    for kind in ("png", "svg"):
        save_figure(figure, tmp_path / f"a.{kind}")
        save_figure(figure, tmp_path / f"b.{kind}")
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    with pytest.raises(DataError, match=r"figures are written as \.png, \.pdf, \.svg"):
        save_figure(figure, tmp_path / "a.jpeg")
    assert len(list(tmp_path.iterdir())) == 4


def test_no_figure_opens_a_window(figure):
    import sys

    assert "matplotlib.pyplot" not in sys.modules


def test_looks_are_distinct():
    for count in (1, DISTINCT_COLOURS, DISTINCT_COLOURS + 1, 10):
        assert len({look.colour for look in looks_of(count)}) == count


def test_curves_include_what_the_instrument_adds(report):
    from pbrdf.report.fit.subject import Report

    dataset = report.dataset.copy(deep=True)
    first = dataset["group"].values == 1
    for name in "IQUV":
        dataset[name] = dataset[name] * np.where(first, 2.0, 1.0)
    result = pbrdf.fit(dataset, nuisances=["gain:group"], starts=2, fix={"a": 1.5174})
    figure = fit_figure(Report(result, dataset, "x"))
    curve = lines(figure.axes[0], "model")[0]
    points = lines(figure.axes[0], "measured")[0]
    at = np.interp(points.get_xdata(), curve.get_xdata(), curve.get_ydata())
    np.testing.assert_allclose(at, points.get_ydata(), rtol=0.05)


def test_the_points_of_the_diffuse_step_are_marked():
    """Stepwise: a white dot on every point outside the lobe, and none without the strategy."""
    dataset = pbrdf.open_experiment("cd-back")
    result = pbrdf.fit(dataset, starts=4, strategy="stepwise")
    stepwise = fit_figure(Report(result, dataset, "cd-back"))
    dots = [line for line in stepwise.axes[0].lines if line.get_label() == "diffuse step"]
    assert sum(len(line.get_xdata()) for line in dots) == int(result.comparison["used_for_diffuse"].sum())
    assert any("diffuse step" in label for label in legend(stepwise))
