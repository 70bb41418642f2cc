"""Error analysis: a hand-computed example, exact run statistics, and the paper's kinds of misfit."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.inversion.erroranalysis import _run_probabilities, error_analysis, residual_structure


def by_hand(**changes):
    """Two groups of four points in the plane of incidence; group 2 is held out."""
    theta_i = np.deg2rad([30.0, 30.0, 30.0, 30.0, 40.0, 40.0, 40.0, 40.0])
    theta_r = np.deg2rad([10.0, 30.0, 50.0, 70.0, 20.0, 40.0, 60.0, 10.0])
    columns = {
        "I_measured": np.array([1.0, 10.0, 2.0, 0.5, 1.0, 20.0, 4.0, 0.0]),
        "I_modelled": np.array([1.1, 9.0, 2.2, 0.4, 1.0, 22.0, 3.0, 0.1]),
        "dolp_measured": np.array([0.02, 0.30, 0.06, 0.10, 0.02, 0.40, 0.08, np.nan]),
        "dolp_modelled": np.array([0.03, 0.28, 0.05, 0.06, 0.02, 0.41, 0.05, 0.01]),
        **changes,
    }
    columns["I_residual"] = columns["I_modelled"] - columns["I_measured"]
    columns["dolp_residual"] = columns["dolp_modelled"] - columns["dolp_measured"]
    table = xr.Dataset(
        {name: ("geometry", values) for name, values in columns.items()},
        coords={
            "theta_i": ("geometry", theta_i),
            "theta_r": ("geometry", theta_r),
            "phi": ("geometry", [0.0] * 7 + [np.pi]),
            "group": ("geometry", [1] * 4 + [2] * 4),
        },
    )
    table["near_specular"] = ("geometry", np.array([0, 1, 0, 0, 0, 1, 0, 0], dtype=bool))
    table["held_out"] = ("geometry", np.array([0] * 4 + [1] * 4, dtype=bool))
    return SimpleNamespace(comparison=table, data=SimpleNamespace(channels=("I", "dolp")))


def test_the_hand_computed_example():
    analysis = error_analysis(by_hand())
    one, two = analysis.groups
    assert (one.group, one.held_out, two.group, two.held_out) == ("1", False, "2", True)
    # errors of group 1: +0.1, −1, +0.2, −0.1; mean −0.2, variance (0.09 + 0.64 + 0.16 + 0.01)/4
    assert one.intensity.mean == pytest.approx(-0.2)
    assert one.intensity.std == pytest.approx(np.sqrt(0.225))
    assert one.intensity.largest == pytest.approx(-1.0)
    assert one.intensity.worst.index == 1
    # relative: +0.1, −0.1, +0.1, −0.2
    assert one.relative.mean == pytest.approx(-0.025)
    assert one.relative.largest == pytest.approx(-0.2) and one.relative.worst.index == 3
    assert np.rad2deg(one.relative.worst.theta_r) == pytest.approx(70.0)
    assert one.strongest_specular.relative_error == pytest.approx(-0.1)
    assert one.strongest_specular.dolp_error == pytest.approx(-0.02)
    assert one.strongest_diffuse.index == 2 and one.strongest_diffuse.intensity == 2.0
    assert one.strongest_diffuse.relative_error == pytest.approx(0.1)
    # right of the peak and off it: θ_r = 50° and 70°
    assert one.dolp_right_of_peak == pytest.approx((-0.01 - 0.04) / 2.0)
    assert one.relative_right_of_peak == pytest.approx((0.1 - 0.2) / 2.0)
    # group 2: what is measured at 0 is relative to 5 % of the median, 1.5, as in the table of errors; in backscatter it
    # lies left of the peak
    assert two.relative.largest == pytest.approx(0.1 / 0.075) and two.relative.worst.index == 7
    assert two.relative.count == 4 and two.intensity.count == 4 and two.dolp.count == 3
    assert two.strongest_specular.intensity_error == pytest.approx(2.0)
    assert two.dolp_right_of_peak == pytest.approx(-0.03)
    assert analysis.dolp.largest == pytest.approx(-0.04) and analysis.dolp.worst.group == "1"
    assert analysis.intensity.count == 8


def test_offset_is_the_signed_tilt_of_the_mirror_facet():
    offset = np.rad2deg(error_analysis(by_hand()).errors["offset"].values)
    np.testing.assert_allclose(offset, [-10.0, 0.0, 10.0, 20.0, -10.0, 0.0, 10.0, -25.0], atol=1e-12)


def test_only_fitted_points_count_in_the_overall_structure():
    analysis = error_analysis(by_hand())
    assert analysis.structure["I"].positive + analysis.structure["I"].negative == 4
    # in the order of the offset: + − + − in group 1; +, 0 (left out), + and − in group 2
    assert analysis.structure["I"].runs == 4
    assert analysis.groups[1].structure["I"].runs == 2


def test_sentences_say_where_and_which_sign():
    text = "\n".join(error_analysis(by_hand()).sentences())
    assert "largest +133.33% at θ_i = 40°, θ_r = 10° in backscatter, group 2" in text
    assert (
        "Group 1: -10.00% in intensity and -0.0200 in DoLP at the strongest specular point; +10.00%" in text
    )
    assert "Group 2 (held out): right of the peak the modelled DoLP lies on average 0.0300 below" in text
    assert "look like chance in every fitted channel" in text


def test_data_without_polarisation_have_no_dolp_errors():
    nothing = np.full(8, np.nan)
    analysis = error_analysis(by_hand(dolp_measured=nothing))
    assert analysis.dolp.count == 0 and analysis.dolp.worst is None and np.isnan(analysis.dolp.std)
    assert np.isnan(analysis.groups[0].dolp_right_of_peak)
    assert not any("DoLP" in s for s in analysis.sentences())
    empty = error_analysis(by_hand(dolp_measured=nothing, I_measured=nothing))
    assert empty.groups[0].strongest_specular is None
    assert empty.sentences()[0].startswith("Neither intensity nor DoLP was measured")


@pytest.mark.parametrize(("positive", "negative"), [(3, 4), (5, 5), (1, 6), (6, 2), (7, 0)])
def test_the_run_test_is_exact(positive, negative):
    """Against every order of the signs; Wald-Wolfowitz mean 1 + 2n₊n₋/n."""
    n = positive + negative
    orders = []
    for chosen in itertools.combinations(range(n), positive):
        signs = np.full(n, -1.0)
        signs[list(chosen)] = 1.0
        orders.append(signs)
    runs = np.array([1 + (s[1:] != s[:-1]).sum() for s in orders])
    for signs, count in zip(orders, runs, strict=True):
        structure = residual_structure([signs])
        assert structure.runs == count
        assert structure.p_runs == pytest.approx((runs <= count).mean(), rel=1e-12)
        assert structure.expected_runs == pytest.approx(1.0 + 2.0 * positive * negative / n)


def test_the_run_test_takes_long_sequences():
    """As many residuals as a table of a renderer has; Wald-Wolfowitz variance 2n₊n₋(2n₊n₋ − n)/(n²(n − 1))."""
    positive, negative = 9000, 11000
    n, product = positive + negative, 2.0 * positive * negative
    probability = _run_probabilities(positive, negative)
    number = np.arange(len(probability))
    assert probability.sum() == pytest.approx(1.0)
    mean = probability @ number
    assert mean == pytest.approx(1.0 + product / n)
    assert probability @ (number - mean) ** 2 == pytest.approx(product * (product - n) / (n**2 * (n - 1.0)))


def test_runs_do_not_go_across_groups_and_zeros_are_left_out():
    structure = residual_structure([np.array([1.0, 2.0, 0.0, 3.0]), np.array([1.0, 1.0]), np.empty(0)])
    assert (structure.positive, structure.negative, structure.runs) == (5, 0, 2)
    assert structure.p_runs == 1.0
    assert structure.p_sign == pytest.approx(2.0 / 2.0**5)
    assert residual_structure([]).p_sign == 1.0


@pytest.mark.slow
def test_chance_is_rarely_called_structure_and_a_wave_always():
    rng = np.random.default_rng(0)
    trials = [residual_structure(list(rng.standard_normal((3, 21)))).structured for _ in range(2000)]
    assert np.mean(trials) <= 0.013  # 1 % by construction, plus scatter
    wave = np.sin(np.linspace(0.0, 2.0 * np.pi, 21) + 0.1)
    assert residual_structure([wave, wave, wave]).structured


def test_opposite_signs_at_two_wavelengths_are_not_taken_for_chance():
    """95 % above 0 at one wavelength and 98 % below at the next: even in all, and so are the runs."""
    rng = np.random.default_rng(3)
    first, second = np.abs(rng.standard_normal((2, 100)))
    first[rng.choice(100, 5, replace=False)] *= -1.0
    second *= -1.0
    second[rng.choice(100, 2, replace=False)] *= -1.0
    together = residual_structure([first, second])
    assert together.p_sign > 0.5 and together.p_runs > 0.01 and not together.structured
    apart = residual_structure([first, second], {"550 nm": first, "650 nm": second})
    assert apart.structured and (apart.stratum, apart.above, apart.below) == ("650 nm", 2, 98)
    # three tests were made, so the probability counts three times
    alone = residual_structure([second])
    assert apart.p_sign == pytest.approx(3.0 * alone.p_sign)
    # the other way round
    assert residual_structure([-first, -second], {"550 nm": -first, "650 nm": -second}).above == 98


@pytest.mark.slow
def test_strata_are_rarely_called_structured_by_chance():
    rng = np.random.default_rng(0)
    trials = []
    for _ in range(1000):
        data = rng.standard_normal((6, 21))
        strata = {str(k): row for k, row in enumerate(data)}
        trials.append(residual_structure(list(data), strata).structured)
    assert np.mean(trials) <= 0.015


def test_the_analysis_tests_groups_and_wavelengths():
    rng = np.random.default_rng(4)
    measured = np.full(8, 1.0)
    shift = np.array([0.1, 0.2, 0.1, 0.3, -0.1, -0.2, -0.1, -0.3])
    fit = by_hand(I_measured=measured, I_modelled=measured + shift * (1.0 + 0.01 * rng.standard_normal(8)))
    fit.comparison["held_out"] = ("geometry", np.zeros(8, dtype=bool))
    assert error_analysis(fit).structure["I"].stratum.startswith("group ")
    coloured = by_hand(I_measured=measured, I_modelled=measured + shift)
    coloured.comparison["held_out"] = ("geometry", np.zeros(8, dtype=bool))
    coloured.comparison["group"] = ("geometry", np.ones(8, dtype=int))
    coloured.comparison = coloured.comparison.assign_coords(
        wavelength=("geometry", [550.0] * 4 + [650.0] * 4)
    )
    structure = error_analysis(coloured).structure["I"]
    assert structure.stratum in ("550 nm", "650 nm") and abs(structure.above - structure.below) == 4


@pytest.mark.slow
def test_the_right_model_leaves_chance_and_a_wrong_one_structure():
    """Without its polarised diffuse part (t = 0) the model's DoLP lies below the data right of the peak."""
    dataset = pbrdf.open_experiment("matte-white-thick")
    right = error_analysis(pbrdf.fit(dataset, hold_out="group=3", starts=4))
    assert not any(s.structured for s in right.structure.values())
    assert right.dolp.std < 0.015
    assert all(abs(g.dolp_right_of_peak) < 0.01 for g in right.groups)
    assert [g.held_out for g in right.groups] == [False, False, True]
    wrong = error_analysis(pbrdf.fit(dataset, hold_out="group=3", starts=4, fix={"t": 0.0}))
    assert wrong.structure["Q"].structured
    assert all(g.dolp_right_of_peak < -0.03 for g in wrong.groups)
    assert any("right of the peak" in s and "below" in s for s in wrong.sentences())
    assert any("The residuals of Q are structured" in s for s in wrong.sentences())


def test_the_strongest_points_are_the_brightest_measured():
    dataset = pbrdf.open_experiment("cd-back")
    result = pbrdf.fit(dataset, starts=4)
    table = result.comparison
    for group, errors in zip((1, 2, 3), error_analysis(result).groups, strict=True):
        members = table.isel(geometry=(table["group"].values == group))
        near = members["near_specular"].values
        intensity = members["I_measured"].values
        assert errors.strongest_specular.intensity == intensity[near].max()
        assert errors.strongest_diffuse.intensity == intensity[~near].max()
        assert errors.strongest_specular.relative_error == pytest.approx(
            float(table["I_residual"][errors.strongest_specular.index])
            / float(table["I_measured"][errors.strongest_specular.index])
        )
