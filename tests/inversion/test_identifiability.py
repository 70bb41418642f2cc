"""Combinations that data do not determine: degenerate by construction, and checked with SciPy."""

from __future__ import annotations

import numpy as np
from linear_helpers import design, linear_fit
from scipy.optimize import least_squares

import pbrdf
from pbrdf.inversion.identifiability import identifiability


def test_two_equal_columns_are_named_and_the_third_is_not(monkeypatch):
    matrix = design()[:, [0, 1, 1]]
    result = linear_fit(monkeypatch, matrix, matrix @ [1.0, 2.0, 2.0])
    result.unknowns = np.array([1.0, 2.0, 2.0])
    found = identifiability(result, described=True)
    assert found.condition == np.inf
    (combination,) = found.combinations
    assert not combination.determined
    assert set(combination.changes) == {"y", "z"}
    # only the sum counts, and one of the two goes all the way to its bound
    np.testing.assert_allclose(combination.changes["y"], -combination.changes["z"])
    assert max(np.abs(list(combination.changes.values()))) > 40.0
    assert combination.rise < 1e-6
    assert "do not determine" in found.sentences[0] and "apart" in found.sentences[0]


def test_an_unknown_without_influence_is_named_alone(monkeypatch):
    matrix = design() * [1.0, 0.0, 1.0]
    result = linear_fit(monkeypatch, matrix, matrix @ [1.0, 0.0, 2.0])
    found = identifiability(result, described=True)
    assert found.sentences == [
        "The data do not determine y: moving it anywhere between -50 and 50 changes χ² by less than 1 (the others "
        "refitted)."
    ]
    assert np.isnan(found.parameters["inflation"].sel(parameter="y"))


def test_angles_are_told_in_degrees(monkeypatch):
    """The tables that stand above these sentences have them in degrees."""
    matrix = design() * [1e3, 0.0, 1e3]
    bounds = np.deg2rad([-2.0, 2.0])
    result = linear_fit(monkeypatch, matrix, matrix @ [0.01, 0.0, 0.02], *bounds, unit="rad")
    (sentence,) = identifiability(result, described=True).sentences
    assert "y: moving it anywhere between -2° and 2° changes" in sentence
    matrix = matrix[:, [0, 0, 2]]
    result = linear_fit(monkeypatch, matrix, matrix @ [0.01, 0.0, 0.02], *bounds, unit="rad")
    sentence = identifiability(result, described=True).sentences[0]
    assert sentence.count("°") == 4 and " to 2.0°" in sentence, sentence


def test_variance_inflation_is_that_of_regression(monkeypatch):
    """1/(1 − R²) of each column regressed on the others (uncentred), and both standard errors."""
    matrix = design()
    result = linear_fit(monkeypatch, matrix, matrix @ [1.0, 2.0, 3.0])
    found = identifiability(result, described=True).parameters
    for i, name in enumerate("xyz"):
        others, column = np.delete(matrix, i, axis=1), matrix[:, i]
        left = column - others @ np.linalg.lstsq(others, column, rcond=None)[0]
        np.testing.assert_allclose(
            found["inflation"].sel(parameter=name), (column @ column) / (left @ left), rtol=1e-9
        )
        np.testing.assert_allclose(found["conditional_std"].sel(parameter=name), 1 / np.sqrt(column @ column))
        np.testing.assert_allclose(found["marginal_std"].sel(parameter=name), 1 / np.sqrt(left @ left))


def test_well_measured_data_determine_everything():
    result = pbrdf.fit(pbrdf.open_experiment("matte-white-thick"), starts=16)
    found = identifiability(result)
    assert found.sentences == [
        "The data determine every free parameter; no combination of them is nearly free."
    ]
    errors = [result.estimates[n].std for n in result.space.names]
    np.testing.assert_allclose(found.parameters["marginal_std"], errors, rtol=1e-6)
    vectors = found.directions.values
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(6), atol=1e-12)
    assert (np.diff(found.eigenvalues) >= 0.0).all()


def test_one_bistatic_angle_does_not_tell_a_and_b_apart():
    """exp(b cosω) is a constant factor at one camera position, so only a exp(b cosω) is measured."""
    dataset = pbrdf.open_experiment("matte-white-thick")
    first = dataset.isel(geometry=np.flatnonzero(dataset["group"].values == 1))
    ti, tr, phi = (first[n].values for n in ("theta_i", "theta_r", "phi"))
    cosine = np.sin(ti) * np.sin(tr) * np.cos(phi) - np.cos(ti) * np.cos(tr)
    assert np.ptp(cosine) < 1e-12
    result = pbrdf.fit(first, starts=16)
    worst = identifiability(result).combinations[0]
    assert not worst.determined and set(worst.changes) == {"a", "b"}
    a = result.estimates["a"].value
    change = np.log1p(worst.changes["a"] / a) / worst.changes["b"]
    np.testing.assert_allclose(change, -cosine.mean(), rtol=1e-4)
    assert worst.rise < 1e-6


def test_intensity_away_from_the_lobe_trades_n_for_t():
    """The sentence is true: SciPy, the named parameters moved and the others refitted, finds χ² + 1 at most."""
    dataset = pbrdf.open_experiment("matte-white-thick")
    near = pbrdf.fit(dataset, starts=16).comparison["near_specular"].values
    dataset = dataset.drop_vars([f"{c}{s}" for c in "QUV" for s in ("", "_std")])
    result = pbrdf.fit(dataset.isel(geometry=np.flatnonzero(~near)), starts=16)
    found = identifiability(result)
    assert float(found.parameters["inflation"].sel(parameter="n")) > 10.0
    trade = next(c for c in found.combinations if {"n", "t"} <= set(c.changes))
    assert trade.determined and trade.changes["n"] * trade.changes["t"] < 0.0
    assert " trade off: " in trade.sentence and "changes χ² by less than 1" in trade.sentence
    moved = {name: result.estimates[name].value + change for name, change in trade.changes.items()}
    others = [name for name in result.space.names if name not in moved]
    data = result.data

    def residual(values):
        model = result.model.replace(**moved, **dict(zip(others, values, strict=True)))
        return (
            (model.stokes(data.theta_i, data.theta_r, data.phi)[:, 0] - data.values) * data.weights
        ).ravel()

    start = np.array([result.estimates[n].value for n in others])
    peer = least_squares(residual, start, x_scale=np.abs(start), xtol=1e-14, ftol=1e-14)
    rise = 2.0 * peer.cost - result.goodness.chi2
    assert 0.2 < rise < 1.0
    np.testing.assert_allclose(rise, trade.rise, atol=1e-3)


def test_parameters_on_a_bound_are_left_out_and_named():
    dataset = pbrdf.open_experiment("matte-white-thick")
    result = pbrdf.fit(dataset, starts=16, bounds={"t": (0.0, 0.5)})
    found = identifiability(result)
    assert found.at_bound == ["t"]
    assert "t" not in found.directions["parameter"]
    first, second = found.sentences
    assert "The data determine sigma, n, a, k and b; no combination of these" in first or "trade off" in first
    assert second == "Not determined, as the optimum lies on a bound: t."
    assert not any("every free parameter" in sentence for sentence in found.sentences)


def test_nothing_but_bounds_determines_nothing(monkeypatch):
    matrix = design()[:, :1]
    result = linear_fit(monkeypatch, matrix, matrix @ [9.0], upper=3.0)
    found = identifiability(result, described=True)
    assert found.sentences == ["Not determined, as the optimum lies on a bound: x."]
    assert found.eigenvalues.shape == (0,) and found.condition == np.inf


def test_a_model_that_does_not_describe_the_data_has_nothing_determined(monkeypatch):
    matrix = design()
    result = linear_fit(monkeypatch, matrix, matrix @ [1.0, 2.0, 3.0])
    (sentence,) = identifiability(result, described=False).sentences
    assert sentence.startswith("Nothing can be said of what the data determine")
    assert len(identifiability(result, described=True).sentences) >= 1
