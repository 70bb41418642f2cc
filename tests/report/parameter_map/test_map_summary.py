"""A map in numbers and sentences."""

import io
import json

import numpy as np
import pytest
import xarray as xr
from example_maps import example_map

from pbrdf.report.parameter_map.shown_map import ShownMap, Window
from pbrdf.report.parameter_map.summary import (
    MapSummary,
    count_states,
    parameter_rows,
    part_headings,
    part_rows,
    print_map,
)
from pbrdf.report.printing import printing_console


def summary_of(found, window=None):
    return MapSummary.of(found, ShownMap(found, window))


def test_medians_shares_and_counts():
    found = example_map((60, 50))
    summary = summary_of(found)
    good = found["status"].values == 0
    p, b = summary.parameters[0], summary.parameters[-1]
    known = good & (found["flags"].values[-1] != 4)
    assert b.median == np.median(found["estimate"].values[-1][known])
    assert p.median == np.median(found["estimate"].values[0][good])
    low, high = np.percentile(found["estimate"].values[0][good], (16, 84))
    assert p.spread == pytest.approx(0.5 * (high - low))
    assert p.standard_error == np.median(found["standard_error"].values[0][good])
    assert p.at_bounds == (found["flags"].values[0][good] == 1).mean()
    assert summary.parameters[-1].undetermined == (found["flags"].values[-1][good] == 4).mean()
    many = good & (found["starts"].values > 1)
    assert summary.several_optima == (found["optima"].values[many] > 1).mean()
    assert summary.searched == many.sum() / good.sum()
    assert sum(summary.states.values()) == summary.total == 3000
    assert summary.fitted == good.sum()
    assert summary.measured == (found["status"].values < 4).sum()


def test_states_are_counted_over_all_pixels_though_few_are_shown():
    found = example_map((60, 50))
    window = Window.of(found, most=6)
    summary = summary_of(found, window)
    assert summary.states["converged"] == (found["status"].values == 0).sum()
    assert summary.shown == 36
    assert "36 evenly spread pixels of 3 000" in summary.sampled()


def test_counting_by_rows_misses_none(monkeypatch):
    monkeypatch.setattr("pbrdf.report.parameter_map.summary._AT_A_TIME", 170)
    found = example_map((60, 50), parameters=1)
    found["status"].encoding["chunks"] = (4, 50)
    counts = count_states(found, ShownMap(found))
    assert counts["not_measured"] == (found["status"].values == 4).sum()
    assert sum(counts.values()) == 3000


def test_the_verdict_follows_what_converged_and_how_well_the_model_fits():
    found = example_map((30, 30), cause=False)
    assert summary_of(found).level == "describes"
    assert summary_of(found).sentence == "900 of 900 measured pixels have a result (100 %)."
    found["status"][:3] = 1
    assert summary_of(found).level == "partly"
    found["status"][:20] = 3
    assert summary_of(found).level == "not"
    found["status"][:] = 0
    found["chi2"] *= 4.0
    missed = summary_of(found)
    assert missed.level == "partly"
    assert "misses the data by more than their uncertainty" in missed.reasons[0]
    found["status"][:] = 4
    assert summary_of(found).sentence == "No pixel was measured."


def test_an_unfinished_map_says_so():
    found = example_map((30, 30), cause=False)
    found["status"][10:] = -1
    summary = summary_of(found)
    assert summary.level == "partly"
    assert "Not yet fitted: 600 pixels." in summary.reasons


def test_a_shared_parameter_is_one_number_with_its_error():
    found = example_map((30, 30), parameters=2, cause=False)
    found["estimate"][1] = 1.523
    found["standard_error"][1] = 0.012
    rows = list(parameter_rows(summary_of(found)))
    assert rows[1][:3] == ["n", "1.523 ± 0.012", "the same"]


def test_what_is_printed_fits_a_narrow_terminal():
    text = io.StringIO()
    print_map(summary_of(example_map((30, 30))), printing_console(file=text, width=110))
    assert "χ² per degree of freedom: median" in text.getvalue()
    assert max(map(len, text.getvalue().splitlines())) <= 110


def test_what_an_index_is_held_at_is_told():
    found = example_map((30, 30))
    assert summary_of(found).held == ()
    described = {"model": "double-gauss", "sources": {"n": "n is held at 1.46, that of a page."}}
    summary = summary_of(found.assign_attrs(model=json.dumps(described)))
    text = io.StringIO()
    print_map(summary, printing_console(file=text, width=110))
    assert summary.held == ("n is held at 1.46, that of a page.",)
    assert summary.held[0] in text.getvalue()


def test_medians_by_part():
    """Two halves and a part without a result; labels of the whole map, though every other pixel is shown."""
    found = example_map((60, 50))
    numbers = np.repeat([[1, 0, 4]], 60, axis=0).repeat([25, 5, 20], axis=1)
    found["status"].values[:, 30:] = 1
    labels = xr.DataArray(
        numbers, dims=("y", "x"), attrs={"flag_values": [1, 4], "flag_meanings": "left_half right"}
    )
    window = Window.of(found, most=30)
    summary = MapSummary.of(found, ShownMap(found, window), labels)
    left, right = summary.parts
    assert (left.name, right.name, right.fitted) == ("left half", "right", 0)
    shown = found["status"].values[::2, ::2] == 0
    inside = shown & (numbers[::2, ::2] == 1)
    assert left.fitted == inside.sum()
    assert left.medians[0] == np.median(found["estimate"].values[0][::2, ::2][inside])
    assert list(part_rows(summary))[1][1:3] == ["0", "–"]
    assert part_headings(summary)[:3] == ["part", "pixels", "σ (sigma)"]
    console = printing_console(file=io.StringIO(), width=120)
    print_map(summary, console)
    assert "medians by part of the sample" in console.file.getvalue()
    assert MapSummary.of(found, ShownMap(found, window)).parts == ()
