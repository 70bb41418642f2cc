"""Cross-validation: closed forms of a linear problem, agreement with single fits, divisions, clear errors."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.crossvalidation import SCHEMES, cross_validate

NAMES = ("sigma", "n", "a", "k", "b", "t")
PAINT = "matte-white-thick"


def only_amplitude():
    """Intensities of three groups that disagree about a, with all else fixed: f = specular + a·(diffuse/a)."""
    model = pbrdf.load_paint(PAINT)
    theta_i = np.deg2rad(np.repeat([20.0, 40.0, 60.0], 5))
    theta_r = np.deg2rad(np.tile([0.0, 15.0, 30.0, 45.0, 70.0], 3))
    group = np.repeat([1, 2, 3], 5)
    specular = model.stokes(theta_i, theta_r, 0.0, part="specular")[:, 0]
    shape = model.stokes(theta_i, theta_r, 0.0, part="diffuse")[:, 0] / model.values["a"]
    amplitude = np.array([1.4, 1.5, 1.7])[group - 1]
    rng = np.random.default_rng(3)
    std = 0.02 * (specular + amplitude * shape)
    intensity = specular + amplitude * shape + std * rng.standard_normal(15)
    dataset = pbrdf.make_dataset(
        theta_i, theta_r, np.zeros(15), quantity="brdf", I=intensity, std={"I": std}, group=group
    )
    fixed = {name: float(model.values[name]) for name in NAMES if name != "a"}
    return dataset, fixed, specular, shape


def least_squares(keep, dataset, specular, shape):
    """Weighted least squares of the one linear parameter."""
    weight = 1.0 / dataset["I_std"].values[keep] ** 2
    y, x = dataset["I"].values[keep] - specular[keep], shape[keep]
    return (weight * x * y).sum() / (weight * x * x).sum()


def test_a_linear_problem_has_the_closed_form_in_every_fold():
    dataset, fixed, specular, shape = only_amplitude()
    result = cross_validate(dataset, fix=fixed, starts=2)
    intensity, std, group = (dataset[name].values for name in ("I", "I_std", "group"))
    expected = np.array([least_squares(group != g, dataset, specular, shape) for g in (1, 2, 3)])
    np.testing.assert_allclose(result.parameters["value"].values[:, 0], expected, rtol=1e-7)
    assert result.parameters["full"].item() == pytest.approx(
        least_squares(group > 0, dataset, specular, shape), rel=1e-7
    )
    predicted = specular + expected[group - 1] * shape
    np.testing.assert_allclose(result.comparison["I_modelled"], predicted, rtol=1e-7)
    relative = predicted / intensity - 1.0
    assert result.prediction.intensity_rms == pytest.approx(np.sqrt((relative**2).mean()), rel=1e-6)
    assert result.prediction.intensity_max == pytest.approx(np.abs(relative).max(), rel=1e-6)
    assert result.folds[1].prediction.intensity_median == pytest.approx(
        np.median(np.abs(relative[group == 2])), rel=1e-6
    )
    assert result.score == pytest.approx(np.sqrt((((predicted - intensity) / std) ** 2).mean()), rel=1e-6)
    # jackknife of three folds: √(2/3 Σ(x − mean)²)
    spread = np.sqrt(2.0 / 3.0 * ((expected - expected.mean()) ** 2).sum())
    assert result.parameters["jackknife"].item() == pytest.approx(spread, rel=1e-6)
    assert result.parameters["std"].item() == pytest.approx(expected.std(ddof=1), rel=1e-6)


def test_parts_that_disagree_about_a_parameter_are_named():
    dataset, fixed, *_ = only_amplitude()
    result = cross_validate(dataset, fix=fixed, starts=2)
    assert result.score > 1.3 * result.fitted_score
    assert any("a differs between folds more than its standard error allows" in s for s in result.sentences())


def test_an_amplitude_of_each_group_is_predicted_from_those_of_the_others():
    """Nothing speaks for the amplitude of a group left out whole: the mean of the others' logarithms counts."""
    dataset, fixed, specular, shape = only_amplitude()
    result = cross_validate(dataset, fix=fixed, split={"a": "group"}, starts=2)
    group = dataset["group"].values
    own = {g: least_squares(group == g, dataset, specular, shape) for g in (1, 2, 3)}
    for g, fold in zip((1, 2, 3), result.folds, strict=True):
        others = [own[h] for h in (1, 2, 3) if h != g]
        expected = specular + np.sqrt(others[0] * others[1]) * shape
        np.testing.assert_allclose(
            result.comparison["I_modelled"].values[group == g], expected[group == g], rtol=1e-6
        )
        assert fold.values[f"a[{g}]"] == pytest.approx(np.sqrt(others[0] * others[1]), rel=1e-6)


@pytest.mark.slow
def test_a_fold_is_the_fit_that_holds_it_out():
    dataset = pbrdf.open_experiment(PAINT)
    result = cross_validate(dataset, starts=8)
    assert [f.label for f in result.folds] == ["group 1", "group 2", "group 3"]
    assert all(f.converged and f.reached >= 4 for f in result.folds)
    single = pbrdf.fit(dataset, hold_out="group=3", starts=8)
    fold = result.folds[2]
    assert fold.chi2 == pytest.approx(single.goodness.chi2, rel=1e-9)
    for name in NAMES:
        assert fold.values[name] == pytest.approx(single.estimates[name].value, rel=1e-5)
    for name in ("intensity_rms", "intensity_max", "dolp_rms", "dolp_max"):
        assert getattr(fold.prediction, name) == pytest.approx(
            getattr(single.predicted["all"], name), rel=1e-4
        )
    held = dataset["group"].values == 3
    np.testing.assert_array_equal(fold.held_out, held)
    np.testing.assert_allclose(
        result.comparison["Q_modelled"].values[held], single.comparison["Q_modelled"].values[held], rtol=1e-5
    )


@pytest.mark.slow
def test_the_right_model_predicts_to_the_noise():
    """The bundled data follow the model with their stated noise: the score is 1 within its own scatter."""
    result = cross_validate(pbrdf.open_experiment(PAINT), starts=4, by="fraction", folds=4)
    values = 4 * 63
    assert result.score == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * values))
    assert result.fitted_score < result.score
    assert result.prediction.count == 63
    ratio = result.parameters["jackknife"] / result.parameters["standard_error"]
    assert 0.2 < float(ratio.median()) < 3.0


@pytest.mark.parametrize("by", SCHEMES)
def test_every_geometry_is_left_out_exactly_once(by):
    dataset, fixed, *_ = only_amplitude()
    result = cross_validate(dataset, fix=fixed, starts=1, by=by, folds=3)
    left_out = np.sum([f.held_out for f in result.folds], axis=0)
    np.testing.assert_array_equal(left_out, 1)
    assert [int(f.held_out.sum()) for f in result.folds] == [5, 5, 5] or by == "angle"
    for number, fold in enumerate(result.folds):
        np.testing.assert_array_equal(result.comparison["fold"].values == number, fold.held_out)


def test_blocks_of_angle_are_neighbours_and_signed():
    dataset = pbrdf.open_experiment(PAINT)
    result = cross_validate(dataset, starts=1, by="angle", folds=4, fix={"n": 1.62})
    signed = np.rad2deg(np.where(dataset["phi"] > 1.0, -dataset["theta_r"], dataset["theta_r"]))
    blocks = [signed[f.held_out] for f in result.folds]
    assert all(a.max() < b.min() for a, b in itertools.pairwise(blocks))
    assert blocks[0].min() < 0.0
    assert all(10 <= len(b) <= 22 for b in blocks)
    assert result.folds[0].label == f"θ_r {blocks[0].min():.3g}° … {blocks[0].max():.3g}°"


def test_fewer_folds_than_groups_share_them_out():
    dataset, fixed, *_ = only_amplitude()
    result = cross_validate(dataset, fix=fixed, starts=1, folds=2)
    assert [f.label for f in result.folds] == ["group 1, 3", "group 2"]
    by_angle = cross_validate(dataset, fix=fixed, starts=1, by="theta_i")
    assert [f.label for f in by_angle.folds] == [f"angle of incidence {a}°" for a in (20, 40, 60)]


def test_the_division_by_fraction_follows_the_seed():
    dataset, fixed, *_ = only_amplitude()
    first, again, other = (
        cross_validate(dataset, fix=fixed, starts=1, by="fraction", seed=s).comparison["fold"].values
        for s in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(np.bincount(first), [3] * 5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"by": "camera"}, "by='camera': choose one of 'group', 'theta_i', 'angle', 'fraction'"),
        ({"folds": 1}, "folds=1: at least two"),
        ({"folds": 4}, "folds=4: the data set has only 3 values of group"),
        ({"by": "angle", "folds": 7}, "folds=7: 5 distinct angles θ_r do not make that many blocks"),
        ({"by": "fraction", "folds": 99}, "folds=99: the data set has only 15 geometries"),
        ({"starts": 0}, "starts=0"),
        ({"hold_out": "group=1"}, "leave hold_out away"),
    ],
)
def test_what_cannot_be_divided_is_said_clearly(arguments, message):
    dataset, fixed, *_ = only_amplitude()
    with pytest.raises(FitError, match=message):
        cross_validate(dataset, **{"fix": fixed, **arguments})


def test_one_group_and_folds_that_leave_too_little_are_refused():
    dataset, fixed, *_ = only_amplitude()
    one = dataset.isel(geometry=slice(0, 5))
    with pytest.raises(FitError, match="only one group; divide it by 'angle' or 'fraction'"):
        cross_validate(one, fix=fixed)
    eight = dataset.isel(geometry=slice(0, 8))
    with pytest.raises(FitError, match="without group 1 3 measured values are left, too few for 6"):
        cross_validate(eight, starts=1)
