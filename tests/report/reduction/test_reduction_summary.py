"""The table of a reduction: what it shows, and what it warns of."""

import csv
import io
import re

import numpy as np
import pytest
from rich.console import Console

from pbrdf.instruments.reduction.region_averages import RegionAverage
from pbrdf.report.reduction.summary import print_averages, write_averages


def average(stokes, saturated=0, std=1.0, pixels=100):
    stokes = np.array(stokes, dtype=float)
    covariance = np.where(np.isnan(stokes)[:, None] | np.isnan(stokes), np.nan, std**2 * np.eye(4))
    counts = {"good": pixels - saturated, "saturated": saturated, "dead": 0, "dark": 0}
    return RegionAverage(stokes, covariance, covariance, np.full(4, 7.0), pixels, counts)


def printed(averages, names):
    console = Console(file=io.StringIO(), width=110)
    print_averages(averages, names, console)
    return console.file.getvalue()


def test_numbers_with_their_errors():
    text = printed({"paint": [average([1000.0, 100.0, 0.0, 0.0], std=2.0)]}, ["only"])
    # DoLP 0.1 ± 2/1000 (1 + 0.01)^½, AoLP 0° ± ½ · 2/100 radians; one series needs no column for its name
    assert "1000.0 ± 2.0" in text
    assert "0.1000 ± 0.0020" in text
    # the error is that of the mean: how much the pixels of a scene differ stands beside it
    header, numbers = (re.split(r"  +", line.strip()) for line in text.splitlines()[:2])
    assert numbers[header.index("scatter of I")] == "7"
    assert "0.00 ± 0.57" in text
    assert "only" not in text
    for never in ("saturated", "dead", "dark"):
        assert never not in text


def test_what_is_not_known_has_no_column():
    text = printed({"paint": [average([1000.0, 100.0, 0.0, np.nan])]}, ["a"])
    assert "DoCP" not in text
    assert "DoCP" in printed({"paint": [average([1000.0, 100.0, 0.0, 3.0])]}, ["a"])


@pytest.mark.parametrize(("saturated", "warned"), [(1, False), (2, True)])
def test_many_saturated_pixels_are_a_warning(saturated, warned):
    """The brightest pixels are left out: from more than one in a hundred on, the mean is said to be too low."""
    means = [average([1000.0, 0.0, 0.0, 0.0]), average([1000.0, 0.0, 0.0, 0.0], saturated)]
    text = printed({"paint": means}, ["a", "b"])
    assert ("too low: 2.0% of 'paint' in 'b'" in " ".join(text.split())) is warned
    assert "saturated" in text.splitlines()[0]


def test_many_rows_end_in_the_file(tmp_path):
    means = [average([1000.0 + k, 0.0, 0.0, 0.0]) for k in range(60)]
    names = [f"s{k}" for k in range(60)]
    text = printed({"paint": means}, names)
    assert "s39" in text
    assert "s40" not in text
    assert "20 more rows in summary.csv" in text
    write_averages({"paint": means}, names, tmp_path / "summary.csv")
    with (tmp_path / "summary.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 60
    assert float(rows[59]["I"]) == 1059.0
    assert float(rows[59]["scatter_I"]) == 7.0
