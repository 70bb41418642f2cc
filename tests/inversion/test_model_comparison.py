"""Comparison of models on simulated data: the true one wins, what holds it ties with it, failures are listed."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import pbrdf
from own_model import LambertGGX
from pbrdf.errors import FitError, ModelError
from pbrdf.inversion.ladder import Rung
from pbrdf.inversion.model_comparison import DESCRIBES, compare_models
from pbrdf.models import DoubleGauss

TRUTH = DoubleGauss(sigma=0.12, n=1.55, a=0.4, k=1.3, b=0.3, t=0.7)


class Broken(LambertGGX):
    """A model whose kernel fails."""

    name = "broken"

    def kernel(self, geometry, values, part="total"):
        raise ZeroDivisionError("never finished")


class Hungry(LambertGGX):
    """A model with more parameters than there are data."""

    name = "hungry"
    parameters = (
        *LambertGGX.parameters,
        *(pbrdf.Parameter(f"spare{i}", "s", "1", "no use", 0.0, 1.0, (0.0, 1.0), 0.5) for i in range(90)),
    )


def simulated(model, theta_i=(20.0, 35.0, 50.0, 65.0), channels="IQU", noise=0.02):
    """Data in the plane of incidence with errors of 2 % of I."""
    rng = np.random.default_rng(7)
    i, r = (a.ravel() for a in np.meshgrid(np.deg2rad(theta_i), np.deg2rad(np.arange(-60.0, 80.0, 10.0))))
    angles = i, np.abs(r), np.where(r < 0.0, np.pi, 0.0)
    stokes = model.stokes(*angles)
    std = dict.fromkeys(channels, noise * stokes[:, 0])
    values = {c: stokes[:, "IQU".index(c)] + std[c] * rng.standard_normal(len(i)) for c in channels}
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=std)


@pytest.fixture(scope="module")
def polarised():
    seen = []
    found = compare_models(
        simulated(TRUTH),
        ["double-gauss", LambertGGX, Broken],
        vary=1,
        starts=4,
        progress=lambda *state: seen.append(state),
    )
    return found, seen


@pytest.mark.slow
def test_the_true_model_wins_and_what_holds_it_cannot_be_told_apart(polarised):
    found, _ = polarised
    assert found.best.name.startswith("double-gauss") and "unpolarised" not in found.best.name
    leaders = {c.name for c in found.leaders}
    assert "double-gauss" in leaders
    # of the readings the best is varied
    varied = {c.name for c in found.ranking if c.rung.cls is DoubleGauss and " + " in c.name}
    assert {name.split(" + ", 1)[1] for name in varied} in (
        {"cauchy", "source"},
        {"cauchy", "cauchy + source"},
    )
    assert varied <= leaders
    assert found["lambert-ggx"].behind.apart and found["lambert-ggx"].behind.difference > 0.03
    assert found.best.score < DESCRIBES
    sentences = found.sentences()
    assert sentences[0].startswith(f"{found.best.name} predicts best")
    assert any("cannot be told apart from it" in s for s in sentences)
    assert "2.0 %" in sentences[0] or found.best.score == pytest.approx(0.025, abs=0.01)


@pytest.mark.slow
def test_what_polarised_body_light_buys(polarised):
    found, _ = polarised
    paired = found.paired("double-gauss, unpolarised body", "double-gauss")
    assert paired.apart and paired.difference > 0.0 and 0.0 < paired.uncertainty < paired.difference
    assert any(
        s.startswith("The assumption unpolarised body (t = 0) in double-gauss costs (")
        for s in found.sentences()
    )


def test_a_rung_that_fails_is_listed_and_stops_nothing(polarised):
    found, _ = polarised
    (failure,) = found.failures
    assert failure.rung.name == "broken"
    assert "never finished" in failure.reason
    assert "broken" not in found


def test_all_predict_the_same_geometries_from_the_same_data(polarised):
    found, _ = polarised
    first = found.best
    for other in found.ranking[1:]:
        np.testing.assert_array_equal(other.comparison["fold"], first.comparison["fold"])
        np.testing.assert_array_equal(other.result.data.std, first.result.data.std)
        np.testing.assert_array_equal(other.comparison["I_measured"], first.comparison["I_measured"])
        assert other.errors.intensity.shape == first.errors.intensity.shape == (56,)
        np.testing.assert_array_equal(np.isnan(other.errors.polarised), np.isnan(first.errors.polarised))


def test_information_criteria_are_those_of_the_fits_and_none_for_a_robust_loss(polarised):
    found, _ = polarised
    plain = found["double-gauss"]
    assert plain.aic == plain.result.goodness.aic and plain.bic == plain.result.goodness.bic
    assert plain.aic < found["lambert-ggx"].aic
    robust = next(c for c in found.ranking if c.rung.loss == "cauchy")
    assert math.isnan(robust.aic) and math.isnan(robust.bic)


def test_progress(polarised):
    found, seen = polarised
    rungs = len(found.ranking) + len(found.failures)
    assert [done for _, done, _ in seen[:-1]] == list(range(rungs))
    ((_, done, total),) = seen[-1:]
    assert done == total >= rungs
    assert seen[-1][0] == "done"


@pytest.fixture(scope="module")
def unpolarised():
    """Intensities of a body that emits no polarised light, one angle of incidence held out."""
    return compare_models(
        simulated(TRUTH.replace(t=0.0), channels="I"),
        ["double-gauss", LambertGGX(0.1, 1.5, 0.3), Hungry],
        hold_out="theta_i=35",
        vary=0,
        starts=4,
    )


@pytest.mark.slow
def test_where_the_body_is_unpolarised_the_ablation_costs_nothing(unpolarised):
    paired = unpolarised.paired("double-gauss, unpolarised body", "double-gauss")
    assert not paired.apart and abs(paired.difference) < 0.002
    assert "double-gauss, unpolarised body" in {c.name for c in unpolarised.leaders}
    assert any(
        s.startswith(
            "The assumption unpolarised body (t = 0) in double-gauss costs nothing that these data show"
        )
        for s in unpolarised.sentences()
    )


@pytest.mark.slow
def test_one_split_is_that_of_a_fit(unpolarised):
    single = pbrdf.fit(simulated(TRUTH.replace(t=0.0), channels="I"), hold_out="theta_i=35", starts=4)
    found = unpolarised["double-gauss"]
    assert found.errors.intensity_median == pytest.approx(single.predicted["all"].intensity_median, rel=1e-9)
    assert unpolarised.held_out.sum() == single.predicted["all"].count == 14
    assert unpolarised.by == "theta_i=35 held out"
    assert unpolarised.units == "12 bands of neighbouring directions"


def test_too_many_parameters_for_the_data_are_a_reason(unpolarised):
    (failure,) = unpolarised.failures
    assert failure.rung.name == "hungry"
    assert "cannot determine" in failure.reason


def test_where_nothing_describes_the_sample_it_is_said_and_where_it_fails():
    """A mirror-like lobe for a model whose facets are rough."""
    data = simulated(TRUTH.replace(sigma=0.03), channels="I")
    rung = Rung("rough only", LambertGGX, fix={"alpha": 0.8, "index": 1.3})
    found = compare_models(data, [rung], hold_out="theta_i=50,20", vary=0, starts=2)
    sentences = found.sentences()
    assert sentences[0].startswith("No model of this ladder describes the")
    (fails,) = [s for s in sentences if s.startswith("Where rough only fails")]
    regions = {name: (count, size, bias) for name, count, size, bias in found.regions()}
    assert regions["theta_i=50"][0] == regions["theta_i=20"][0] == 14
    assert regions["all that was held out"][0] == 28
    worst = max((r for r in regions.items() if r[0] != "all that was held out"), key=lambda r: r[1][1])
    assert worst[0] in fails
    assert found.score_in_words == "median relative error of the intensity"


def at_wavelengths(*pairs):
    """Data sets one after the other, each at a wavelength in nm."""
    marked = [data.assign_coords(wavelength=("geometry", np.full(56, nm))) for nm, data in pairs]
    return xr.concat(
        marked, dim="geometry", data_vars="minimal", coords="minimal", compat="override", join="override"
    )


@pytest.mark.slow
def test_amplitudes_are_free_for_each_wavelength():
    blue, red = simulated(TRUTH, channels="I"), simulated(TRUTH.replace(a=0.1), channels="I")
    ablated = Rung("t = 0", DoubleGauss, fix={"t": 0.0})
    data = at_wavelengths((450.0, blue), (650.0, red))
    found = compare_models(data, [ablated], hold_out="theta_i=50", vary=0, starts=4)
    assert [n for n in found.best.result.space.names if n.startswith("a")] == ["a[450]", "a[650]"]
    many = at_wavelengths(*((400.0 + 10.0 * k, blue) for k in range(10)))
    with pytest.raises(FitError, match="the data hold 10 wavelengths"):
        compare_models(many, ["double-gauss"])


def test_how_data_are_divided_by_default():
    several = compare_models(simulated(TRUTH, channels="I"), [LambertGGX], vary=0, starts=1)
    assert several.by == "4 folds by theta_i, each predicted from the others"
    one = compare_models(simulated(TRUTH, theta_i=(40.0,), channels="I"), [LambertGGX], vary=0, starts=1)
    assert one.by == "5 folds by angle, each predicted from the others"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"hold_out": "theta_i=50", "by": "theta_i"}, FitError, "give one of the two"),
        ({"hold_out": "theta_i=51"}, FitError, "no such data; the values of theta_i are 20, 35, 50, 65"),
        ({"by": "weekday"}, FitError, "by='weekday': choose one of 'group'"),
        ({"starts": 0}, FitError, "at least one start"),
        ({"vary": -1}, FitError, "vary=-1"),
        ({"models": ["phong"]}, ModelError, "unknown model"),
        ({"models": [Broken]}, FitError, "no model could be fitted: ZeroDivisionError: never finished"),
    ],
)
def test_clear_errors(arguments, error, message):
    with pytest.raises(error, match=message):
        compare_models(simulated(TRUTH, channels="I"), **{"models": [LambertGGX], **arguments})


def test_the_front_door():
    assert pbrdf.compare is compare_models
