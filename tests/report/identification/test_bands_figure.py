"""The measurement over each candidate's band."""

from __future__ import annotations

import numpy as np
import pytest
from figure_helpers import legend, lines

import pbrdf
from pbrdf.identification.identify import identify
from pbrdf.identification.library import bundled_library
from pbrdf.report.identification.bands_figure import bands_figure, shown_candidates
from pbrdf.report.identification.subject import Identified
from pbrdf.report.style import save_figure


def titles(figure):
    return [ax.get_title().split("\n")[0] for ax in figure.axes if ax.get_title()]


@pytest.mark.slow
def test_a_column_for_each_of_the_set_and_the_nearest_outside(identified, scattered):
    assert shown_candidates(identified)[0].name == "white"
    figure = bands_figure(identified)
    assert titles(figure) == ["white: in the set", f"{shown_candidates(identified)[1].name}: not in the set"]
    assert len(figure.axes) == 4  # intensity and degree of polarisation
    assert any("95 % of specimens (scaled to the data)" in text for text in legend(figure))
    accepted = [c for c in shown_candidates(scattered) if c.accepted]
    assert 2 <= len(accepted) <= 3


def test_the_likely_specimen_and_the_band_go_through_the_data(identified):
    ax = bands_figure(identified).axes[0]
    points, likely = lines(ax, "measured"), lines(ax, "most likely specimen")
    bands = [
        c for c in ax.collections if c.get_label().startswith("_") and len(c.get_paths()) and c.get_alpha()
    ]
    assert len(points) == len(likely) == 3
    assert len(bands) == 3
    for measured, curve in zip(points, likely, strict=True):
        x, y = curve.get_xdata(), curve.get_ydata()
        there = np.isfinite(y)
        at = np.interp(measured.get_xdata(), x[there], y[there])
        assert np.median(np.abs(np.asarray(measured.get_ydata()) / at - 1.0)) < 0.05


@pytest.mark.slow
def test_geometries_on_no_curve_stand_side_by_side(scattered, tmp_path):
    figure = bands_figure(scattered)
    ax = figure.axes[0]
    (measured,) = lines(ax, "measured")
    assert list(measured.get_xdata()) == [1, 2, 3]
    assert len(ax.patches) == 3
    assert ax.get_xlabel() == "number of the geometry"
    assert not any("scaled" in text for text in legend(figure))
    for name in ("one", "two"):
        save_figure(bands_figure(scattered), tmp_path / f"{name}.png")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()


def test_all_candidates_are_on_one_scale(identified):
    axes = bands_figure(identified).axes
    assert axes[0].get_ylim() == axes[1].get_ylim()
    assert axes[2].get_ylim() == axes[3].get_ylim()


def test_parts_of_a_curve_do_not_touch_and_only_what_is_drawn_is_counted():
    """One incidence over a gap of 50°, and values of 0 out of the plane of incidence, which no curve goes through."""
    s = np.concatenate([np.linspace(-70.0, -60.0, 6), np.linspace(-10.0, 70.0, 30)])
    out = np.linspace(10.0, 60.0, 6)
    theta_r = np.deg2rad(np.concatenate([np.abs(s), out]))
    phi = np.concatenate([np.where(s < 0.0, np.pi, 0.0), np.full(6, 1.0)])
    theta_i = np.full(theta_r.size, np.deg2rad(30.0))
    paint = bundled_library()["matte-white-thick"].model
    stokes = paint.stokes(theta_i, theta_r, phi)
    values = {"I": np.where(phi == 1.0, 0.0, stokes[:, 0])}
    dataset = pbrdf.make_dataset(
        theta_i, theta_r, phi, quantity="brdf", **values, std={"I": np.full(phi.size, 0.02)}
    )
    report = Identified(identify(dataset, bundled_library()), dataset, "panel", "the bundled paints")
    for ax in bands_figure(report).axes:
        (curve,) = lines(ax, "most likely specimen")
        x, y = curve.get_xdata(), curve.get_ydata()
        assert np.isnan(x).sum() == 1
        assert (np.isfinite(x) == np.isfinite(y)).all()
        before, after = np.flatnonzero(np.isnan(x))[0] + [-1, 1]
        assert (x[before], x[after]) == pytest.approx((-60.0, -10.0))
        # smooth up to the ends: no step there is larger than a hundredth
        assert np.abs(np.diff(np.log(y[before - 5 : before + 1]))).max() < 0.01
        assert np.abs(np.diff(np.log(y[after : after + 6]))).max() < 0.01
        assert not any("not shown" in text.get_text() for text in ax.texts)
