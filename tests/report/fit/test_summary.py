import io
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

import pbrdf
from pbrdf.inversion.estimates import DistinctOptimum
from pbrdf.report.fit.folder import fit_record
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import (
    correlation_in_words,
    goodness_in_words,
    optima_in_words,
    print_summary,
    summary_text,
    verdict_in_words,
)
from pbrdf.report.numbers import brief


def test_the_summary_names_everything(report):
    text = summary_text(report)
    result = report.result
    for fragment in (
        "matte-white-thick",
        "simulated, not measured",
        "42 of 63 geometries",
        "476 nm",
        "natural light",
        "group=3: 21 geometries",
        "standard uncertainties of the data set",
        "determined to",
        "consistent with the stated noise",
        f"{result.optima[0].count} of 8 starts reached the best optimum",
        "predicted, near-specular",
        "predicted, off-specular",
        "DoLP",
    ):
        assert fragment in " ".join(text.split()), fragment
    estimate = result.estimates["n"]
    assert f"{estimate.value:.4f} ± {estimate.std:.4f}" in text
    assert max(len(line) for line in text.splitlines()) <= 110


@pytest.mark.slow
def test_values_that_are_not_numbers_are_left_out_with_a_word(report):
    """The number of NaN stands beside the number of values, and nothing is said where there is none."""
    assert "NaN" not in summary_text(report)
    dataset = pbrdf.open_experiment("cd-back")
    dataset["Q"][:20] = np.nan
    result = pbrdf.fit(dataset, starts=4)
    text = " ".join(summary_text(Report(result, dataset, "holes")).split())
    assert "232 measured values of I, Q, U, V (20 more are NaN and left out)" in text


def test_the_summary_of_assumed_noise_is_called_relative(hemisphere_report):
    text = summary_text(hemisphere_report)
    assert "relative only, as the data state no uncertainty" in text
    assert "assumed" in text
    assert "DoLP rms" not in text
    assert "The file does not say where phi = 0 lies; forward was assumed." in text
    assert "fixed" in text


def test_the_matrix_is_shown_on_demand(report):
    assert "+1.000" not in summary_text(report)
    assert summary_text(report, verbose=True).count("+1.000") == len(report.result.correlation)


def test_a_narrow_terminal_gets_a_narrow_table(report):
    console = Console(file=io.StringIO(), width=80, color_system=None)
    print_summary(report, console)
    text = console.file.getvalue()
    assert "Minnaert" not in text
    assert "determined to" in text
    assert max(len(line.rstrip()) for line in text.splitlines()) <= 80


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("n", {"value": 1.6, "std": 0.0064, "verdict": "determined"}, "determined to 0.40 %"),
        ("t", {"value": 0.2, "std": 0.08, "verdict": "determined"}, "poorly determined, to 40 %"),
        ("b", {"value": 0.01, "std": 0.02, "verdict": "determined"}, "determined to ±0.02"),
        ("t", {"verdict": "undetermined"}, "not determined by these data"),
        ("t", {"verdict": "at upper bound"}, "at its upper bound"),
        ("n", {"verdict": "fixed", "lower": 1.6, "upper": 1.6}, "fixed"),
        ("n", {"verdict": "fixed", "lower": 1.5, "upper": 1.6}, "fixed at each wavelength"),
    ],
)
def test_verdicts_in_words(report, name, changes, words):
    assert verdict_in_words(replace(report.result.estimates[name], **changes)) == words


def test_an_undetermined_value_stands_in_brackets(report):
    estimates = dict(report.result.estimates)
    estimates["t"] = replace(estimates["t"], value=0.123, std=math.nan, verdict="undetermined")
    text = summary_text(Report(replace(report.result, estimates=estimates), report.dataset, "x"))
    assert "(0.123)" in text


def test_strong_correlations_are_named_as_pairs(report):
    names = ["a", "b", "k"]
    matrix = np.array([[1.0, -0.97, 0.1], [-0.97, 1.0, 0.93], [0.1, 0.93, 1.0]])
    correlation = xr.DataArray(
        matrix, dims=("parameter", "other"), coords={"parameter": names, "other": names}
    )
    lines = correlation_in_words(replace(report.result, correlation=correlation))
    assert len(lines) == 2
    assert lines[0].startswith("a and b (r = −0.97): raising one and lowering the other")
    assert lines[1].startswith("b and k (r = 0.93): raising both")
    single = correlation.isel(parameter=[0], other=[0])
    assert "fewer than two" in correlation_in_words(replace(report.result, correlation=single))[0]


@pytest.mark.parametrize(
    ("reduced", "words"),
    [
        (1.05, "consistent with the stated noise"),
        (4.0, "2 times the stated noise: the model misses something"),
        (0.25, "0.5 times the stated noise: the noise is overstated"),
        (1e-20, "reproduces the data exactly"),
    ],
)
def test_reduced_chi2_in_words(report, reduced, words):
    goodness = replace(report.result.goodness, reduced_chi2=reduced)
    assert words in goodness_in_words(replace(report.result, goodness=goodness))[0]


def test_channels_without_signal_have_no_r_squared(report):
    lines = "\n".join(goodness_in_words(report.result))
    assert "without an R²: U, V" in lines
    assert "R²: I 0.999" in lines


def test_no_degrees_of_freedom(report):
    goodness = replace(report.result.goodness, data=6, free=6, reduced_chi2=math.nan)
    assert "no degrees of freedom" in goodness_in_words(replace(report.result, goodness=goodness))[0]


def test_optima_in_words(report):
    values = {"sigma": 0.04, "n": 1.6}
    result = replace(
        report.result,
        optima=[
            DistinctOptimum(values, 100.0, 52),
            DistinctOptimum(values, 100.3, 1),
            DistinctOptimum(values, 900.0, 3),
        ],
        starts=64,
        converged=60,
    )
    lines = optima_in_words(result)
    assert lines[0].startswith("52 of 64 starts reached the best optimum")
    assert "χ² higher by 0.3 (1 start): sigma 0.04, n 1.6" in lines[1]
    assert lines[2] == "4 starts did not converge"
    assert "9 times the χ² (3 starts)" in optima_in_words(replace(result, optima=result.optima[::2]))[1]
    assert optima_in_words(replace(result, optima=[])) == ["none of 64 starts converged"]
    assert "no other optimum" in optima_in_words(replace(result, optima=result.optima[:1]))[1]
    alone = replace(result, optima=result.optima[:1], starts=1, converged=1)
    assert optima_in_words(alone) == [
        f"the only start reached an optimum (χ² = {brief(result.optima[0].chi2)})"
    ]


def test_dark_geometries_are_blamed_for_a_large_rms(report):
    errors = {"all": replace(report.result.fitted["all"], intensity_rms=40.0, intensity_median=0.04)}
    text = summary_text(Report(replace(report.result, fitted=errors), report.dataset, "x"))
    assert "trust the median" in text
    assert "trust the median" not in summary_text(report)


@pytest.mark.slow
def test_angles_of_the_instrument_are_in_degrees(report):
    result = pbrdf.fit(report.dataset, nuisances=["angle"], starts=2)
    text = summary_text(Report(result, report.dataset, "x"))
    (line,) = [line for line in text.splitlines() if line.startswith("δ (angle)")]
    assert "°" in line
    assert "−2 … 2" in line
    stored = fit_record(Report(result, report.dataset, "x"))["estimates"]["angle"]
    assert stored["unit"] == "degree"
    assert stored["upper"] == pytest.approx(2.0)
