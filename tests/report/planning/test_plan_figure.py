"""The picture of a plan shows what was chosen."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.data.paints import load_paint
from pbrdf.inversion.noise import InstrumentNoise
from pbrdf.planning.candidates import in_plane_candidates, out_of_plane_candidates
from pbrdf.planning.plan import plan
from pbrdf.report.planning.figure import plan_figure
from pbrdf.report.planning.summary import reading_list

MODEL = load_paint("matte-white-thick")


@pytest.fixture(scope="module")
def plans():
    few = {"position_step": np.deg2rad(20.0), "angle_step": np.deg2rad(10.0)}
    return {
        (kind, repeats): plan(
            MODEL, InstrumentNoise(), 20, candidates=make(MODEL, **few), repeats=repeats, starts=1
        )
        for kind, make in (("plane", in_plane_candidates), ("tilted", out_of_plane_candidates))
        for repeats in (1, 8)
    }


def drawn(figure, label):
    """Coordinates of the marks with a label."""
    ax = figure.axes[0]
    for line in ax.lines:
        if line.get_label() == label:
            return np.column_stack(line.get_data())
    for marks in ax.collections:
        if marks.get_label() == label:
            return np.asarray(marks.get_offsets())
    raise AssertionError(f"nothing is called {label}")


@pytest.mark.parametrize("repeats", [1, 8])
def test_chosen_geometries_stand_at_their_angles(plans, repeats):
    made = plans["plane", repeats]
    figure = plan_figure(made, "paint")
    chosen = made.candidates.subset(made.counts > 0)
    signed = np.rad2deg(chosen.theta_r) * np.where(np.cos(chosen.phi) < 0.0, -1.0, 1.0)
    expected = np.column_stack([signed, np.rad2deg(chosen.theta_i)])
    np.testing.assert_allclose(drawn(figure, "this plan"), expected, atol=1e-9)
    assert len(drawn(figure, "plan 3 × 21")) == 63
    assert ("readings" in [ax.get_ylabel() for ax in figure.axes]) == (repeats > 1)


def test_out_of_plane_the_camera_is_shown_over_the_hemisphere(plans):
    made = plans["tilted", 8]
    figure = plan_figure(made, "paint")
    chosen = made.candidates.subset(made.counts > 0)
    expected = np.column_stack([chosen.phi, np.rad2deg(chosen.theta_r)])
    np.testing.assert_allclose(drawn(figure, "this plan"), expected, atol=1e-9)
    assert figure.axes[0].name == "polar"


def test_bars_are_the_relative_errors(plans):
    made = plans["plane", 1]
    bars = plan_figure(made, "paint").axes[1].patches
    heights = np.array([bar.get_height() for bar in bars]).reshape(2, -1)
    np.testing.assert_allclose(heights, 100.0 * np.stack([made.std, made.reference_std]) / made.sizes)


def test_the_list_names_every_reading(plans):
    for (kind, repeats), made in plans.items():
        lines = reading_list(made)
        assert len(lines) == len(np.unique(made.protocol.group))
        if kind == "plane":
            count = sum(
                sum(int(n) for n in map(times, line.partition("sample at ")[2].split(", "))) for line in lines
            )
            assert count == 20, repeats


def times(text):
    return text.partition("×")[2].rstrip(")") or 1
