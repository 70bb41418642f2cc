"""Fits that used to stall, a lobe narrower than the source with an angle offset; what is said without convergence."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import predict
from pbrdf.inversion.solver import Status
from pbrdf.inversion.unknowns import space_of, with_terms
from pbrdf.inversion.verdict import Level

DEGREE = math.pi / 180.0
TRUTH = {"sigma": 0.007, "n": 1.5, "a": 0.9, "k": 1.1, "b": 0.0, "t": 0.5}


def gloss(angle=-0.2, source=0.7, seed=3):
    """In-plane scan of a glossy white, intensity to 2 %, the lobe half a degree wide; terms in degrees."""
    scans = []
    for incidence in (10.0, 25.0, 40.0, 60.0):
        near = incidence + np.arange(-4.0, 4.1, 0.5)
        wide = np.array([-70.0, -50.0, -30.0, -10.0, 0.0, 20.0, 35.0, 50.0, 70.0])
        signed = np.concatenate([near, wide])
        scans.append(np.column_stack([np.full(len(signed), incidence), signed]))
    theta_i, signed = np.concatenate(scans).T * DEGREE
    angles = theta_i, np.abs(signed), np.where(signed < 0.0, np.pi, 0.0)
    empty = pbrdf.make_dataset(*angles, quantity="brdf", I=np.ones(len(signed)))
    data = Observations.from_dataset(empty)
    terms = [k for k, v in (("angle", angle), ("source", source)) if v is not None]
    space = with_terms(
        space_of("double-gauss", {}, {}, (), {}, {}, data)[0], data, {}, {}, terms, {}, "linear"
    )
    values = {**TRUTH, "angle": (angle or 0.0) * DEGREE, "source": (source or 0.0) * DEGREE}
    exact = predict(space, space.to_unknowns(np.array([values[n] for n in space.names])), data, ["I"])["I"]
    noise = 0.02 * (exact + np.median(exact))
    return pbrdf.make_dataset(
        *angles, quantity="brdf", I=exact + noise * np.random.default_rng(seed).standard_normal(len(exact)),
        std={"I": noise},
    )  # fmt: skip


@pytest.mark.slow
def test_angle_and_source_are_found_with_a_lobe_narrower_than_both():
    result = pbrdf.fit(gloss(), nuisances=["angle", "source"], starts=16)
    assert result.settled and result.converged == 16
    assert result.estimates["angle"].value / DEGREE == pytest.approx(-0.2, abs=0.005)
    assert result.estimates["source"].value / DEGREE == pytest.approx(0.7, abs=0.05)
    assert result.estimates["sigma"].value == pytest.approx(0.007, abs=1e-4)
    assert result.estimates["n"].value == pytest.approx(1.5, abs=0.01)
    for name, truth in (*TRUTH.items(), ("angle", -0.2 * DEGREE), ("source", 0.7 * DEGREE)):
        e = result.estimates[name]
        assert abs(e.value - truth) < 4.0 * e.std and e.verdict == "determined", name
    assert 0.6 < result.goodness.reduced_chi2 < 1.5
    assert result.optima[0].chi2 == result.goodness.chi2, "the fit leads its own list of optima"


@pytest.mark.slow
def test_a_fit_that_starts_at_the_truth_stays_near_it():
    result = pbrdf.fit(gloss(), nuisances=["angle", "source"], start=TRUTH | {"b": 0.01}, starts=1)
    assert result.settled
    assert 0.6 < result.goodness.reduced_chi2 < 1.5


@pytest.mark.slow
def test_a_point_source_is_found_to_be_one():
    """The true radius lies on the bound: the lanes come to rest there or close by, none goes on for ever."""
    # wider lobes end in a valley without rhyme, of 800 times the χ²
    result = pbrdf.fit(
        gloss(angle=None, source=None), nuisances=["source"], starts=16, bounds={"sigma": (0.002, 0.03)}
    )
    assert result.settled and result.converged == 16
    assert result.estimates["source"].value < 0.35 * DEGREE
    assert result.optima[0].chi2 == result.goodness.chi2


@pytest.fixture(scope="module")
def unfinished():
    return pbrdf.fit(gloss(), starts=2, max_iterations=1)


@pytest.mark.slow
def test_a_fit_that_has_not_converged_says_so_first_and_determines_nothing(unfinished):
    assert not unfinished.settled
    verdict = unfinished.verdict()
    assert verdict.level == Level.NOT_CONVERGED and not verdict.level.usable
    assert str(unfinished).split(maxsplit=1)[1].strip().startswith("The fit has not converged")
    free = [e for e in unfinished.estimates.values() if e.verdict != "fixed"]
    assert {e.verdict for e in free} == {"not converged"}
    assert all(math.isnan(e.std) for e in free)
    assert set(verdict.do_not_quote) >= {"sigma", "n", "t"}
    text = " ".join(str(unfinished).split())
    assert "determined to" not in text and "The data determine" not in text
    assert "--iterations" in text
    assert unfinished.optima[0].chi2 == unfinished.goodness.chi2
    assert "has not converged" in unfinished._repr_html_()


@pytest.mark.slow
def test_what_has_not_converged_is_stored_as_such(unfinished, tmp_path):
    unfinished.save(tmp_path / "out")
    again = pbrdf.load_fit(tmp_path / "out")
    assert not again.settled and again.verdict().sentence == unfinished.verdict().sentence
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "The fit has not converged" in page


@pytest.mark.parametrize(
    ("channels", "free", "told"),
    [
        ("I", 6, "40 values at 1 geometry cannot determine 6 parameters"),
        ("IQU", 6, "120 values at 1 geometry cannot determine 6 parameters"),
    ],
)
def test_repeated_readings_of_one_geometry_determine_nothing(channels, free, told):
    columns = {c: np.full(40, 0.3 if c == "I" else 0.01) for c in channels}
    ds = pbrdf.make_dataset(np.full(40, 0.5), np.full(40, 0.6), 0.1, quantity="brdf", **columns)
    with pytest.raises(FitError, match=told):
        pbrdf.fit(ds, starts=1)


def test_geometries_count_once_unless_their_group_or_wavelength_matters():
    angles = (
        np.array([0.5, 0.5, 0.5, 0.5]),
        np.array([0.2, 0.2, 0.2, 0.4]),
        np.array([0.0, 2.0 * np.pi, -1e-17, 0.0]),
    )
    ds = pbrdf.make_dataset(
        *angles, quantity="brdf", I=np.ones(4), Q=np.array([0.1, np.nan, 0.1, np.nan]), group=np.array([1, 1, 2, 2]),
        wavelength=np.array([450.0, 550.0, 450.0, 450.0]),
    )  # fmt: skip
    data = Observations.from_dataset(ds)
    assert data.distinct() == (2, 3)
    assert data.distinct(by_group=True) == (3, 5)
    assert data.distinct(by_wavelength=True) == (3, 4)


def test_which_ends_of_a_lane_are_minima():
    minima = {Status.SMALL_STEP, Status.SMALL_REDUCTION, Status.ZERO_GRADIENT}
    assert {s for s in Status if s.converged} == minima
