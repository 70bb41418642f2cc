"""A model that a user wrote goes through everything that a fit offers."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from own_model import LambertGGX
from pbrdf.errors import FitError
from pbrdf.inversion.problem import predict

TRUTH = LambertGGX(alpha=0.12, index=1.55, rho=0.3)


def dataset_of(model, theta_i=(20.0, 50.0), gain=1.0, dark=0.0, turned=0.0, noise=0.01, groups=1):
    """Stokes data in the plane of incidence with errors of 1 % of I, on the scale ``gain``."""
    rng = np.random.default_rng(1)
    i, r = (a.ravel() for a in np.meshgrid(np.deg2rad(theta_i), np.deg2rad(np.arange(-70.0, 75.0, 5.0))))
    true_i, true_r = i + turned, r - turned
    stokes = gain * model.stokes(np.abs(true_i), np.abs(true_r), np.where(true_r < 0.0, np.pi, 0.0))
    std = {c: np.maximum(noise, 1e-3) * stokes[:, 0] for c in "IQU"}
    values = {
        c: stokes[:, k] + noise * stokes[:, 0] * rng.standard_normal(len(i)) for k, c in enumerate("IQU")
    }
    values["I"] = values["I"] + dark
    angles = i, np.abs(r), np.where(r < 0.0, np.pi, 0.0)
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=std, group=np.arange(len(i)) % groups)


@pytest.fixture(scope="module")
def result():
    return pbrdf.fit(dataset_of(TRUTH), LambertGGX, starts=16, hold_out="theta_i=50")


def within(result, errors=4.0):
    for name, expected in TRUTH.values.items():
        estimate = result.estimates[name]
        if estimate.verdict == "determined":
            assert abs(estimate.value - expected) < errors * estimate.std, name


def test_a_joint_fit_finds_the_parameters_and_predicts(result):
    within(result)
    assert {n: e.verdict for n, e in result.estimates.items()} == {
        "alpha": "determined", "index": "determined", "extinction": "fixed", "rho": "determined",
    }  # fmt: skip
    assert result.predicted["all"].intensity_median < 0.03
    assert result.goodness.reduced_chi2 == pytest.approx(1.0, abs=0.4)


@pytest.mark.slow
def test_a_parameter_that_the_data_do_not_see_has_no_standard_error():
    """Q and U of facets do not see a Lambertian body at all: its error is none, not 0 as ``curve_fit`` has it."""
    dataset = dataset_of(TRUTH)
    dataset["I"][:] = np.nan
    found = pbrdf.fit(dataset, LambertGGX, starts=8)
    albedo = found.estimates["rho"]
    assert albedo.verdict == "undetermined" and np.isnan(albedo.std)
    assert found.information[found.space.names.index("rho")] == pytest.approx(0.0, abs=0.0)
    for name in ("alpha", "index"):
        assert found.estimates[name].verdict == "determined" and found.estimates[name].std > 0.0


def test_the_stepwise_strategy_takes_the_parts_from_the_declaration():
    result = pbrdf.fit(dataset_of(TRUTH), LambertGGX, starts=8, strategy="stepwise")
    within(result)
    assert [stage.free for stage in result.stages][:2] == [("rho",), ("alpha", "index")]
    assert result.comparison["used_for_diffuse"].values.any()
    with pytest.raises(
        FitError, match="at least one of rho and one of alpha, index, extinction must be free"
    ):
        pbrdf.fit(dataset_of(TRUTH), LambertGGX, fix={"rho": 0.3}, strategy="stepwise")


@pytest.mark.parametrize(
    ("nuisance", "made", "expected"),
    [
        ("gain", {"gain": 3.0}, 3.0),
        ("dark", {"dark": 0.01}, 0.01),
        ("angle", {"turned": np.deg2rad(0.2)}, np.deg2rad(0.2)),
        ("source", {}, 0.0),
    ],
)
def test_every_nuisance_is_found(nuisance, made, expected):
    # a dark offset of a BRDF is just what a Lambertian body adds; a gain is known by the height of the lobe alone
    fix = {"gain": {"index": 1.55}, "dark": {"rho": 0.3}}.get(nuisance, {})
    result = pbrdf.fit(dataset_of(TRUTH, **made), LambertGGX, starts=8, nuisances=[nuisance], fix=fix)
    estimate = result.estimates[nuisance]
    if estimate.verdict == "determined":
        assert abs(estimate.value - expected) < 4.0 * estimate.std
    else:
        assert estimate.verdict == "at lower bound" and expected == 0.0
    if nuisance != "gain":
        within(result)


def test_a_parameter_free_for_each_group_and_an_extinction_set_free():
    data = dataset_of(TRUTH, groups=2)
    result = pbrdf.fit(data, LambertGGX, starts=8, split={"rho": "group"}, free=["extinction"])
    assert {"rho[0]", "rho[1]", "extinction"} <= set(result.estimates)
    for label in ("rho[0]", "rho[1]"):
        assert result.estimates[label].value == pytest.approx(0.3, rel=0.05)


def test_the_analyses_beyond_the_fit(result):
    profile = result.profile(points=5)
    assert set(profile.intervals) == {"alpha", "index", "rho"}
    for name, interval in profile.intervals.items():
        assert interval.lower < result.estimates[name].value < interval.upper
    assert result.contour("alpha", "index", points=5).grid["chi2_rise"].dims == ("alpha", "index")
    samples = result.bootstrap(50)
    spread = samples.samples.std("sample", ddof=1)
    for name in ("alpha", "index", "rho"):
        assert float(spread.sel(parameter=name)) == pytest.approx(result.estimates[name].std, rel=0.4)
    assert result.identifiability().sentences
    checks = {finding.check for finding in result.plausibility()}
    assert checks == {"energy", "realisability", "parameters", "lobe", "range"}
    assert result.error_analysis().sentences()
    folds = pbrdf.cross_validate(dataset_of(TRUTH), LambertGGX, by="theta_i", starts=4)
    assert len(folds.folds) == 2


def test_sentences_name_the_models_own_parameters():
    data = dataset_of(TRUTH, theta_i=(20.0,))
    far = data.isel(geometry=np.abs(np.rad2deg(data["theta_r"].values) - 20.0) > 25.0)
    result = pbrdf.fit(far, LambertGGX, starts=4, fix={"alpha": 0.05})
    (lobe,) = [f for f in result.plausibility() if f.check == "lobe"]
    assert "α and n rest on the tail of the lobe" in lobe.sentence


class Misnamed(LambertGGX):
    """A parameter with the name of a nuisance is not mistaken for it."""

    name = "misnamed"
    parameters = (*LambertGGX.parameters[:3], type(LambertGGX.parameters[3])(
        "gain", "g", "1", "albedo of the body", 1e-3, 2.0, (0.0, 10.0), 0.5, amplitude=True, part="diffuse"
    ))  # fmt: skip

    def kernel(self, geometry, values, part="total"):
        return super().kernel(geometry, {**values, "rho": values["gain"]}, part)


def test_a_parameter_named_like_a_nuisance_is_not_mistaken_for_it():
    result = pbrdf.fit(dataset_of(TRUTH), Misnamed, starts=8)
    assert result.estimates["gain"].value == pytest.approx(0.3, rel=0.02)
    shown = predict(result.space, result.unknowns, result.data, ("I",))["I"]
    data = result.data
    np.testing.assert_allclose(
        shown, result.model.stokes(data.theta_i, data.theta_r, data.phi)[:, 0], rtol=1e-12
    )
    with pytest.raises(FitError, match="misnamed has a parameter of the same name"):
        pbrdf.fit(dataset_of(TRUTH), Misnamed, nuisances=["gain"])
