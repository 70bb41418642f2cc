"""Fits of the model: SciPy's optimum, recovered truth, honest uncertainties, clear errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.comparison import compare
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space

SHARED = Path(__file__).parents[3] / "shared" / "data"
FREE = ("sigma", "n", "a", "k", "b", "t")
TRUTH = {name: dict(zip(FREE, values, strict=True)) for name, values in pbrdf.PAINTS.items()}


def in_plane(theta_i_deg, theta_r_deg):
    """Angles in radians, shape (G,), of all pairs; negative θ_r is the backscatter side."""
    ti, tr = (np.deg2rad(a).ravel() for a in np.meshgrid(theta_i_deg, theta_r_deg))
    return ti, np.abs(tr), np.where(tr < 0.0, np.pi, 0.0)


def simulated(model, angles, noise=0.01, seed=0, channels="IQU"):
    stokes = model.stokes(*angles)
    rng = np.random.default_rng(seed)
    std = noise * stokes[:, 0]
    return pbrdf.make_dataset(
        *angles,
        quantity="brdf",
        **{c: stokes[:, "IQUV".index(c)] + std * rng.standard_normal(len(std)) for c in channels},
        std=dict.fromkeys(channels, std),
    )


def scipy_optimum(dataset, result, free=FREE):
    """SciPy's bounded optimum of the same residuals, started a little off ours."""
    data = Observations.from_dataset(dataset)
    fixed = {n: e.value for n, e in result.estimates.items() if n not in free}
    rows = ["IQUV".index(c) for c in data.channels]

    def residual(x):
        model = type(result.model).from_values(
            {**fixed, **dict(zip(free, x, strict=True))}, **result.model.chosen
        )
        S = model.stokes(data.theta_i, data.theta_r, data.phi)
        return ((S.T[rows] - data.values) * data.weights).ravel()

    estimates = [result.estimates[n] for n in free]
    low, high = np.array([[e.lower, e.upper] for e in estimates]).T
    start = np.clip(np.array([e.value for e in estimates]) * 1.02 + 1e-3, low, high)
    return least_squares(
        residual,
        start,
        bounds=(low, high),
        x_scale=np.abs(start),
        jac="3-point",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )


@pytest.fixture(scope="module")
def bundled_fits():
    return {name: pbrdf.fit(pbrdf.open_experiment(name), starts=32) for name in pbrdf.PAINTS}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(pbrdf.PAINTS))
def test_optimum_is_scipys_on_the_bundled_data(name, bundled_fits):
    result = bundled_fits[name]
    peer = scipy_optimum(pbrdf.open_experiment(name), result)
    ours = np.array([result.estimates[n].value for n in FREE])
    errors = np.array([result.estimates[n].std for n in FREE])
    np.testing.assert_allclose(ours, peer.x, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(result.goodness.chi2, 2.0 * peer.cost, rtol=1e-10)
    # standard errors and correlations are those of SciPy's Jacobian
    cov = np.linalg.inv(peer.jac.T @ peer.jac)
    np.testing.assert_allclose(errors, np.sqrt(np.diag(cov)), rtol=1e-3)
    expected = cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    np.testing.assert_allclose(result.correlation.values, expected, atol=2e-3)
    assert list(result.correlation["parameter"].values) == list(FREE)


@pytest.mark.parametrize("name", list(pbrdf.PAINTS))
def test_truth_lies_within_the_standard_errors(name, bundled_fits):
    result = bundled_fits[name]
    pulls = [(result.estimates[n].value - TRUTH[name][n]) / result.estimates[n].std for n in FREE]
    assert np.abs(pulls).max() < 4.0
    assert all(result.estimates[n].verdict == "determined" for n in FREE)
    assert 0.7 < result.goodness.reduced_chi2 < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("wavelength", [460.0, 550.0])
def test_optimum_is_scipys_on_krylon(wavelength):
    path = SHARED / "krylon" / "krylon_blue.brdf"
    if not path.exists():
        pytest.skip("the measured data (shared/data beside the repository) are absent")
    dataset = pbrdf.read(path, wavelength=wavelength)
    result = pbrdf.fit(dataset, starts=16)
    determined = tuple(n for n in FREE if result.estimates[n].verdict == "determined")
    peer = scipy_optimum(dataset, result, determined)
    # a local optimiser with finite differences cannot go below ours
    assert 2.0 * peer.cost >= result.goodness.chi2 * (1.0 - 1e-9)
    np.testing.assert_allclose([result.estimates[n].value for n in determined], peer.x, rtol=1e-6, atol=1e-6)


def test_data_without_noise_give_the_truth_back():
    model = pbrdf.DoubleGauss(0.08, 1.55, 0.7, 0.9, -0.4, 0.8)
    angles = in_plane([20, 45, 65], np.arange(-75, 80, 5))
    result = pbrdf.fit(simulated(model, angles, noise=1e-9), starts=32, noise="0.01")
    for name in FREE:
        assert result.estimates[name].value == pytest.approx(model.values[name], rel=1e-5)
    assert result.optima[0].count >= 16


@pytest.mark.slow
def test_out_of_plane_data_of_the_other_readings_are_fitted():
    angles = in_plane([30, 60], np.arange(-70, 75, 10))
    phi = np.linspace(0.0, np.pi, len(angles[0]))
    for model in (
        pbrdf.DoubleGauss(0.1, 1.7, 0.5, 1.3, 0.3, 0.6, normalization="visible", transmittance="amplitude"),
        pbrdf.ReciprocalDoubleGauss(0.1, 1.7, 0.5, 1.3, 0.3, 0.6, shadowing="smith"),
    ):
        dataset = simulated(model, (angles[0], angles[1], phi), noise=1e-8)
        result = pbrdf.fit(dataset, model.replace(n=1.5), starts=8, noise="0.01")
        assert result.model.chosen == model.chosen
        for name in FREE:
            assert result.estimates[name].value == pytest.approx(model.values[name], rel=1e-4)


@pytest.mark.slow
def test_full_mueller_data_of_an_absorbing_coating():
    """With circular light the extinction κ shows in M34; the sign convention carries through the fit."""
    model = pbrdf.DoubleGauss(0.2, 1.6 - 0.8j, 0.4, 1.1, 0.0, 0.5)
    angles = in_plane([15, 40, 65], np.arange(-60, 75, 15))
    mueller = model.mueller(*angles)
    dataset = pbrdf.make_dataset(*angles, quantity="brdf", mueller=mueller)
    result = pbrdf.fit(dataset, starts=16, free=["kappa"], bounds={"kappa": (0.0, 3.0)})
    assert result.estimates["kappa"].value == pytest.approx(0.8, rel=1e-4)
    assert result.estimates["n"].value == pytest.approx(1.6, rel=1e-4)
    assert result.goodness.data == 16 * len(angles[0])


def test_dolp_alone_is_fitted_as_dolp():
    model = pbrdf.DoubleGauss(0.06, 1.6, 0.5, 1.2, 0.2, 0.7)
    angles = in_plane([25, 50], np.arange(-70, 75, 7))
    stokes = model.stokes(*angles)
    dataset = pbrdf.make_dataset(*angles, quantity="brdf", I=stokes[:, 0], dolp=pbrdf.dolp(stokes))
    result = pbrdf.fit(dataset, starts=16)
    assert set(Observations.from_dataset(dataset).channels) == {"I", "dolp"}
    for name in FREE:
        assert result.estimates[name].value == pytest.approx(model.values[name], rel=1e-3)


def test_dolp_with_aolp_is_fitted_as_signed_shares():
    model = pbrdf.DoubleGauss(0.06, 1.6, 0.5, 1.2, 0.2, 0.7)
    angles = in_plane([25, 50], np.arange(-70, 75, 7))
    stokes = model.stokes(*angles)
    dataset = pbrdf.make_dataset(
        *angles, quantity="brdf", I=stokes[:, 0], dolp=pbrdf.dolp(stokes), aolp=pbrdf.aolp(stokes)
    )
    data = Observations.from_dataset(dataset)
    assert data.channels == ("I", "Q_over_I", "U_over_I")
    shares = stokes[:, 1:3] / stokes[:, :1]
    np.testing.assert_allclose(data.values, np.column_stack([stokes[:, :1], shares]).T, atol=1e-15)


def test_polarised_illumination_enters_the_model():
    model = pbrdf.DoubleGauss(0.06, 1.6, 0.5, 1.2, 0.2, 0.7)
    angles = in_plane([25, 50], np.arange(-70, 75, 7))
    incident = (1.0, -0.6, 0.3, 0.2)
    stokes = model.stokes(*angles, incident=incident)
    dataset = pbrdf.make_dataset(
        *angles, quantity="brdf", **dict(zip("IQUV", stokes.T, strict=True)), illumination=incident
    )
    result = pbrdf.fit(dataset, starts=16)
    for name in FREE:
        assert result.estimates[name].value == pytest.approx(model.values[name], rel=1e-5)


@pytest.mark.slow
def test_standard_errors_are_the_scatter_of_repeated_measurements():
    model = pbrdf.load_paint("cd-back")
    angles = in_plane([30, 45], np.arange(-40, 70, 4))
    estimates = [
        pbrdf.fit(simulated(model, angles, seed=seed), model, starts=1).estimates for seed in range(100)
    ]
    for name in FREE:
        values = np.array([e[name].value for e in estimates])
        reported = np.mean([e[name].std for e in estimates])
        # the scatter of 100 values is itself known to 7 %
        assert values.std(ddof=1) == pytest.approx(reported, rel=0.25), name
        assert abs(values.mean() - model.values[name]) < 4.0 * reported / 10.0, name


def test_assumed_noise_is_rescaled_by_the_residuals():
    """Where the noise is only assumed, standard errors do not depend on its assumed scale."""
    model = pbrdf.load_paint("cd-back")
    angles = in_plane([30, 45], np.arange(-40, 70, 4))
    dataset = simulated(model, angles).drop_vars(["I_std", "Q_std", "U_std"])
    tight = pbrdf.fit(dataset, model, starts=1, noise="0.001,0")
    loose = pbrdf.fit(dataset, model, starts=1, noise="0.1,0")
    for name in FREE:
        assert tight.estimates[name].std == pytest.approx(loose.estimates[name].std, rel=1e-4)
    assert tight.goodness.reduced_chi2 == pytest.approx(1e4 * loose.goodness.reduced_chi2, rel=1e-4)
    assert not tight.std_known


def test_parameters_without_influence_on_the_data_are_not_believed():
    """Intensity within 30° of the normal and far from the mirror direction says nothing about t, n or σ."""
    model = pbrdf.DoubleGauss(0.02, 1.6, 0.5, 1.2, 0.2, 0.7)
    angles = in_plane([5], [-30, -25, -22, -18, 20, 25, 28, 30])
    result = pbrdf.fit(simulated(model, angles, channels="I"), starts=16)
    for name in ("sigma", "n", "t"):
        assert result.estimates[name].verdict != "determined", name
        assert np.isnan(result.estimates[name].std)
    assert any("do not determine" in note and "t" in note for note in result.notes)
    assert any("No polarisation was measured" in note for note in result.notes)


def test_a_parameter_driven_to_its_bound_is_reported_there():
    model = pbrdf.load_paint("cd-back")
    angles = in_plane([30, 45], np.arange(-40, 70, 4))
    result = pbrdf.fit(simulated(model, angles), starts=8, bounds={"n": (1.2, 1.5)})
    estimate = result.estimates["n"]
    assert estimate.verdict == "at upper bound" and estimate.value == pytest.approx(1.5)
    assert np.isnan(estimate.std)
    assert "n" not in result.correlation["parameter"].values
    assert any(note.startswith("n stands at upper bound (1.5)") for note in result.notes)


@pytest.mark.slow
def test_errors_beside_an_active_bound_are_those_of_a_fit_with_that_parameter_fixed():
    """Held by its bound, a parameter takes no part: errors as if it were free, lmfit's and SciPy's, are too large."""
    model = pbrdf.load_paint("cd-back")
    dataset = simulated(model, in_plane([30, 45], np.arange(-40, 70, 4)))
    bounded = pbrdf.fit(dataset, starts=8, bounds={"n": (1.2, 1.5)})
    fixed = pbrdf.fit(dataset, starts=8, fix={"n": 1.5})
    others = [name for name in FREE if name != "n"]
    assert np.isnan(bounded.estimates["n"].std)
    for name in others:
        assert bounded.estimates[name].value == pytest.approx(fixed.estimates[name].value, rel=1e-6)
        assert bounded.estimates[name].std == pytest.approx(fixed.estimates[name].std, rel=1e-5), name
    as_if_free = np.sqrt(np.diag(np.linalg.inv(bounded.information)))
    inside = [i for i, name in enumerate(bounded.space.names) if name != "n"]
    held = np.sqrt(np.diag(np.linalg.inv(bounded.information[np.ix_(inside, inside)])))
    assert (as_if_free[inside] / held).max() > 1.1


def test_fixed_parameters_stay_and_starts_begin_where_told():
    dataset = pbrdf.open_experiment("cd-back")
    result = pbrdf.fit(dataset, fix={"n": 1.742}, start={"t": 0.3}, starts=8)
    assert result.estimates["n"].value == 1.742 and result.estimates["n"].verdict == "fixed"
    assert result.goodness.free == 5
    assert result.start_values.shape == (8, 5)
    np.testing.assert_allclose(result.start_values[:, 4], 0.3)


@pytest.mark.slow
def test_held_out_data_do_not_touch_the_fit():
    dataset = pbrdf.open_experiment("pearl-white")
    spoilt = dataset.copy(deep=True)
    spoilt["I"][dataset["group"].values == 3] *= 3.0
    clean = pbrdf.fit(dataset, hold_out="group=3", starts=8)
    other = pbrdf.fit(spoilt, hold_out="group=3", starts=8)
    for name in FREE:
        assert clean.estimates[name].value == other.estimates[name].value
    assert clean.predicted["all"].count == 21
    assert clean.predicted["all"].intensity_rms < 0.03
    assert other.predicted["all"].intensity_rms > 0.5
    assert clean.fitted["all"].count == 42
    assert clean.goodness.data == 42 * 4


def test_comparison_holds_measured_minus_nothing_lost():
    dataset = pbrdf.open_experiment("cd-back")
    result = pbrdf.fit(dataset, starts=4)
    table = result.comparison
    np.testing.assert_array_equal(table["I_measured"], dataset["I"])
    np.testing.assert_allclose(table["I_residual"], table["I_modelled"] - dataset["I"], rtol=1e-12)
    expected = result.model.stokes(dataset["theta_i"], dataset["theta_r"], dataset["phi"])
    np.testing.assert_allclose(table["Q_modelled"], expected.sel(stokes_out="Q"), rtol=1e-12, atol=1e-15)
    chi2 = sum(float(((table[f"{c}_residual"] / table[f"{c}_std"]) ** 2).sum()) for c in "IQUV")
    assert result.goodness.chi2 == pytest.approx(chi2, rel=1e-9)
    tilt = np.rad2deg(table["facet_tilt"].values)
    signed = np.where(dataset["phi"] > 1.0, -dataset["theta_r"], dataset["theta_r"])
    np.testing.assert_allclose(tilt, np.abs(np.rad2deg(signed - dataset["theta_i"].values)) / 2.0, atol=1e-9)


def test_radiance_is_compared_on_the_scale_of_a_brdf():
    """Radiance under constant irradiance on the source's normal plane carries cosθ_i, a reflectance factor π."""
    model = pbrdf.load_paint("cd-back")
    angles = in_plane([30, 45], np.arange(-40, 70, 4))
    I = model.stokes(*angles)[:, 0]  # noqa: E741
    for quantity, factor in (("radiance", np.cos(angles[0])), ("reflectance_factor", np.pi)):
        data = Observations.from_dataset(pbrdf.make_dataset(*angles, quantity=quantity, I=I * factor))
        np.testing.assert_allclose(data.values[0], I, rtol=1e-14)


def test_points_that_were_not_measured_carry_no_weight():
    dataset = pbrdf.open_experiment("cd-back")
    holes = dataset.copy(deep=True)
    holes["Q"][:20] = np.nan
    data = Observations.from_dataset(holes)
    assert data.count == 4 * 63 - 20
    result = pbrdf.fit(holes, starts=8)
    assert result.goodness.data == 4 * 63 - 20
    assert np.isfinite(result.goodness.chi2)
    assert np.isnan(result.comparison["Q_residual"].values[:20]).all()


@pytest.mark.slow
def test_geometries_that_are_nan_are_as_if_they_were_not_there():
    """One NaN does not bring back the starting values and call that a success, as lmfit's "propagate" does."""
    dataset = pbrdf.open_experiment("cd-back")
    holes = dataset.copy(deep=True)
    for name in "IQUV":
        holes[name][[5, 40]] = np.nan
    without = pbrdf.fit(dataset.drop_isel(geometry=[5, 40]), starts=2)
    found = pbrdf.fit(holes, starts=2)
    assert found.goodness.data == without.goodness.data == 4 * 61
    for name, expected in without.estimates.items():
        assert found.estimates[name].value == pytest.approx(expected.value, rel=1e-9)
        assert found.estimates[name].std == pytest.approx(expected.std, rel=1e-6, nan_ok=True)
        assert found.estimates[name].verdict == expected.verdict


def test_several_optima_are_listed_with_their_starts(bundled_fits):
    """The smoothest paint has a second basin, where the lobe is missed altogether."""
    result = bundled_fits["white"]
    assert sum(o.count for o in result.optima) == result.converged <= result.starts == 32
    chi2 = [o.chi2 for o in result.optima]
    assert chi2 == sorted(chi2) and len(chi2) > 1
    assert chi2[0] == pytest.approx(result.goodness.chi2)


def test_compare_gives_the_dolp_of_unpolarised_and_polarised_data():
    model = pbrdf.load_paint("cd-back")
    angles = in_plane([30], [10.0, 40.0])
    only_I = pbrdf.make_dataset(*angles, quantity="brdf", I=[1.0, 1.0])
    sigma, *others = model.parameters
    value = np.array([model.values["sigma"]])
    space = Space(type(model), {}, (sigma,), {p.name: model.values[p.name] for p in others}, value, value)
    table = compare(space, space.to_unknowns(value), Observations.from_dataset(only_I), only_I)
    np.testing.assert_allclose(table["dolp_modelled"], pbrdf.dolp(model.stokes(*angles)))
    assert "dolp_measured" not in table


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fix": {"q": 1.0}}, "fix: double-gauss has no parameter 'q'"),
        ({"bounds": {"n": (2.0, 1.0)}}, "n needs two finite numbers, the lower first"),
        ({"bounds": {"sigma": (0.0, 0.1)}}, "sigma must be above 0"),
        ({"start": {"n": 5.0}}, "start: n=5 lies outside its bounds"),
        ({"fix": {"n": 1.5}, "start": {"n": 1.5}}, "start: the parameter n is fixed"),
        ({"hold_out": "group=9"}, "no such data; the groups are 1, 2, 3"),
        ({"hold_out": "camera=1"}, "give KIND=VALUE"),
        ({"hold_out": "group=1,2,3"}, "nothing is left to fit"),
        ({"hold_out": "fraction=2"}, "one fraction between 0 and 1"),
        ({"noise": "loud"}, "give RELATIVE or RELATIVE,ABSOLUTE"),
        ({"noise": "0,0"}, "cannot both be 0"),
        ({"starts": 0}, "at least one start"),
        ({"model": "phong"}, "unknown model 'phong': known are double-gauss"),
        ({"options": {"shadow": "x"}}, "has no option 'shadow'"),
        ({"options": {"shadowing": "x"}}, "choose one of 'v-cavity', 'smith', 'none'"),
        ({"fix": {"n": 0.5}}, "n must be at least 1"),
        ({"fix": dict.fromkeys(FREE, 1.0)}, "every parameter is fixed"),
    ],
)
def test_what_cannot_be_fitted_is_said_clearly(arguments, message):
    with pytest.raises(pbrdf.PbrdfError, match="(?s)" + message.replace("(", r"\(")):
        pbrdf.fit(pbrdf.open_experiment("cd-back"), **arguments)


def test_a_held_out_fraction_may_be_given_in_per_cent():
    dataset = pbrdf.open_experiment("matte-white-thick")
    by_share, by_per_cent = (
        pbrdf.HoldOut.parse(text).mask(dataset) for text in ("fraction=0.25", "fraction=25%")
    )
    assert by_share.sum() > 0
    np.testing.assert_array_equal(by_share, by_per_cent)


def test_too_few_values_are_refused():
    dataset = pbrdf.open_experiment("cd-back").isel(geometry=slice(0, 1))
    with pytest.raises(FitError, match="4 measured values cannot determine 6 parameters"):
        pbrdf.fit(dataset)
