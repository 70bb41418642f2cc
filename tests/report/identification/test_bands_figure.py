"""The measurement over each candidate's band."""

from __future__ import annotations

import numpy as np
import pytest
from figure_helpers import legend, lines

from pbrdf.report.identification.bands_figure import bands_figure, shown_candidates
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
