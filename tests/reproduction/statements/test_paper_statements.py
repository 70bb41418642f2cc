"""What the paper says, tested on every interpretation of its equations: numbers and verdicts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import independent as ref
from pbrdf.data.paints import PAINTS
from pbrdf.reproduction.interpretations import DEFAULT, INTERPRETATIONS, LITERAL, Interpretation
from pbrdf.reproduction.statements.catalogue import PRINTED, RECOVERED, STATEMENTS, evaluate
from pbrdf.reproduction.statements.expected import expected_numbers
from pbrdf.reproduction.statements.intensity import diffuse_intensity_falls, narrow_peaks, peaks_alike
from pbrdf.reproduction.statements.limits import rough_and_smooth
from pbrdf.reproduction.statements.parameters import agreement, polarised_shares, roughnesses, starts_agree
from pbrdf.reproduction.statements.polarisation import (
    crossed_and_growing,
    equal_view_equal_dop,
    falls_to_zero_and_rises,
    maximum_grows,
    zeros_beside_the_peak,
)
from pbrdf.reproduction.statements.statement import Kind

#: Statements about the model that each interpretation contradicts, at bistatic angles of 60°, 80°, 100°.
CONTRADICTED = {
    "weighted / flux": {10},
    "weighted / amplitude": {10, 11},
    "visible / flux": {10, 17, 19},
    "visible / amplitude": {4, 6, 10, 11, 17, 19},
}


@pytest.mark.slow
@pytest.mark.parametrize("interpretation", INTERPRETATIONS, ids=lambda r: r.name)
def test_each_interpretation_contradicts_these_statements_and_no_others(reproduction, interpretation):
    tested = {e.statement.number: e for e in reproduction.statements if interpretation.name in e.outcomes}
    assert set(tested) == {1, 2, 3, 4, 6, 9, 10, 11, 13, 15, 16, 17, 18, 19}
    failed = {number for number, e in tested.items() if not e.outcomes[interpretation.name].passed}
    assert failed == CONTRADICTED[interpretation.name]


def test_the_default_is_the_interpretation_that_contradicts_least():
    assert Interpretation("weighted", "flux") == DEFAULT
    assert Interpretation("visible", "amplitude") == LITERAL
    assert min(CONTRADICTED, key=lambda name: len(CONTRADICTED[name])) == DEFAULT.name


@pytest.mark.slow
def test_every_statement_is_listed_once_and_those_about_measured_data_are_not_tested(reproduction):
    assert [s.number for s in STATEMENTS] == list(range(1, 29))
    for entry in reproduction.statements:
        measured = entry.statement.kind in (Kind.MEASURED, Kind.SHOWN)
        assert bool(entry.outcomes) != measured
        assert entry.statement.tested
    on_parameters = {e.statement.number: set(e.outcomes) for e in reproduction.statements if e.outcomes}
    assert on_parameters[7] == on_parameters[8] == {PRINTED, RECOVERED}
    assert on_parameters[25] == {RECOVERED}


@pytest.mark.slow
def test_table_1_obeys_the_statements_on_parameters(reproduction):
    for entry in reproduction.statements:
        if PRINTED in entry.outcomes:
            assert entry.outcomes[PRINTED].passed
    sigma, _, _, _, _, t = zip(*PAINTS.values(), strict=True)
    assert roughnesses(sigma).value == sigma
    assert not roughnesses(sigma[::-1]).passed
    assert not roughnesses((sigma[0], sigma[2], sigma[1], *sigma[3:])).passed
    assert polarised_shares(t).passed
    assert not polarised_shares((t[1], t[0], *t[2:])).passed


@pytest.mark.slow
def test_numbers_worked_out_beforehand_are_met_but_for_one():
    """All but the zeros of sample 3 beside the peak: 7.4° on the near side where 6° to 7° were expected."""
    rows = expected_numbers()
    outside = [row for row in rows if not row.within]
    assert {(row.statement, row.interpretation) for row in outside} == {(18, DEFAULT.name)}
    for row in outside:
        assert "sample 3" in row.quantity
        assert row.found[0] == pytest.approx(7.43, abs=0.02)
        assert 6.0 <= row.found[1] <= 7.0
    assert {row.statement for row in rows} == {1, 4, 10, 11, 16, 18, 19}
    assert [row.statement for row in rows] == sorted(row.statement for row in rows)


@pytest.mark.slow
def test_a_number_outside_its_tolerance_is_called_so():
    row = expected_numbers()[0]
    assert row.within
    assert not replace(row, found=tuple(v + 1.1 * row.tolerance for v in row.expected)).within
    assert not replace(row, found=(*row.found[:3], 70.0, row.found[4])).within  # a NaN was expected


def test_04_zeros_of_figure_3_with_rough_facets(positions):
    """The full model at σ = 0.1: −3.82° and 64.67°; a flat coating would have −3.45° and 64.35°."""
    behind, ahead, largest, where = falls_to_zero_and_rises(DEFAULT, positions).value
    assert (behind, ahead) == pytest.approx((-3.82, 64.67), abs=0.01)
    assert largest == pytest.approx(0.206, abs=0.001)
    assert where == pytest.approx(46.0, abs=0.2)


def test_04_three_zeros_on_one_side_are_no_fall_to_zero_and_rise(positions):
    outcome = falls_to_zero_and_rises(LITERAL, positions)
    assert not outcome.passed
    assert outcome.text.startswith("zeros at −2.26, 3.90, 13.01, 45.23°")


def test_02_the_rough_limit_needs_the_facets(positions):
    """The contrast of the mirror limit is a lobe of height R/(8 π σ² cos²θ) (f over a body of 1/π)."""
    value = rough_and_smooth(DEFAULT, positions).value
    reflectance = ref.mirror_mueller(np.deg2rad(30.0), 1.5)[0, 0]
    lobe = reflectance / (8.0 * np.pi * 0.002**2 * np.cos(np.deg2rad(30.0)) ** 2)
    # the grid of angles passes through the mirror direction
    assert value[0] == pytest.approx((lobe + 1.0 / np.pi) * np.pi, rel=2e-3)
    assert value[-2] < 1.1


def test_06_half_widths_are_those_of_the_slopes(positions):
    """A turn of the sample tilts the mirror facet by as much: half width σ √(2 ln 2) for a lobe alone (sample 1)."""
    width = narrow_peaks(DEFAULT, positions).value[0]
    assert width == pytest.approx(np.rad2deg(0.006 * np.sqrt(2.0 * np.log(2.0))), abs=0.03)


def test_10_peaks_are_alike_where_the_bistatic_angles_are_small():
    """Fresnel's gain makes up for the cosine's loss between Ψ = 30° and 50°, not between 60° and 100°."""
    assert peaks_alike(DEFAULT, np.deg2rad([30.0, 40.0, 50.0])).passed
    ratios = peaks_alike(DEFAULT, np.deg2rad([30.0, 50.0, 70.0])).value
    assert ratios[2] == pytest.approx(2.19 / 1.91, abs=0.01)


def test_11_amplitudes_contradict_the_text_in_both_normalizations(positions):
    for interpretation in INTERPRETATIONS:
        outcome = diffuse_intensity_falls(interpretation, positions)
        assert outcome.passed == (interpretation.transmittance == "flux")
        assert len(outcome.value) == 5


def test_16_beyond_brewster_the_statement_fails():
    """At Ψ = 130° the local incidence is past Brewster's angle, and the maximum falls again."""
    outcome = maximum_grows(DEFAULT, np.deg2rad([60.0, 120.0, 135.0]))
    assert not outcome.passed
    assert outcome.value[2] < outcome.value[1]


def test_17_and_18_light_from_inside_is_crossed_to_reflected_light(positions):
    assert crossed_and_growing(DEFAULT, positions).value[-2:] == (5.0, 1.0)
    left_1, right_1, left_3, right_3 = zeros_beside_the_peak(DEFAULT, positions).value
    assert (left_1, right_1) == pytest.approx((-1.40, 1.39), abs=0.01)
    assert (left_3, right_3) == pytest.approx((-7.41, 6.63), abs=0.01)


def test_19_the_pearl_paint_breaks_the_rule_under_the_letter(positions):
    weighted, visible = (equal_view_equal_dop(r, positions).value for r in (DEFAULT, LITERAL))
    assert max(weighted) < 0.001
    assert visible[3] == max(visible) > 0.04


def stub(chi2, sigma):
    """A sample as far as the agreement of its starts goes."""
    result = SimpleNamespace(
        chi2_by_start=np.array(chi2),
        start_values=np.array(sigma)[:, None],
        starts=len(chi2),
        optima=sorted(set(chi2)),
        space=SimpleNamespace(names=["sigma"]),
    )
    return SimpleNamespace(result=result)


def test_25_one_start_that_ends_elsewhere_breaks_the_agreement():
    same = stub([10.0, 10.0 + 1e-5, 10.0], [0.1, 0.2, 0.3])
    other = stub([10.0, 10.0, 500.0], [0.01, 0.02, 0.3])
    assert starts_agree([same, same]).passed
    outcome = starts_agree([same, other])
    assert not outcome.passed
    assert outcome.value == (1.0, pytest.approx(2 / 3))
    found = agreement(other)
    assert (found.reached, found.starts, found.optima) == (2, 3, 2)
    assert (found.reached_sigma, found.missed_sigma) == (0.02, 0.3)
    assert np.isnan(agreement(same).missed_sigma)


def test_25_a_start_without_an_end_does_not_agree():
    assert not starts_agree([stub([10.0, np.inf], [0.1, 0.2])]).passed


@pytest.mark.slow
def test_evaluation_tells_how_far_it_is(reproduction, positions, monkeypatch):
    monkeypatch.setattr("pbrdf.reproduction.statements.catalogue.STATEMENTS", STATEMENTS[4:8])
    calls = []
    found = evaluate(positions, reproduction.samples, lambda done, of: calls.append((done, of)))
    assert [e.statement.number for e in found] == [5, 6, 7, 8]
    assert calls == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]
